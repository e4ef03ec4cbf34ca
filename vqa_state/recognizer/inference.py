"""From one picture to all answers that a recognizer needs."""

from collections.abc import Sequence

from PIL import Image

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.images import pixel_hash
from vqa_state.images.augmentation import Augmentation, late_copies
from vqa_state.models import Failure, VQAModel
from vqa_state.recognizer.schema import Copies

__all__ = ["ask_all", "shifted"]


def shifted(pixels: Image.Image, shifts: Copies) -> Sequence[Image.Image]:
    """The copies that the questions are asked about."""
    kind = Augmentation(shifts.kind, shifts.amount, shifts.n_copies)
    return late_copies(pixels, pixel_hash(pixels), kind, shifts.seed)


def ask_all(
    model: VQAModel, pictures: Sequence[Image.Image], texts: Sequence[str]
) -> dict[tuple[int, str], Answer]:
    """Every answer, by (copy, question text); a failed call is an error, never a verdict.

    Raises:
        ModelError: if a call failed.
    """
    answers: dict[tuple[int, str], Answer] = {}
    failure = "it gave no reply to a question"
    for reply in model.answer(pictures, texts):
        if isinstance(reply.outcome, Failure):
            failure = reply.outcome.reason
        else:
            answers[reply.image, texts[reply.question]] = reply.outcome
    n_calls = len(pictures) * len(texts)
    if len(answers) < n_calls:
        raise ModelError(
            f"{n_calls - len(answers)} of {n_calls} calls to {model.name} failed ({failure}); "
            "there is no verdict: try again"
        )
    return answers
