"""Kinds of vote, and a vote that was fitted: which questions, their weights and a threshold.

For an image, let question q of weight w_q have P_q answers for the positive state, N_q for the
negative and I_q for neither, over all copies. The positive state wins if its *share* is above the
threshold t, the negative one if it is below; exactly at t the vote is unknown, and so it is without
a valid answer.

    paper, threshold    share = sum(w P) / sum(w (P + N))
    weighted answers    share = sum(w (P + I / 2)) / sum(w (P + N + I))
    weighted p_yes      share = sum(w p) / sum(w (P + N + I))

where p_q is the sum over the copies of the model's own share for the positive state. A question
that is *flipped* counts for the other state: P and N change places, and p becomes 1 - p a copy. The
second share is (1 + sum(w v) / sum(w)) / 2 with v = +1, -1 or 0 for an invalid answer, so a linear
model of the answers is such a vote: negative weights are flips, and its intercept is the threshold.

Everything is counted in whole millionths of whole weights, so every verdict is exact: a tie is a
tie, and the order of the answers never matters.

Source: paper II-A for the paper's vote (weight 1, threshold 0.5); the others are this project's.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.answers.table import MISSING, AnswerTable

__all__ = ["MAX_WEIGHT", "MILLION", "Ballots", "FittedVote", "VoteKind", "support"]

MAX_WEIGHT = 1000
"""Weights are whole numbers from 1 to this: three digits, those that a recognizer's file shows."""

MILLION = 1_000_000
"""Support of one answer that speaks fully for the positive state; thresholds have six digits."""


class VoteKind(StrEnum):
    """How a vote counts, the simplest first; the module's first lines give the formulas."""

    PAPER = "paper"
    THRESHOLD = "threshold"
    WEIGHTED_ANSWERS = "weighted answers"
    WEIGHTED_P_YES = "weighted p_yes"

    @property
    def weighted(self) -> bool:
        """Whether every question has a weight of its own, and invalid answers count half."""
        return self in (VoteKind.WEIGHTED_ANSWERS, VoteKind.WEIGHTED_P_YES)


def support(kind: VoteKind, speaks_for: int, p_positive: float | None = None) -> int | None:
    """What one answer gives to the positive state, in millionths; None if it does not count.

    A recognizer adds `weight * support` and `weight * MILLION` over the answers that count; the
    positive state wins if the first sum is above `round(threshold * second sum)`. Without a valid
    answer the vote is unknown, but for the one by p_yes. `FittedVote.decide` does the same with
    whole tables, verdict for verdict.

    Args:
        kind: how the vote counts.
        speaks_for: +1, -1 or 0, turned already if the question is flipped.
        p_positive: the model's own share for the positive state in [0, 1], turned likewise.

    Raises:
        ValueError: if the kind needs `p_positive` and there is none.
    """
    if kind is VoteKind.WEIGHTED_P_YES:
        if p_positive is None or not 0 <= p_positive <= 1:
            raise ValueError(f"a vote by p_yes needs one in [0, 1] an answer, got {p_positive}")
        return int(np.rint(MILLION * float(p_positive)))
    if speaks_for == 0 and not kind.weighted:
        return None
    return MILLION * (1 + speaks_for) // 2


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


@dataclass(frozen=True, slots=True)
class FittedVote:
    """A vote that can decide about images, and that a recognizer's file can carry as it is.

    Attributes:
        kind: how it counts.
        questions: positions of its questions, ascending.
        weights: of each, a whole number from 1 to `MAX_WEIGHT`.
        flipped: whether the answers of each count for the other state (its "yes" then means the
            opposite of what the question grid says).
        threshold: share above which the positive state wins, in (0, 1), at most six digits.

    Raises:
        ValueError: if lengths differ, or a value is out of its range.
    """

    kind: VoteKind
    questions: tuple[int, ...]
    weights: tuple[int, ...]
    flipped: tuple[bool, ...]
    threshold: float

    def __post_init__(self) -> None:
        if not len(self.questions) == len(self.weights) == len(self.flipped) > 0:
            raise ValueError("need at least one question, and a weight and a flip for each")
        if list(self.questions) != sorted(set(self.questions)) or self.questions[0] < 0:
            raise ValueError(f"questions must be ascending positions, got {self.questions}")
        if not all(isinstance(w, int) and 1 <= w <= MAX_WEIGHT for w in self.weights):
            raise ValueError(f"weights must be whole, 1 to {MAX_WEIGHT}, got {self.weights}")
        if not 0 < self.threshold < 1 or self.threshold != round(self.threshold, 6):
            raise ValueError(
                f"threshold must be in (0, 1) with at most six digits, got {self.threshold}"
            )

    @property
    def n_used(self) -> int:
        """Number of questions: what a decision costs, times the copies."""
        return len(self.questions)

    def shares(self, ballots: Ballots) -> NDArray[np.float64]:
        """Share of the positive state for each image, (n_images,); NaN where nothing counts."""
        positive, total = self._tally(ballots)
        shares = np.full(total.shape, np.nan)
        np.divide(positive, total, out=shares, where=total > 0)
        return shares

    def decide(self, ballots: Ballots) -> NDArray[np.int8]:
        """+1 positive, -1 negative, 0 unknown, (n_images,).

        Raises:
            ValueError: if the kind needs the model's own shares and they are unknown.
        """
        positive, total = self._tally(ballots)
        sides: NDArray[np.int8] = np.sign(positive - self._at_threshold(total)).astype(np.int8)
        return sides

    def margins(self, ballots: Ballots) -> NDArray[np.float64]:
        """How clearly each image's vote speaks for the positive state, (n_images,) in [-1, 1].

        Its sign is the verdict; it is 1 where the share is 1, -1 where it is 0, and straight in
        between on each side of the threshold, so votes of different thresholds can be averaged.
        """
        positive, total = self._tally(ballots)
        at = self._at_threshold(total)
        excess = (positive - at).astype(np.float64)
        room = np.where(excess > 0, total - at, at)
        margins = np.zeros(excess.shape)
        np.divide(excess, room, out=margins, where=excess != 0)
        return margins

    def _at_threshold(self, total: NDArray[np.int64]) -> NDArray[np.int64]:
        # Millionths of whole millions are whole; rounding only removes what floats add.
        at: NDArray[np.int64] = np.rint(self.threshold * total).astype(np.int64)
        return at

    def _tally(self, ballots: Ballots) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Millionths for the positive state and in all, (n_images,); 0 of 0 if unknown."""
        chosen = list(self.questions)
        weights = np.array(self.weights, dtype=np.int64)
        flipped = np.array(self.flipped)
        whole = MILLION * ballots.n_copies
        if self.kind is VoteKind.WEIGHTED_P_YES:
            if ballots.p_positive is None:
                raise ValueError("a vote by p_yes needs the model's own share for every answer")
            p = ballots.p_positive[:, chosen]
            positive = np.where(flipped, whole - p, p) @ weights
            return positive, np.full(positive.shape, whole * weights.sum())
        plus, minus = ballots.positive[:, chosen], ballots.negative[:, chosen]
        plus, minus = np.where(flipped, minus, plus), np.where(flipped, plus, minus)
        valid = MILLION * ((plus + minus) @ weights)
        if not self.kind.weighted:
            return MILLION * (plus @ weights), valid
        total = np.where(valid > 0, whole * weights.sum(), 0)
        return (total + MILLION * ((plus - minus) @ weights)) // 2, total
