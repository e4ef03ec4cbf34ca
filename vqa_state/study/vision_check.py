"""Before a run on a new model: does it see the image at all, and how long will the run take?

A server that drops the image answers everything, fluently, and knows nothing; it is the commonest
silent fault. So a model is looked at (`models.sight`) before its first run on this machine.
"""

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

from PIL import Image

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models import Failure, VQAModel
from vqa_state.models.capability_cache import KnownModel, known_as, known_model, remember
from vqa_state.models.length_limit import cut_off_sentence
from vqa_state.models.memory import Memory
from vqa_state.models.vision_check import (
    N_CALLS,
    PROBES,
    Said,
    Sight,
    is_clear,
    replies_until,
    sight_of,
)
from vqa_state.study.collect import AskPlan

__all__ = ["CheckProgress", "ModelCheck", "Pace", "check_model", "first_look", "recalled"]

#: Questions of the two timed calls; what they take gives the price of an image and of a question.
_FEW, _MANY = 4, 16

_TIMED = tuple(f"Is the door number {number} open?" for number in range(_FEW + _MANY))


@dataclass(frozen=True, slots=True)
class Pace:
    """What a call costs here: seconds for an image, and for each question about it."""

    image: float
    question: float

    def seconds(self, plan: AskPlan) -> float:
        """What is left of a plan takes about so long, one image after another."""
        if not plan.n_questions:
            return 0.0
        n_copies = plan.n_to_ask / plan.n_questions
        return n_copies * (self.image + plan.n_questions * self.question)


@dataclass(frozen=True, slots=True)
class ModelCheck:
    """What is known of a model on this machine.

    Attributes:
        name, fingerprint, notes: see `VQAModel`.
        sight: whether it sees.
        pace: what asking takes; None if that was not measured or calls failed.
        memory: of this process with the model in it; None if it was not measured now.
        n_calls, n_failed: calls made, and those of them that gave no answer.
        failure: why the last one failed; "" if none did.
        n_cut_off: answers that the length limit ended before yes or no.
    """

    name: str
    fingerprint: str
    notes: tuple[str, ...]
    sight: Sight
    pace: Pace | None = None
    memory: Memory | None = None
    n_calls: int = 0
    n_failed: int = 0
    failure: str = ""
    n_cut_off: int = 0

    @property
    def sentence(self) -> str:
        """What was found, for the user."""
        if not self.n_cut_off:
            return self._seen
        return f"{self._seen} {cut_off_sentence(self.n_cut_off, self.name)}"

    @property
    def _seen(self) -> str:
        if self.sight is Sight.SILENT:
            none = self.n_failed + self.n_cut_off == self.n_calls
            why = self.failure or ("no whole answer" if self.n_cut_off else "no reply") + " came"
            return f"It gave {'no answer' if none else 'too few answers to say more'}: {why}."
        found = {
            Sight.TELLS: "It sees: it tells the states of the pictures that it was shown apart.",
            Sight.SEES: (
                "It sees, but it said the same about both states of everything that it was shown; "
                "expect little of it, or try another prompt."
            ),
            Sight.BLIND: (
                "Warning: it says the same whatever the picture, even a blank one. A server may "
                "drop the image, or the model cannot see; try another model before you pay for "
                "a run."
            ),
        }[self.sight]
        if not self.n_failed:
            return found
        return f"{found} {self.n_failed} of {self.n_calls} calls failed: {self.failure}."

    @property
    def warns(self) -> bool:
        """Whether the user should read it before a run."""
        return self.sight is not Sight.TELLS or self.n_failed > 0 or self.n_cut_off > 0


@dataclass(frozen=True, slots=True)
class CheckProgress:
    """How far a check is, in calls; `result` comes with the last, `seconds` since the first."""

    n_done: int
    n_total: int
    result: ModelCheck | None = None
    seconds: float = 0.0

    @property
    def seconds_left(self) -> float | None:
        """At most, by the pace so far; None before the first call."""
        return self.seconds / self.n_done * (self.n_total - self.n_done) if self.n_done else None


def check_model(
    model: VQAModel, stop: Callable[[], bool] = lambda: False
) -> Iterator[CheckProgress]:
    """Show it all pictures, then time it; what is found is kept for this machine.

    Yields:
        A report after every call, and a last one with the result; fewer after a stop, which ends
        it within a call where the model can.
    """
    run = _Run(model, stop, N_CALLS + len(_TIMED))
    said = yield from _shown(run, whole=True)
    sight = sight_of(said)
    pace = None
    if sight is not Sight.SILENT and not stop():
        pace = yield from _pace(run)
    if not stop():
        yield _ended(run, sight, pace)


