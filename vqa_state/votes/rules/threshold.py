"""The paper's vote with a learned threshold, for models that lean to one state.

The threshold lies midway between the mean shares of the two states over the training images. Where
the means stand the wrong way round, it is one half. (The threshold of the best training accuracy
with the widest gap gained less on new images: docs/decisions/0009-kinds-of-vote.md.)
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import rate
from vqa_state.votes.rules._base import Ballots, Learned, VoteRule, rounded_threshold

__all__ = ["RULE", "ThresholdVote"]

_APART = 1e-9
"""Means closer than this are one: floats of equal fractions differ by their order of summing."""


class ThresholdVote(VoteRule):
    """Every valid answer counts one; how large a share wins is learned."""

    name = "threshold"

    def fit(
        self,
        ballots: Ballots,
        labels: NDArray[np.int8],
        subset: Sequence[int],
        groups: NDArray[np.int64],
    ) -> Learned:
        """The chosen questions, the weight 1 and the learned threshold."""
        chosen = list(subset)
        plus, minus = (kind[:, chosen].sum(axis=1) for kind in (ballots.positive, ballots.negative))
        shares = rate(plus, plus + minus, undefined=math.nan)
        positive, negative = (shares[(labels == s) & ~np.isnan(shares)] for s in (1, -1))
        threshold = 0.5
        if positive.size and negative.size and positive.mean() - negative.mean() > _APART:
            threshold = rounded_threshold(float(positive.mean() + negative.mean()) / 2)
        return Learned(tuple(subset), (1,) * len(subset), threshold)


RULE = ThresholdVote()
