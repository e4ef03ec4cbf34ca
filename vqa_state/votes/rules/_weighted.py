"""Votes with a weight for each question, learned by logistic regression on all questions.

An L2 penalty, one feature a question. Coefficients become whole weights first, the largest
`MAX_WEIGHT`; questions whose weight rounds to 0 are not asked. Then the intercept becomes the
threshold:

    sum(w v) + b > 0   is   share > (1 - b / sum|w|) / 2,   share as in `vqa_state.votes.rules`.
"""

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vqa_state.votes.logistic import fit_logistic
from vqa_state.votes.rules._base import Ballots, Learned, VoteRule, rounded_threshold

__all__ = ["MAX_WEIGHT", "WeightedVote"]

MAX_WEIGHT = 1000
"""Weights are whole numbers from 1 to this: three digits, those that a recognizer's file shows."""


class WeightedVote(VoteRule):
    """A linear model of the answers; it chooses its questions itself, from all."""

    weighted = True

    @abstractmethod
    def features(self, ballots: Ballots) -> NDArray[np.float64]:
        """What stands for each image and question, (n_images, n_questions) in [-1, 1].

        Raises:
            ValueError: if the ballots lack what is needed.
        """

    def fit(
        self,
        ballots: Ballots,
        labels: NDArray[np.int8],
        subset: Sequence[int],
        groups: NDArray[np.int64],
    ) -> Learned:
        """Weights of the questions that help, and the threshold."""
        fit = fit_logistic(self.features(ballots), labels, groups)
        largest = float(np.abs(fit.coefficients).max(initial=0))
        if largest == 0:  # no answer differs between images: nothing to learn from
            n_questions = ballots.n_questions
            return Learned(tuple(range(n_questions)), (1,) * n_questions, 0.5)
        whole = np.rint(fit.coefficients * (MAX_WEIGHT / largest)).astype(np.int64)
        used = np.flatnonzero(whole)
        intercept = fit.intercept * (MAX_WEIGHT / largest)
        threshold = (1 - intercept / int(np.abs(whole).sum())) / 2
        return Learned(
            tuple(used.tolist()), tuple(whole[used].tolist()), rounded_threshold(threshold)
        )
