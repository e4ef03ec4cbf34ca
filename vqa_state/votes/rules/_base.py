"""What a kind of vote has to define, and the counted answers that it learns from."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.answers.table import MISSING, AnswerTable

__all__ = ["MILLION", "Ballots", "Learned", "VoteRule", "rounded_threshold"]

MILLION = 1_000_000
"""Support of one answer that speaks fully for the positive state; thresholds have six digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Ballots:
    """The answers about some images, labelled or not, added up over their copies.

    Attributes:
        positive: answers for the positive state; int64, (n_images, n_questions).
        negative: answers for the negative state; same shape.
        n_copies: copies of each image; what is neither of both is invalid.
        p_positive: the model's own shares for the positive state in whole millionths, summed over
            the copies; int64, same shape. None if any is unknown.

    Raises:
        ValueError: if shapes differ or a number is out of range.
    """

    positive: NDArray[np.int64]
    negative: NDArray[np.int64]
    n_copies: int
    p_positive: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        arrays = [self.positive, self.negative]
        arrays += [] if self.p_positive is None else [self.p_positive]
        if self.positive.ndim != 2 or len({array.shape for array in arrays}) > 1:
            raise ValueError(
                f"ballots need one shape (n_images, n_questions), got {[a.shape for a in arrays]}"
            )
        if any((array < 0).any() for array in arrays):
            raise ValueError("ballots must not be negative")
        if self.n_copies < 1 or (self.positive + self.negative > self.n_copies).any():
            raise ValueError(f"more answers than the {self.n_copies} copies, or no copies")
        if self.p_positive is not None and (self.p_positive > MILLION * self.n_copies).any():
            raise ValueError("a share for the positive state is above 1")

    @classmethod
    def of_table(cls, table: AnswerTable) -> "Ballots":
        """The ballots of a table.

        Raises:
            ValueError: if an answer is missing, which is not invalid.
        """
        if (table.verdicts == MISSING).any():
            raise ValueError("an answer is missing; take(complete) first, or ask it again")
        millionths = np.rint(table.p_positive.astype(np.float64) * MILLION)
        known = table.p_positive.size > 0 and not np.isnan(millionths).any()
        return cls(
            positive=(table.verdicts > 0).sum(axis=1, dtype=np.int64),
            negative=(table.verdicts < 0).sum(axis=1, dtype=np.int64),
            n_copies=table.n_copies,
            p_positive=millionths.astype(np.int64).sum(axis=1) if known else None,
        )

    @classmethod
    def of_counts(cls, counts: Counts) -> "Ballots":
        """The ballots behind counts, without the model's own shares."""
        is_positive = counts.labels[:, np.newaxis] > 0
        return cls(
            positive=np.where(is_positive, counts.correct, counts.wrong),
            negative=np.where(is_positive, counts.wrong, counts.correct),
            n_copies=int((counts.correct + counts.wrong + counts.invalid).max(initial=1)),
        )

    def counts(self, labels: NDArray[np.int8]) -> Counts:
        """Correct, Wrong and Invalid by the labels, (n_images,), for a search."""
        is_positive = labels[:, np.newaxis] > 0
        return Counts(
            correct=np.where(is_positive, self.positive, self.negative),
            wrong=np.where(is_positive, self.negative, self.positive),
            invalid=self.n_copies - self.positive - self.negative,
            labels=labels,
        )

    def take(self, images: NDArray[np.intp]) -> "Ballots":
        """The ballots of some images, in that order; one may stand there several times."""
        return Ballots(
            self.positive[images],
            self.negative[images],
            self.n_copies,
            None if self.p_positive is None else self.p_positive[images],
        )

    @property
    def n_images(self) -> int:
        """Number of rows."""
        return int(self.positive.shape[0])

    @property
    def n_questions(self) -> int:
        """Number of columns."""
        return int(self.positive.shape[1])


class Learned(NamedTuple):
    """What a kind of vote learns from training images.

    Attributes:
        questions: positions of its questions, ascending.
        weights: of each, a whole number from 1 to `MAX_WEIGHT`, negative if it is flipped.
        threshold: share above which the positive state wins, in (0, 1), at most six digits.
    """

    questions: tuple[int, ...]
    weights: tuple[int, ...]
    threshold: float


class VoteRule(ABC):
    """One kind of vote. The attributes say how it counts; the package's docstring has the formulas.

    Attributes:
        name: in files and options.
        weighted: whether Invalid answers count as half an answer for each state; only then may
            questions have weights other than 1.
        by_p_yes: whether it counts the model's own probabilities instead of its answers; only with
            `weighted`.
    """

    name: ClassVar[str]
    weighted: ClassVar[bool] = False
    by_p_yes: ClassVar[bool] = False

    @abstractmethod
    def fit(
        self,
        ballots: Ballots,
        labels: NDArray[np.int8],
        subset: Sequence[int],
        groups: NDArray[np.int64],
    ) -> Learned:
        """Learn a vote. The same arguments give the same vote.

        Args:
            ballots: the training images' answers to all questions.
            labels: their states, +1 or -1, (n_images,), both present.
            subset: positions of the questions that the search chose, ascending.
            groups: number of each image's group of near-duplicates, (n_images,); they stay together
                in cross-validation.
        """


def rounded_threshold(threshold: float) -> float:
    """The nearest threshold of six digits inside (0, 1)."""
    return round(min(max(threshold, 1 / MILLION), 1 - 1 / MILLION), 6)
