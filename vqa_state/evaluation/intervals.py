"""The exact interval of a proportion."""

import math
from dataclasses import dataclass

__all__ = ["CONFIDENCE", "Interval", "clopper_pearson"]

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Interval:
    """A 95 % interval; both ends are NaN where the score is undefined."""

    low: float
    high: float


def clopper_pearson(n_successes: float, n_trials: float) -> Interval:
    """Clopper and Pearson's exact 95 % interval of a proportion; NaN to NaN without trials.

    Args:
        n_successes: from 0 to `n_trials`. The beta quantiles also take numbers that are not whole,
            as of an effective number of independent trials.
        n_trials: 0 or more.

    Raises:
        ValueError: if a number is out of its range.

    Source: C. J. Clopper, E. S. Pearson, "The use of confidence or fiducial limits illustrated in
    the case of the binomial", Biometrika 1934.
    """
    from scipy.special import betaincinv  # takes a while to import

    if not 0 <= n_successes <= n_trials:
        raise ValueError(f"successes must be 0 to {n_trials}, all trials; got {n_successes}")
    if n_trials == 0:
        return Interval(math.nan, math.nan)
    tail, n_failures = (1 - CONFIDENCE) / 2, n_trials - n_successes
    low = betaincinv(n_successes, n_failures + 1, tail) if n_successes else 0.0
    high = betaincinv(n_successes + 1, n_failures, 1 - tail) if n_failures else 1.0
    return Interval(float(low), float(high))
