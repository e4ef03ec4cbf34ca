"""A weighted vote on the answers; an Invalid one counts as half an answer for each state."""

import numpy as np
from numpy.typing import NDArray

from vqa_state.votes.rules._base import Ballots
from vqa_state.votes.rules._weighted import WeightedVote

__all__ = ["RULE", "WeightedAnswersVote"]


class WeightedAnswersVote(WeightedVote):
    """A feature is the mean verdict of the copies, where an Invalid answer is 0."""

    name = "weighted answers"

    def features(self, ballots: Ballots) -> NDArray[np.float64]:
        """Mean verdicts."""
        return (ballots.positive - ballots.negative) / ballots.n_copies


RULE = WeightedAnswersVote()
