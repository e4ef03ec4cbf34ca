"""The smallest sureness, learned for a wanted coverage.

A robot may rather ask a person than act on a doubtful verdict. What is learned is one number: a
vote whose sureness (vqa_state/abstaining.py) is below it gets `unknown`. It comes from out-of-bag
votes of the training images, that is from votes of recognizers that were chosen without the image,
for the share of images that shall get a verdict. Test images never enter it.

Source: C. K. Chow, "On optimum recognition error and reject tradeoff", IEEE Transactions on
Information Theory 1970.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from vqa_state.evaluation import Interval, exact_interval

__all__ = ["CoveragePoint", "choose_point", "coverage_curve"]


@dataclass(frozen=True, slots=True)
class CoveragePoint:
    """What one smallest sureness would do on the images that it was tried on.

    Attributes:
        min_sureness: images below it get `unknown`.
        n_images: images in all.
        n_covered: images with a verdict.
        n_correct: images whose verdict is right.
        interval: exact 95 % interval of the accuracy; NaN to NaN without a verdict.
    """

    min_sureness: float
    n_images: int
    n_covered: int
    n_correct: int
    interval: Interval

    @property
    def coverage(self) -> float:
        """Share of the images with a verdict, in [0, 1]."""
        return self.n_covered / self.n_images

    @property
    def accuracy(self) -> float:
        """Share of the verdicts that are right, in [0, 1]; NaN without a verdict."""
        return self.n_correct / self.n_covered if self.n_covered else math.nan


def coverage_curve(
    sureness: NDArray[np.float64], states: NDArray[np.int8], labels: NDArray[np.int8]
) -> tuple[CoveragePoint, ...]:
    """Accuracy against coverage: one point for each number of images that can get a verdict.

    Args:
        sureness: out-of-bag sureness of each training image, (n_images,) in [0, 1]; NaN for an
            image that was never out of bag: it is left out.
        states: the state that the out-of-bag vote leans to, +1, -1 or 0, (n_images,).
        labels: +1 or -1, (n_images,).

    Returns:
        Points with rising `min_sureness` and falling coverage; the first has `min_sureness` 0.

    Raises:
        ValueError: if the arrays do not fit, a sureness is out of range, or no image is left.

    Source: Chow 1970.
    """
    if not sureness.shape == states.shape == labels.shape or sureness.ndim != 1:
        raise ValueError(
            f"need one value an image, got {sureness.shape}, {states.shape} and {labels.shape}"
        )
    known = ~np.isnan(sureness)
    sureness, states, labels = sureness[known], states[known], labels[known]
    if sureness.size == 0 or not ((sureness >= 0) & (sureness <= 1)).all():
        raise ValueError(f"need at least one out-of-bag sureness, all in [0, 1]; got {sureness}")
    points: list[CoveragePoint] = []
    for least in sorted({0.0, *map(_rounded_down, sureness[states != 0].tolist())}):
        covered = (sureness >= least) & (states != 0)
        n_covered = int(np.count_nonzero(covered))
        if points and points[-1].n_covered == n_covered:
            continue
        n_correct = int(np.count_nonzero(covered & (states == labels)))
        interval = exact_interval(n_correct, n_covered)
        points.append(CoveragePoint(least, sureness.size, n_covered, n_correct, interval))
    return tuple(points)


def _rounded_down(sureness: float) -> float:
    """To six digits, as a file shows them; exact, so that the image itself still reaches it."""
    return math.floor(Fraction(sureness) * 1_000_000) / 1_000_000


def choose_point(curve: Sequence[CoveragePoint], coverage: float) -> CoveragePoint:
    """The strictest point at which at least `coverage` of the images get a verdict.

    If even the first point covers fewer, because of ties and images without a valid answer, it is
    the first: more cannot be had. What new images get is only about this share.

    Args:
        curve: from `coverage_curve`.
        coverage: wanted share of images with a verdict, in (0, 1].

    Raises:
        ValueError: if the share is out of range.
    """
    if not 0 < coverage <= 1:
        raise ValueError(f"coverage must be above 0 and at most 1, got {coverage}")
    wanted = Fraction(repr(float(coverage)))
    enough = [point for point in curve if point.n_covered >= wanted * point.n_images]
    return enough[-1] if enough else curve[0]
