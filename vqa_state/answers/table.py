"""Arrays of answers: images × copies × questions, all that search and evaluation see."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vqa_state.questions.grid import Question

__all__ = ["MISSING", "AnswerTable"]


MISSING = -128
"""Mark of an answer that a failed call never gave. It is not Invalid and never counted."""


@dataclass(frozen=True, eq=False)
class AnswerTable:
    """What a model's answers say about each image: all that search and evaluation know.

    Attributes:
        image_ids: n_images ids.
        questions: n_questions questions.
        verdicts: int8 (n_images, n_copies, n_questions): +1 speaks for the positive state, -1 for
            the negative, 0 is invalid, `MISSING` was never given.
        p_positive: float32, same shape: the model's own share for the positive state in [0, 1],
            NaN where unknown.
        labels: int8 (n_images,), +1 or -1.
    """

    image_ids: tuple[str, ...]
    questions: tuple[Question, ...]
    verdicts: npt.NDArray[np.int8]
    p_positive: npt.NDArray[np.float32]
    labels: npt.NDArray[np.int8]

    def __post_init__(self) -> None:
        n_copies = self.verdicts.shape[1] if self.verdicts.ndim == 3 else -1
        shape = (len(self.image_ids), n_copies, len(self.questions))
        if self.verdicts.shape != shape or self.p_positive.shape != shape:
            raise ValueError(
                f"verdicts and p_positive must have shape (n_images, n_copies, n_questions) = "
                f"{shape}, got {self.verdicts.shape} and {self.p_positive.shape}"
            )
        if self.labels.shape != shape[:1] or not np.isin(self.labels, (-1, 1)).all():
            raise ValueError(f"labels must be {shape[0]} values of +1 or -1, got {self.labels}")
        if not np.isin(self.verdicts, (-1, 0, 1, MISSING)).all():
            raise ValueError(f"verdicts must be -1, 0, +1 or MISSING ({MISSING})")

    @property
    def n_images(self) -> int:
        """Number of images, with complete answers or not."""
        return len(self.image_ids)

    @property
    def n_copies(self) -> int:
        """Number of shifted copies of each image."""
        return int(self.verdicts.shape[1])

    @property
    def n_questions(self) -> int:
        """Number of questions."""
        return len(self.questions)

    @property
    def complete(self) -> npt.NDArray[np.bool_]:
        """(n_images,): True where no answer of the image is missing."""
        return np.asarray((self.verdicts != MISSING).all(axis=(1, 2)))

    def take(self, mask: npt.NDArray[np.bool_]) -> "AnswerTable":
        """The same table with only the images where `mask`, bool (n_images,), is True."""
        chosen = np.flatnonzero(mask)
        return AnswerTable(
            tuple(self.image_ids[i] for i in chosen),
            self.questions,
            self.verdicts[chosen],
            self.p_positive[chosen],
            self.labels[chosen],
        )
