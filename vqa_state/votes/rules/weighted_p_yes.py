"""A weighted vote on the model's own probabilities of yes, where it gives them."""

import numpy as np
from numpy.typing import NDArray

from vqa_state.votes.rules._base import MILLION, Ballots
from vqa_state.votes.rules._weighted import WeightedVote

__all__ = ["RULE", "WeightedPYesVote"]


class WeightedPYesVote(WeightedVote):
    """A feature is twice the copies' mean share for the positive state, less one."""

    name = "weighted p_yes"
    by_p_yes = True

    def features(self, ballots: Ballots) -> NDArray[np.float64]:
        """Mean shares, from -1 to 1."""
        if ballots.p_positive is None:
            raise ValueError("a vote by p_yes needs the model's own share for every answer")
        return 2 * ballots.p_positive / (MILLION * ballots.n_copies) - 1


RULE = WeightedPYesVote()
