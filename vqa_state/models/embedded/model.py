"""The model that ships with the package: small, offline, on the processor."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from PIL.Image import Image

from vqa_state.answers.answer import Answer
from vqa_state.models._base import Reply

__all__ = ["EmbeddedModel"]

#: Changes whenever code changes an answer that the weights' hash does not.
_VERSION = 1


class EmbeddedModel:
    """Answers yes/no questions about household things; see docs/embedded_model.md for how well.

    Instances may be shared by threads. An image is encoded once for all its questions.
    """

    name = "embedded"
    notes = ("It runs on the processor in float32.",)

    def __init__(self, weights: Path | None = None) -> None:
        """Load the shipped weights, or those at another path.

        Raises:
            ModuleNotFoundError: if torch or safetensors is not installed.
            ModelError: if the weights are missing or damaged.
        """
        # Torch is imported here, so that naming this class loads nothing heavy.
        from vqa_state.models.embedded.predictor import MAX_IMAGES, Predictor
        from vqa_state.models.embedded.trunk import INPUT_SIZE
        from vqa_state.models.embedded.weights import WEIGHTS, weights_digest

        path = WEIGHTS if weights is None else weights
        self._predictor = Predictor(path)
        self._max_images = MAX_IMAGES
        self._fingerprint = (
            f"embedded {_VERSION}; weights {weights_digest(path)}; float32; {INPUT_SIZE} px; argmax"
        )

    @property
    def fingerprint(self) -> str:
        """Version, hash of the weights, precision, input size and decoding."""
        return self._fingerprint

    def answer(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Reply]:
        """Ask every question about every image, some images at a time."""
        if not questions:
            return
        slots = self._predictor.read(questions)
        for start in range(0, len(images), self._max_images):
            answers = self._predictor.answer(images[start : start + self._max_images], slots)
            for image_number, row in enumerate(answers, start):
                for question_number, (text, p_yes) in enumerate(row):
                    yield Reply(image_number, question_number, Answer(text, p_yes))