def first_look(
    model: VQAModel, stop: Callable[[], bool] = lambda: False
) -> Iterator[CheckProgress]:
    """Whether a model sees: asked of it once on this machine, then known. Nothing is timed.

    It ends at the first thing that the model gets all right.

    Yields:
        A report after every call, and a last one with the result; fewer after a stop.
    """
    known = known_model(model.fingerprint)
    if known is not None and known.sight is not None:
        found = ModelCheck(model.name, model.fingerprint, tuple(model.notes), known.sight)
        yield CheckProgress(0, 0, found)
        return
    run = _Run(model, stop, N_CALLS)
    said = yield from _shown(run, whole=False)
    if not stop():
        yield _ended(run, sight_of(said), None)


def recalled(name: str) -> ModelCheck | None:
    """What was found last on this machine of a model with this name; nothing is asked of it."""
    known = known_as(name)
    if known is None or known.sight is None:
        return None
    pace = memory = None
    if known.image is not None and known.question is not None:
        pace = Pace(known.image, known.question)
    if known.megabytes:
        memory = Memory(known.megabytes, known.gpu_megabytes)
    return ModelCheck(name, known.fingerprint, (), known.sight, pace, memory)


@dataclass
class _Run:
    """A check under way."""

    model: VQAModel
    stop: Callable[[], bool]
    n_total: int
    n_done: int = 0
    failures: list[str] = field(default_factory=list)
    n_cut_off: int = 0
    began: float = field(default_factory=time.monotonic)

    def ask(
        self, images: Sequence[Image.Image], questions: Sequence[str]
    ) -> Generator[CheckProgress, None, Said]:
        """Some calls; what failed of them is noted and left out."""
        said: dict[tuple[int, int], Answer] = {}
        open_pairs = {(i, q) for i in range(len(images)) for q in range(len(questions))}
        reason = "the model gave no reply to this question"
        try:
            for reply in replies_until(self.model, images, questions, self.stop):
                pair = (reply.image, reply.question)
                if pair not in open_pairs:
                    continue
                open_pairs.discard(pair)
                if isinstance(reply.outcome, Failure):
                    self.failures.append(reply.outcome.reason)
                else:
                    said[pair] = reply.outcome
                    self.n_cut_off += reply.outcome.cut_off
                self.n_done += 1
                seconds = time.monotonic() - self.began
                yield CheckProgress(self.n_done, self.n_total, seconds=seconds)
        except ModelError as error:
            reason = str(error)
        self.n_done += len(open_pairs)  # after a stop nobody reads these
        self.failures += [reason] * len(open_pairs)
        return said


def _shown(run: _Run, *, whole: bool) -> Generator[CheckProgress, None, list[Said]]:
    """What it says of the probes; not `whole`: of as many as are needed."""
    said: list[Said] = []
    for probe in PROBES:
        said.append((yield from run.ask(probe.pictures(), probe.questions)))
        is_enough = not said[-1] or (is_clear(said[-1]) and not whole)
        if is_enough or run.stop():
            break
    return said


def _ended(run: _Run, sight: Sight, pace: Pace | None) -> CheckProgress:
    """The last report; what can be relied on is kept."""
    model, memory = run.model, Memory.now()
    failure = run.failures[-1] if run.failures else ""
    numbers = (run.n_done, len(run.failures))
    notes = tuple(model.notes)
    found = ModelCheck(model.name, model.fingerprint, notes, sight, pace, memory, *numbers, failure)
    found = replace(found, n_cut_off=run.n_cut_off)
    is_sure = sight is Sight.TELLS or not (run.failures or run.n_cut_off)
    if is_sure or pace is not None:
        remember(
            KnownModel(
                model.name,
                model.fingerprint,
                sight if is_sure else None,
                pace.image if pace else None,
                pace.question if pace else None,
                memory.process,
                memory.gpu,
            )
        )
    return CheckProgress(run.n_total, run.n_total, found)


def _pace(run: _Run) -> Generator[CheckProgress, None, Pace | None]:
    """From two calls about one picture: a line through what few and what many questions took.

    The picture is drawn so that no server has it in its cache yet. None if a call failed: an error
    comes sooner than an answer.
    """
    seconds = []
    for seed, questions in enumerate((_TIMED[:_FEW], _TIMED[_FEW:]), 1):
        picture = Image.effect_noise((640, 480), 40 + seed).convert("RGB")
        began = time.perf_counter()
        said = yield from run.ask([picture], questions)
        seconds.append(time.perf_counter() - began)
        if len(said) < len(questions):
            return None
    question = max(0.0, (seconds[1] - seconds[0]) / (_MANY - _FEW))
    return Pace(max(0.0, seconds[0] - _FEW * question), question)
