"""Before a run on a new model: does it see the image at all, and how long will the run take?

A server that drops the image answers everything, fluently, and knows nothing; it is the commonest
silent fault. So the model is shown three things in both states and a blank picture. One that says
the same about all of them, whatever is asked, does not see.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import psutil
from PIL import Image

from vqa_state.answers import Answer
from vqa_state.asking import AskPlan
from vqa_state.errors import ModelError
from vqa_state.models.base import Failure, VQAModel

__all__ = ["PROBES", "CheckProgress", "ModelCheck", "Pace", "Probe", "Sight", "check_model"]

_FOLDER = Path(__file__).with_name("probe_pictures")

#: Two answers with the same text differ if their p_yes differ by more.
_SAME = 0.001

#: Questions of the two timed calls; what they take gives the price of an image and of a question.
_FEW, _MANY = 4, 16

_TIMED = tuple(f"Is the door number {number} open?" for number in range(_FEW + _MANY))


@dataclass(frozen=True, slots=True)
class Probe:
    """A thing in both states, and what is asked about it."""

    name: str
    questions: tuple[str, str]

    def pictures(self) -> tuple[Image.Image, Image.Image]:
        """Positive and negative, 256 x 256 RGB; rendered, they are part of the package."""
        names = (f"{self.name}_positive.jpg", f"{self.name}_negative.jpg")
        opened = [Image.open(_FOLDER / name).convert("RGB") for name in names]
        return opened[0], opened[1]


PROBES = (
    Probe("light", ("Is the light on?", "Does this image look like the light is off?")),
    Probe("door", ("Is the door open?", "Does this image look like the door is closed?")),
    Probe("display", ("Is the display on?", "Does this image look like the display is off?")),
)


class Sight(StrEnum):
    """What the probe found."""

    TELLS = "tells"
    """It says different things about the two states of at least one thing."""
    SEES = "sees"
    """It says the same about both states, but something else about a blank picture."""
    BLIND = "blind"
    """It says the same whatever the picture."""
    SILENT = "silent"
    """It gave no answer."""


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
        pace: what asking takes; None if it gave no answer.
        megabytes: memory of this process with the model in it.
        failure: why calls failed; "" if none did.
    """

    name: str
    fingerprint: str
    notes: tuple[str, ...]
    sight: Sight
    pace: Pace | None
    megabytes: int
    failure: str = ""

    @property
    def sentence(self) -> str:
        """What the probe found, for the user."""
        return {
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
            Sight.SILENT: f"It gave no answer: {self.failure or 'no reply came'}.",
        }[self.sight]


@dataclass(frozen=True, slots=True)
class CheckProgress:
    """How far a check is, in calls; `result` comes with the last."""

    n_done: int
    n_total: int
    result: ModelCheck | None = None


def check_model(
    model: VQAModel, stop: Callable[[], bool] = lambda: False
) -> Iterator[CheckProgress]:
    """Show it the pictures, then time it.

    Yields:
        A report after every thing shown, and a last one with the result; fewer after a stop.
    """
    n_total = len(PROBES) * 6 + len(_TIMED) + _FEW
    n_done, said, failures = 0, [], []
    for probe in PROBES:
        answers, failed = _shown(model, probe)
        said.append(answers)
        failures += failed
        n_done += 6
        yield CheckProgress(n_done, n_total)
        if stop():
            return
    pace = None
    sight = _sight(said)
    if sight is not Sight.SILENT:
        pace = _pace(model)
    yield CheckProgress(
        n_total,
        n_total,
        ModelCheck(
            model.name,
            model.fingerprint,
            tuple(model.notes),
            sight,
            pace,
            psutil.Process().memory_info().rss // 1_000_000,
            failures[-1] if failures else "",
        ),
    )


#: Answers by (picture, question): pictures are positive, negative, blank.
_Answers = dict[tuple[int, int], Answer]


def _shown(model: VQAModel, probe: Probe) -> tuple[_Answers, list[str]]:
    pictures = (*probe.pictures(), Image.new("RGB", (256, 256), (128, 128, 128)))
    answers: _Answers = {}
    failures = []
    try:
        for reply in model.answer(pictures, probe.questions):
            if isinstance(reply.outcome, Failure):
                failures.append(reply.outcome.reason)
            else:
                answers[reply.image, reply.question] = reply.outcome
    except ModelError as error:
        failures.append(str(error))
    return answers, failures


def _sight(said: Sequence[_Answers]) -> Sight:
    if not any(said):
        return Sight.SILENT
    if any(_differ(answers, 0, 1) for answers in said):
        return Sight.TELLS
    if any(_differ(answers, state, 2) for answers in said for state in (0, 1)):
        return Sight.SEES
    return Sight.BLIND


def _differ(answers: _Answers, first: int, second: int) -> bool:
    """Whether a question was answered differently about two pictures."""
    pairs = [(answers.get((first, q)), answers.get((second, q))) for q in (0, 1)]
    return any(one and other and _unlike(one, other) for one, other in pairs)


def _unlike(one: Answer, other: Answer) -> bool:
    if one.text.strip().lower() != other.text.strip().lower():
        return True
    return abs((one.p_yes or 0.0) - (other.p_yes or 0.0)) > _SAME


def _pace(model: VQAModel) -> Pace:
    """From two calls about one picture: a line through what few and what many questions took.

    The picture is drawn so that no server has it in its cache yet.
    """
    few, many = _timed(model, _TIMED[:_FEW], 1), _timed(model, _TIMED[_FEW:], 2)
    question = max(0.0, (many - few) / (_MANY - _FEW))
    return Pace(max(0.0, few - _FEW * question), question)


def _timed(model: VQAModel, questions: Sequence[str], seed: int) -> float:
    picture = Image.effect_noise((640, 480), 40 + seed).convert("RGB")
    began = time.perf_counter()
    for _ in model.answer([picture], questions):
        pass
    return time.perf_counter() - began
