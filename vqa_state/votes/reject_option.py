"""When a vote is sure enough for a verdict, and when the verdict had better be `unknown`.

    sureness = lead * agreement,   a verdict if sureness >= min_sureness, else unknown

*Lead.* How far the vote is from its threshold: 1 where all answers agree, 0 at the threshold. In
the paper's vote an answer for the winner adds 1, an answer against it takes 1, an invalid one adds
nothing, and the sum is divided by all answers: 24 for, 6 against, 6 invalid give 18 / 36 = 0.5.
With another threshold t, an answer against the positive state takes t / (1 - t), one against the
negative state (1 - t) / t, so that the lead is 0 exactly at the threshold. For every kind of vote,
with the share that is positive, and the weight T that counts of the whole weight W:

    lead = (share - t) / (1 - t) * T / W  or  (t - share) / t * T / W

but never more than the share of the weight that really speaks for the winner: where invalid answers
count half and the threshold is not 0.5, they would be sure of something otherwise.
*Agreement.* The share of the shifted copies whose own vote says the same as the whole vote.

So margin, invalid share and disagreement among the copies are all in it, and an answer turned
towards the winner never makes the vote less sure; vqa_state/votes/early_stop.py rests on that. How
the smallest sureness is learned: vqa_state/evaluation/coverage.py.

Source: paper II-A for the vote; the measure of sureness is this project's own.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.table import MISSING
from vqa_state.votes.judgement import Judgement
from vqa_state.votes.rules import MILLION, FittedVote
from vqa_state.votes.state import State

__all__ = ["AbstainRule"]


@dataclass(frozen=True, slots=True)
class AbstainRule:
    """A vote that says `unknown` where it is not sure enough.

    Everything up to the lead is counted in whole numbers, so the order of the answers never
    matters, and with `min_sureness` 0 the states are those of `vote.decide`.

    Methods take `verdicts`, what the answers to all questions of the table speak for: +1, -1 or 0,
    int8 (n_images, n_copies, n_questions); and for a vote by p_yes also `p_positive`, the model's
    own shares, same shape. They raise ValueError if a shape does not fit, an answer is missing
    (which is not invalid), or shares are needed and unknown.

    Attributes:
        vote: which questions, their weights and the threshold.
        min_sureness: sureness below which the verdict is unknown, in [0, 1]; 0 never abstains but
            for a tie or where nothing counts.

    Raises:
        ValueError: if `min_sureness` is out of range.
    """

    vote: FittedVote
    min_sureness: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.min_sureness <= 1:
            raise ValueError(f"min_sureness must be in [0, 1], got {self.min_sureness}")

    def states(
        self, verdicts: NDArray[np.int8], p_positive: NDArray[np.float32] | None = None
    ) -> NDArray[np.int8]:
        """The verdict on each image, (n_images,): +1 positive, -1 negative, 0 unknown."""
        tally = _Tally(self.vote, verdicts, p_positive)
        return np.where(tally.sureness >= self.min_sureness, tally.leaning, 0).astype(np.int8)

    def sureness(
        self, verdicts: NDArray[np.int8], p_positive: NDArray[np.float32] | None = None
    ) -> NDArray[np.float64]:
        """How sure the vote on each image is, (n_images,) in [0, 1].

        It is 0 for a tie or where nothing counts, 1 if every answer says the same.
        """
        sureness: NDArray[np.float64] = _Tally(self.vote, verdicts, p_positive).sureness
        return sureness

    def margins(
        self, verdicts: NDArray[np.int8], p_positive: NDArray[np.float32] | None = None
    ) -> NDArray[np.float64]:
        """The sureness with the sign of the state that the vote leans to, in [-1, 1]."""
        tally = _Tally(self.vote, verdicts, p_positive)
        margins: NDArray[np.float64] = tally.leaning * tally.sureness
        return margins

    def judge(
        self, verdicts: NDArray[np.int8], p_positive: NDArray[np.float32] | None = None
    ) -> Judgement:
        """The verdict on one image with its reasons; arrays are (n_copies, n_questions)."""
        shares = None if p_positive is None else p_positive[np.newaxis]
        tally = _Tally(self.vote, verdicts[np.newaxis], shares)
        leaning, sureness = int(tally.leaning[0]), float(tally.sureness[0])
        counted = int(tally.counted.sum())
        return Judgement(
            state=_STATES[leaning if sureness >= self.min_sureness else 0],
            leaning=_STATES[leaning],
            share=int(tally.support.sum()) / (MILLION * counted) if counted else math.nan,
            invalid=1 - int(tally.valid.sum()) / tally.whole,
            n_copies=len(verdicts),
            n_agreeing=int(tally.n_agreeing[0]),
            sureness=sureness,
            min_sureness=self.min_sureness,
            threshold=self.vote.threshold,
            by_majority=self._by_majority,
        )

    @property
    def _by_majority(self) -> bool:
        equal = not self.vote.kind.weighted and set(self.vote.weights) == {1}
        return equal and self.vote.threshold == 0.5  # written with six digits, so it is exact


_STATES = {1: State.POSITIVE, -1: State.NEGATIVE, 0: State.UNKNOWN}


class _Tally:
    """A vote on some images, counted by copy in whole numbers.

    Attributes:
        whole: weight of all answers about an image.
        support: weight for the positive state in millionths, (n_images, n_copies).
        counted: weight that counts, (n_images, n_copies).
        valid: weight of the valid answers, (n_images, n_copies).
        leaning: +1, -1 or 0, (n_images,).
        n_agreeing: copies whose own vote says the same, (n_images,).
        sureness: lead times agreement, (n_images,).
    """

    def __init__(
        self,
        vote: FittedVote,
        verdicts: NDArray[np.int8],
        p_positive: NDArray[np.float32] | None,
    ) -> None:
        _require_answers(vote, verdicts, p_positive)
        weights = np.array(vote.weights, dtype=np.int64)
        turn = np.where(vote.flipped, -1, 1)
        said = verdicts[:, :, vote.questions].astype(np.int64) * turn  # (images, copies, n_used)
        # How far each answer is from neither, in millionths, from -MILLION to MILLION.
        pull = MILLION * said
        if vote.kind.by_p_yes and p_positive is not None:
            p = np.rint(p_positive[:, :, vote.questions].astype(np.float64) * MILLION)
            pull = (2 * p.astype(np.int64) - MILLION) * turn
        n_copies, per_copy = verdicts.shape[1], int(weights.sum())
        self.whole = n_copies * per_copy
        self.valid = (said != 0) @ weights
        all_count = vote.kind.weighted
        self.counted = np.full_like(self.valid, per_copy) if all_count else self.valid
        if vote.kind.weighted and not vote.kind.by_p_yes:  # but if all are invalid, none counts
            self.counted = self.counted * (self.valid.sum(axis=1, keepdims=True) > 0)
        self.support = (pull @ weights + MILLION * self.counted) // 2
        self._for = np.maximum(pull, 0).sum(axis=1) @ weights
        self._against = np.maximum(-pull, 0).sum(axis=1) @ weights
        self._at = round(vote.threshold * MILLION)
        excess = self.support - self._at * self.counted  # (n_images, n_copies), exact
        self.leaning = np.sign(excess.sum(axis=1)).astype(np.int8)
        agrees = np.sign(excess) == self.leaning[:, np.newaxis]
        self.n_agreeing = agrees.sum(axis=1, dtype=np.int64)
        self.sureness = self._lead(excess.sum(axis=1)) * (self.n_agreeing / n_copies)

    def _lead(self, excess: NDArray[np.int64]) -> NDArray[np.float64]:
        whole = MILLION * self.whole
        for_positive = excess / ((MILLION - self._at) * self.whole)
        for_negative = -excess / (self._at * self.whole)
        leads = (
            np.minimum(for_positive, self._for / whole),
            np.minimum(for_negative, self._against / whole),
        )
        return np.select([excess > 0, excess < 0], leads, 0.0)


def _require_answers(
    vote: FittedVote, verdicts: NDArray[np.int8], p_positive: NDArray[np.float32] | None
) -> None:
    if verdicts.ndim != 3 or verdicts.shape[2] <= max(vote.questions) or verdicts.shape[1] == 0:
        raise ValueError(
            f"verdicts must be (n_images, n_copies, n_questions) with a column for question "
            f"{max(vote.questions)} and at least one copy; got {verdicts.shape}"
        )
    if (verdicts[:, :, vote.questions] == MISSING).any():
        raise ValueError("an answer is missing, which is not invalid; ask it again first")
    if not vote.kind.by_p_yes:
        return
    if p_positive is None or p_positive.shape != verdicts.shape:
        raise ValueError("a vote by p_yes needs the model's own share for every answer")
    if np.isnan(p_positive[:, :, vote.questions]).any():
        raise ValueError("a vote by p_yes needs the model's own share for every answer")
