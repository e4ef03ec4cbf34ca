"""A model without a network, for tests: yours and ours. The app never offers it."""

from collections.abc import Callable, Iterator, Sequence

from PIL.Image import Image

from vqa_state.answers.answer import Answer
from vqa_state.models import Failure, Reply

__all__ = ["ScriptedModel"]

Script = Callable[[Image, str], Answer | Failure]


class ScriptedModel:
    """Answers as a function says, and remembers what it was asked.

    Attributes:
        name: under which a test may register it.
        fingerprint: give two scripts two fingerprints, or one's answers pass for the other's.
        notes: what a user should know of it; nothing.
        asked: every (image size, question) pair, in order.
    """

    def __init__(
        self, script: Script, *, name: str = "scripted", fingerprint: str = "scripted/1"
    ) -> None:
        self.name = name
        self.fingerprint = fingerprint
        self.notes: tuple[str, ...] = ()
        self.asked: list[tuple[tuple[int, int], str]] = []
        self._script = script

    def answer(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Reply]:
        """See `VQAModel.answer`."""
        for i, image in enumerate(images):
            for q, question in enumerate(questions):
                self.asked.append((image.size, question))
                yield Reply(i, q, self._script(image, question))
