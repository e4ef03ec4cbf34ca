"""What an objective has to say, and the weights that all objectives share."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts

__all__ = ["PAPER_WEIGHTS", "ObjectiveKind", "ObjectiveWeights"]

_MOST_ALPHA = 1_000_000


@dataclass(frozen=True, slots=True)
class ObjectiveWeights:
    """Weights of the recognized images (alpha) and of the number of questions (beta).

    Raises:
        ValueError: if alpha lies outside [0, 1,000,000], or beta outside [0, 1). With a larger
            alpha the other terms would drown in rounding; from beta 1 on, a subset could score
            worse than the empty one, which is not a solution.
    """

    alpha: float = 100.0
    beta: float = 0.1

    def __post_init__(self) -> None:
        if not 0 <= self.alpha <= _MOST_ALPHA:
            raise ValueError(f"alpha must be a number from 0 to {_MOST_ALPHA:,}, got {self.alpha}")
        if not 0 <= self.beta < 1:
            raise ValueError(f"beta must be at least 0 and below 1, got {self.beta}")


PAPER_WEIGHTS = ObjectiveWeights()


@dataclass(frozen=True)
class ObjectiveKind:
    """One objective, a fitness that every search and proof can maximize.

        E = alpha * R_img + R_ave + signed_beta * n_used / n_questions

    An image's rate is its Correct answers / its `asked` answers; R_ave is the mean rate, R_img the
    share of the images whose rate exceeds one half. A new objective sets the fields, and overrides
    the methods where that is not enough.

    Attributes:
        name: its short name in files, options and tables, also that of the subset it finds.
        hint: what it prefers, in a few words for the user.
        primed: whether Invalid answers stand in the denominator of the rates.
        beta_sign: +1 if many questions are welcome, -1 if few are, 0 if it makes no difference.
    """

    name: str
    hint: str
    primed: bool
    beta_sign: int

    def asked(self, counts: Counts) -> NDArray[np.int64]:
        """Answers in the denominator of the rates, (n_images, n_questions); at least `correct`."""
        return counts.correct + counts.wrong + (counts.invalid if self.primed else 0)

    def signed_beta(self, weights: ObjectiveWeights) -> float:
        """What the share of questions used is multiplied by; above -1."""
        return self.beta_sign * weights.beta
