"""95 % intervals: of one task's accuracy, of means over tasks, and of what one choice gains."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

__all__ = ["Tally", "balanced_interval", "mean_interval", "resampled", "spread"]

_CONFIDENCE = 0.95
_N_RESAMPLES = 4000
_SEED = 0

#: Of fewer tasks an interval over tasks says nothing.
_FEWEST = 3


@dataclass(frozen=True, slots=True)
class Tally:
    """How often each picture of a task was tested, and how often recognized.

    Attributes:
        labels: +1 or -1 of every picture.
        tested: in how many draws each was tested.
        recognized: for each way of choosing questions, in how many of these it was recognized.

    Raises:
        ValueError: if the lists differ in length, or a picture was recognized untested.
    """

    labels: list[int]
    tested: list[int]
    recognized: Mapping[str, list[int]]

    def __post_init__(self) -> None:
        for way, times in (("labels", self.labels), *self.recognized.items()):
            if len(times) != len(self.tested):
                raise ValueError(f"{way}: {len(times)} pictures, but {len(self.tested)} tested")
            if any(one > n for one, n in zip(times, self.tested, strict=True) if way != "labels"):
                raise ValueError(f"{way}: a picture was recognized more often than tested")

    def balanced(self, way: str, minus: str | None = None) -> float:
        """The mean over the states of the recognized share, or by how much it is above another."""
        shares = (gained.sum() / tested.sum() for gained, tested in self.of_states(way, minus))
        return math.fsum(shares) / 2

    def called_positive(self, way: str) -> float:
        """The mean over the states of the share called positive; 0.5 has no lean.

        A picture without a verdict counts as called the other state: it was not recognized.
        """
        positive, negative = (
            float(gained.sum() / tested.sum()) for gained, tested in self.of_states(way)
        )
        return (positive + 1 - negative) / 2

    def of_states(
        self, way: str, minus: str | None = None
    ) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """(times recognized, times tested) of each state's tested pictures."""
        labels, tested = np.array(self.labels), np.array(self.tested, np.int64)
        gained = np.array(self.recognized[way], np.int64)
        if minus is not None:
            gained = gained - np.array(self.recognized[minus], np.int64)
        return [
            (gained[own], tested[own]) for own in ((labels == s) & (tested > 0) for s in (1, -1))
        ]


def balanced_interval(tally: Tally, way: str) -> list[float]:
    """Interval of a balanced accuracy; its width comes from how many pictures each state has.

    A picture counts once, however many draws tested it, so the interval is rather too wide. It
    does not shrink to a point where everything is right.

    Source: Wilson's interval of each state's share, put together by G. Y. Zou and A. Donner,
    "Construction of confidence limits about effect measures", Statistics in Medicine 27 (2008).
    """
    below = above = 0.0
    for recognized, tested in tally.of_states(way):
        share = float(recognized.sum() / tested.sum())
        low, high = _wilson(share, len(tested))
        below += (share - low) ** 2
        above += (high - share) ** 2
    middle = tally.balanced(way)
    return [round(middle - math.sqrt(below) / 2, 4), round(middle + math.sqrt(above) / 2, 4)]


def mean_interval(values: Sequence[float]) -> list[float] | None:
    """Student's t interval of a mean, or None of fewer than three values."""
    if len(values) < _FEWEST:
        return None
    mean = math.fsum(values) / len(values)
    reach = float(stats.t.ppf((1 + _CONFIDENCE) / 2, len(values) - 1) * stats.sem(values))
    return [round(mean - reach, 4), round(mean + reach, 4)]


def resampled(tallies: Sequence[Tally], way: str, minus: str | None = None) -> NDArray[np.float64]:
    """Means over tasks of `Tally.balanced`, for pictures drawn anew within each task and state.

    Returns:
        (n_resamples,); with `minus` the differences are paired, picture by picture.
    """
    rng = np.random.default_rng(_SEED)
    total = np.zeros(_N_RESAMPLES)
    for tally in tallies:
        for gained, tested in tally.of_states(way, minus):
            n = len(tested)
            times = rng.multinomial(n, np.full(n, 1 / n), size=_N_RESAMPLES)
            total += (times @ gained) / (times @ tested) / 2
    return total / len(tallies)


def spread(values: NDArray[np.float64]) -> list[float]:
    """The middle 95 % of resampled values."""
    outside = (1 - _CONFIDENCE) / 2
    return [round(float(end), 4) for end in np.quantile(values, (outside, 1 - outside))]


def _wilson(share: float, n: int) -> tuple[float, float]:
    """Wilson's interval of a share among n."""
    z = float(stats.norm.ppf((1 + _CONFIDENCE) / 2))
    centre = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    reach = z / (1 + z**2 / n) * math.sqrt(share * (1 - share) / n + z**2 / (4 * n**2))
    # Rounding must not put the end beyond the share itself.
    return min(share, centre - reach), max(share, centre + reach)
