"""What a VQA model must be able to do."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from PIL.Image import Image

from vqa_state.answers.answer import Answer

__all__ = ["Failure", "Interruptible", "Reply", "VQAModel"]


@dataclass(frozen=True, slots=True)
class Failure:
    """One call that gave no answer. It is *missing*, never Invalid, and is asked again.

    Attributes:
        reason: why, for the user.
        for_all: no other call about this image will do better now, and likely none at all.
    """

    reason: str
    for_all: bool = False


@dataclass(frozen=True, slots=True)
class Reply:
    """The outcome of one (image, question) pair; both are positions in the call's arguments."""

    image: int
    question: int
    outcome: Answer | Failure


class VQAModel(Protocol):
    """Answers questions about images in free text.

    A model only answers: parsing, storing, retrying and progress exist once, in `answers`,
    `store` and `asking`.
    """

    @property
    def name(self) -> str:
        """The name under which the registry makes this model again."""
        ...

    @property
    def fingerprint(self) -> str:
        """All that can change an answer: name, revision, weights, precision, prompt, decoding.

        It is part of every answer's key, so a new fingerprint never meets an old answer.
        """
        ...

    @property
    def notes(self) -> Sequence[str]:
        """What a user should know of it here, in sentences: device, precision, a slower way."""
        ...

    def answer(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Reply]:
        """Ask every question about every image.

        Args:
            images: RGB, any size; the model resizes them as it needs.
            questions: texts, any number; an empty sequence yields nothing.

        Yields:
            Each (image, question) pair exactly once, in any order.

        Raises:
            ModelError: if the model cannot answer anything more.
        """
        ...


@runtime_checkable
class Interruptible(Protocol):
    """A model whose calls can be given up while they hang or wait."""

    def answer_until(
        self, images: Sequence[Image], questions: Sequence[str], stop: Callable[[], bool]
    ) -> Iterator[Reply]:
        """As `VQAModel.answer`; once `stop` says so it ends within a second.

        A model on this machine ends after the forward pass in flight, whatever that takes.
        """
        ...
