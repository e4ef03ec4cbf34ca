"""What a decision takes in milliseconds: measured once for a project's model on this machine.

    seconds a decision = copies * (image + questions * question)

Two parts, because a model that looks at an image once answers more questions about it for little.
Kept in pace.json beside the answers; nothing that is chosen depends on it.
"""

import json
import time
from collections.abc import Sequence

from PIL.Image import Image

from vqa_state.asking import AskPlan
from vqa_state.augment import copy_of
from vqa_state.checking import Pace
from vqa_state.errors import ImageError, ModelError
from vqa_state.files import write_atomically
from vqa_state.images import read_picture
from vqa_state.models.address import ModelAddress, Source
from vqa_state.models.base import Failure, VQAModel
from vqa_state.project import Project
from vqa_state.splits import Split

__all__ = ["keep_pace", "milliseconds", "read_pace"]

_TIMES = 2  # the quicker of two runs: the first may warm up


def keep_pace(project: Project, model: VQAModel) -> Pace | None:
    """Measure the model on one training image, unless that was done already.

    A model behind a server is not measured: its calls may cost money.

    Returns:
        None where it cannot be measured.

    Raises:
        ProjectError: if it cannot be written.
    """
    known = read_pace(project)
    if known is not None or _is_server(model.name):
        return known
    images, questions = project.labelled(Split.TRAIN), [q.text for q in project.questions()]
    try:
        pixels = read_picture(project.read(images[0])).pixels
        shown = [
            copy_of(pixels, images[0].pixel_hash, project.augmentation, project.seed, number)
            for number in range(_TIMES)
        ]
        one = min(_seconds(model, [copy], questions[:1]) for copy in shown)
        many = min(_seconds(model, [copy], questions) for copy in shown)
    except (ImageError, ModelError, IndexError):
        return None
    question = max(0.0, (many - one) / max(1, len(questions) - 1))
    pace = Pace(image=max(0.0, one - question), question=question)
    record = {"fingerprint": model.fingerprint, "image": pace.image, "question": pace.question}
    write_atomically(project.folder / "pace.json", json.dumps(record).encode())
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


def _seconds(model: VQAModel, images: Sequence[Image], questions: Sequence[str]) -> float:
    began = time.perf_counter()
    for reply in model.answer(images, questions):
        if isinstance(reply.outcome, Failure):
            raise ModelError(reply.outcome.reason)
    return time.perf_counter() - began


def _is_server(name: str) -> bool:
    try:
        return ModelAddress.parse(name).source is Source.SERVER
    except ModelError:
        return False  # a plain name of the registry
