"""Calibration of probabilities: fitting a temperature, and the expected calibration error.

Source: C. Guo et al., *On Calibration of Modern Neural Networks*, ICML 2017.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

__all__ = ["Bin", "calibration_error", "fit_temperature", "reliability"]

_SMALLEST, _LARGEST = 0.05, 20.0


@dataclass(frozen=True, slots=True)
class Bin:
    """Answers whose probability lies in one tenth of [0, 1].

    Attributes:
        n: how many.
        mean_p: their mean probability of "yes"; the middle of the tenth if there are none.
        share_yes: in how many of them "yes" was right, in [0, 1].
    """

    n: int
    mean_p: float
    share_yes: float


def fit_temperature(differences: NDArray[np.float64], is_yes: NDArray[np.bool_]) -> float:
    """The divisor of logit differences (yes minus no) under which the answers are likeliest.

    Raises:
        ValueError: if there is no answer to fit.
    """
    if len(differences) == 0:
        raise ValueError("a temperature needs at least one answer")
    signs = np.where(is_yes, 1.0, -1.0)

    def loss(log_temperature: float) -> float:
        return float(np.logaddexp(0, -signs * differences / np.exp(log_temperature)).mean())

    bounds = (np.log(_SMALLEST), np.log(_LARGEST))
    return float(np.exp(minimize_scalar(loss, bounds=bounds, method="bounded").x))


def reliability(
    p_yes: NDArray[np.float64], is_yes: NDArray[np.bool_], n_bins: int = 10
) -> list[Bin]:
    """The reliability curve: stated against observed, in bins of equal width."""
    numbers = np.minimum((p_yes * n_bins).astype(int), n_bins - 1)
    bins = []
    for number in range(n_bins):
        inside = numbers == number
        n = int(inside.sum())
        mean_p = float(p_yes[inside].mean()) if n else (number + 0.5) / n_bins
        bins.append(Bin(n, mean_p, float(is_yes[inside].mean()) if n else 0.0))
    return bins


def calibration_error(bins: list[Bin]) -> float:
    """Expected calibration error: the mean gap between stated and observed, in [0, 1]."""
    n_answers = sum(each.n for each in bins)
    gaps = (each.n * abs(each.mean_p - each.share_yes) for each in bins)
    return sum(gaps) / n_answers if n_answers else 0.0
