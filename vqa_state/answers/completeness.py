"""How far the labelled images are answered, in numbers and in sentences.

A missing answer (a call that failed) is not guessed and not counted as invalid. So a search on part
of the training images needs a yes, and the test stays closed until every answer on both sides is
there (docs/decisions/0019-dead-server.md).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from vqa_state.answers.table import MISSING, AnswerTable

__all__ = ["Completeness", "SideAnswers"]


@dataclass(frozen=True, slots=True)
class SideAnswers:
    """How far the images of one side are answered.

    Attributes:
        side: what its images are called.
        n_images: labelled images.
        n_complete: those of them that have all their answers, from 0 to `n_images`.
        n_missing: answers that the others lack, over all copies and questions.
        n_states: states that the complete images show, from 0 to 2.
    """

    side: Literal["training", "test"]
    n_images: int
    n_complete: int
    n_missing: int
    n_states: int

    @classmethod
    def of(cls, side: Literal["training", "test"], table: AnswerTable) -> "SideAnswers":
        """Counted in a table of all labelled images of the side, complete or not."""
        complete = table.complete
        return cls(
            side=side,
            n_images=table.n_images,
            n_complete=int(complete.sum()),
            n_missing=int((table.verdicts == MISSING).sum()),
            n_states=len(np.unique(table.labels[complete])),
        )

    @property
    def whole(self) -> bool:
        """Whether no answer is missing; so it is without images."""
        return self.n_complete == self.n_images

    @property
    def lacks(self) -> str:
        """What is missing: "2 of 6 training images lack 48 answers"; "" if nothing is."""
        if self.whole:
            return ""
        n = self.n_images - self.n_complete
        images = "image" if self.n_images == 1 else "images"
        answers = "1 answer" if self.n_missing == 1 else f"{self.n_missing:,} answers"
        verb = "lacks" if n == 1 else "lack"
        return f"{n} of {self.n_images} {self.side} {images} {verb} {answers}"


@dataclass(frozen=True, slots=True)
class Completeness:
    """How far both sides are answered."""

    train: SideAnswers
    test: SideAnswers

    @property
    def whole(self) -> bool:
        """Whether no answer is missing on either side."""
        return self.train.whole and self.test.whole

    @property
    def lacks(self) -> str:
        """What is missing on both sides; "" if nothing is."""
        return " and ".join(side.lacks for side in (self.train, self.test) if not side.whole)

    @property
    def part(self) -> str:
        """Training images that a search would see: "4 of 6"."""
        return f"{self.train.n_complete} of {self.train.n_images}"

    @property
    def part_is_searchable(self) -> bool:
        """Whether training images lack answers, and the others still show both states."""
        return not self.train.whole and self.train.n_states == 2

    @property
    def limits(self) -> tuple[str, ...]:
        """What a search on these answers did not see, and why the test is closed; mostly empty."""
        if not self.train.whole:
            saw = (
                f"The search saw {self.part} training images, because the others lack answers "
                f"({self.lacks})."
            )
            closed = "The test stays closed. " if self.test.n_images else ""
            return saw, f"{closed}Ask the model for the missing answers, then optimize again."
        if not self.test.whole:
            return (
                f"The test stays closed until all its answers are there: {self.lacks}. Ask the "
                "model for them; an image that it never answers can be put on the side unused.",
            )
        return ()
