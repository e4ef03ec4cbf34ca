"""What a search maximizes: the paper's four objectives and their weights."""

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["PAPER_WEIGHTS", "Objective", "ObjectiveWeights"]


_MOST_ALPHA = 1_000_000


class Objective(StrEnum):
    """What the search maximizes; the subset it finds has the same name.

    Source: paper II-B, equations of E+, E'+, E- and E'-.
    """

    S_PLUS = "s+"
    S_PRIME_PLUS = "s'+"
    S_MINUS = "s-"
    S_PRIME_MINUS = "s'-"

    @property
    def primed(self) -> bool:
        """Whether Invalid answers stand in the denominator of the rates."""
        return self in (Objective.S_PRIME_PLUS, Objective.S_PRIME_MINUS)

    @property
    def beta_sign(self) -> int:
        """+1 if many questions are welcome, -1 if few are."""
        return 1 if self in (Objective.S_PLUS, Objective.S_PRIME_PLUS) else -1


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
