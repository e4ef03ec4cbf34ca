"""From one picture to all answers that a recognizer needs."""

from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from vqa_state.answers.parse import Answer
from vqa_state.errors import ModelError
from vqa_state.images import pixel_hash, read_file, read_picture, rgb_pixels
from vqa_state.images.augmentation import Augmentation, late_copies
from vqa_state.models import Failure, VQAModel
from vqa_state.recognizer.schema import Copies

__all__ = ["ask_all", "picture_pixels", "shifted"]


def picture_pixels(image: str | Path | bytes | Image.Image) -> Image.Image:
    """A picture as the model is to see it.

    Raises:
        ImageError: if it cannot be read.
    """
    if isinstance(image, Image.Image):
        return rgb_pixels(image)
    return read_picture(image if isinstance(image, bytes) else read_file(Path(image))).pixels


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
