"""A fitted vote: which questions, their weights and a threshold."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.votes.rules._base import MILLION, Ballots
from vqa_state.votes.rules._weighted import MAX_WEIGHT
from vqa_state.votes.rules.kinds import VoteKind

__all__ = ["FittedVote", "equal_vote"]


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
        if self.kind.by_p_yes:
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


def equal_vote(
    questions: Iterable[int], threshold: float = 0.5, kind: VoteKind = VoteKind.PAPER
) -> FittedVote:
    """The vote that gives each of these questions the weight 1, in ascending order."""
    chosen = tuple(sorted(questions))
    return FittedVote(kind, chosen, (1,) * len(chosen), (False,) * len(chosen), threshold)
