"""What asking and a decision take: measured once for a project's model on this machine.

    seconds a decision = copies * (image + questions * question)

Two parts, because a model that looks at an image once answers more questions about it for little.
Kept in pace.json beside the answers, and for this machine (`models.known`), so that the cost of
asking is known before; nothing that is chosen depends on it.
"""

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PIL.Image import Image

from vqa_state.errors import ImageError, ModelError
from vqa_state.images import read_picture
from vqa_state.images.augmentation import copy_of
from vqa_state.models import Failure, VQAModel
from vqa_state.models.address import ModelAddress, Source
from vqa_state.models.capability_cache import KnownModel, known_model, remember
from vqa_state.models.memory import Memory
from vqa_state.models.vision_check import N_CALLS, replies_until
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.storage.atomic_write import write_atomically
from vqa_state.study.collect import AskPlan, plan
from vqa_state.study.vision_check import Pace

__all__ = ["Estimate", "estimate", "is_server", "keep_pace", "milliseconds", "read_pace"]

_TIMES = 2  # the quicker of two runs: the first may warm up


@dataclass(frozen=True, slots=True)
class Estimate:
    """What asking will cost, as far as this machine knows.

    Attributes:
        plan: calls.
        seconds: what they take; None while the model's pace is not known here.
        memory: of a process with the model in it; None while it is not known here.
        n_look: calls, at most, of the look at a new model that comes before; 0 if it was done.
    """

    plan: AskPlan
    seconds: float | None
    memory: Memory | None
    n_look: int


def estimate(project: Project, fingerprint: str) -> Estimate:
    """What asking about a project costs with the model of this fingerprint; "" for one not known.

    Raises:
        NothingToSearchError: if no image is labelled.
        ProjectError: if there is no question.
        StoreError: if the store cannot be read.
    """
    what, known = plan(project, fingerprint), known_model(fingerprint)
    seconds = memory = None
    if known is not None and known.image is not None and known.question is not None:
        seconds = Pace(known.image, known.question).seconds(what)
    if known is not None and known.megabytes:
        memory = Memory(known.megabytes, known.gpu_megabytes)
    is_seen = known is not None and known.sight is not None
    return Estimate(what, seconds, memory, 0 if is_seen or not what.n_to_ask else N_CALLS)


def keep_pace(
    project: Project, model: VQAModel, stop: Callable[[], bool] = lambda: False
) -> Pace | None:
    """Measure the model on one training image, unless that was done already.

    A model behind a server is not measured: its calls may cost money.

    Args:
        project: whose questions are timed.
        model: that of its fingerprint.
        stop: ends it within a call where the model can, else after the reply at hand.

    Returns:
        None where it cannot be measured, and after a stop.

    Raises:
        ProjectError: if it cannot be written.
    """
    pace, known = read_pace(project), known_model(model.fingerprint)
    if is_server(model.name) or (pace and known and known.image is not None):
        return pace  # a project may come from another machine, so this one must know it, too
    pace = _measured(project, model, stop)
    if pace is None:
        return None
    record = {"fingerprint": model.fingerprint, "image": pace.image, "question": pace.question}
    write_atomically(project.folder / "pace.json", json.dumps(record).encode())
    took = Memory.now()
    times = (pace.image, pace.question)
    remember(KnownModel(model.name, model.fingerprint, None, *times, took.process, took.gpu))
    return pace


def read_pace(project: Project) -> Pace | None:
    """What was measured for the project's model; None if nothing, or it cannot be read."""
    try:
        record = json.loads((project.folder / "pace.json").read_bytes())
        if record["fingerprint"] != project.fingerprint:
            return None
        return Pace(image=float(record["image"]), question=float(record["question"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def milliseconds(pace: Pace | None, n_questions: int, n_copies: int) -> float | None:
    """About how long a decision takes; None if the pace is unknown."""
    if pace is None:
        return None
    return 1000 * pace.seconds(AskPlan(1, n_copies, n_questions, 0))


def is_server(name: str) -> bool:
    """Whether a model of this name is behind a server."""
    try:
        return ModelAddress.parse(name).source is Source.SERVER
    except ModelError:
        return False  # a plain name of the registry


def _measured(project: Project, model: VQAModel, stop: Callable[[], bool]) -> Pace | None:
    images, questions = project.labelled(Split.TRAIN), [q.text for q in project.questions()]
    try:
        pixels = read_picture(project.read(images[0])).pixels
        shown = [
            copy_of(pixels, images[0].pixel_hash, project.augmentation, project.seed, number)
            for number in range(_TIMES)
        ]
        one = min(_seconds(model, [copy], questions[:1], stop) for copy in shown)
        many = min(_seconds(model, [copy], questions, stop) for copy in shown)
    except (ImageError, ModelError, IndexError):
        return None
    question = max(0.0, (many - one) / max(1, len(questions) - 1))
    return Pace(image=max(0.0, one - question), question=question)


def _seconds(
    model: VQAModel, images: Sequence[Image], questions: Sequence[str], stop: Callable[[], bool]
) -> float:
    began = time.perf_counter()
    n_left = len(questions)
    for reply in replies_until(model, images, questions, stop):
        n_left -= 1
        if isinstance(reply.outcome, Failure):
            raise ModelError(reply.outcome.reason)
    if n_left or stop():
        raise ModelError("not all was answered")  # a stop, or a model that leaves some out
    return time.perf_counter() - began
