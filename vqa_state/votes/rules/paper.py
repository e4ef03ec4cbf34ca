"""The paper's vote: every valid answer of the chosen questions counts one, the majority wins."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vqa_state.votes.rules._base import Ballots, Learned, VoteRule

__all__ = ["RULE", "PaperVote"]


class PaperVote(VoteRule):
    """Nothing is learned. Source: paper II-A."""

    name = "paper"

    def fit(
        self,
        ballots: Ballots,
        labels: NDArray[np.int8],
        subset: Sequence[int],
        groups: NDArray[np.int64],
    ) -> Learned:
        """The chosen questions, the weight 1 and the threshold 0.5."""
        return Learned(tuple(subset), (1,) * len(subset), 0.5)


RULE = PaperVote()
