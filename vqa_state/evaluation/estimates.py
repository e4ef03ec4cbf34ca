"""What share of new images will be recognized, from out-of-bag scores, and with what spread."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.evaluation.intervals import clopper_pearson

__all__ = ["Estimate", "estimate", "known_mean", "optimism_warning"]

_EXACT = 1e-9

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Estimate:
    """What share of new images will be recognized; all in [0, 1], NaN where unknown.

    Attributes:
        share: the estimate.
        positive: of the images of the positive state.
        negative: of the images of the negative state.
        standard_error: of `share`, as of a mean over so many independent images.
        low: lower end of a 95 % interval, as wide as an exact one (Clopper-Pearson) of so many
            independent images.
        high: its upper end.
    """

    share: float
    positive: float
    negative: float
    standard_error: float
    low: float
    high: float


def estimate(recognized: Floats, labels: NDArray[np.int8], groups: NDArray[np.int64]) -> Estimate:
    """Put the images' scores together.

    Args:
        recognized: share of the resamples lacking the image that recognize it, (n_images,) in [0,
            1]; NaN for an image that no resample lacks.
        labels: +1 or -1, (n_images,).
        groups: near-duplicates have one number and count as one independent image, (n_images,).
    """
    known = ~np.isnan(recognized)
    if not known.any():
        return Estimate(*[math.nan] * 6)
    positive, negative = (
        float(known_mean(recognized[known & (labels == state)])) for state in (1, -1)
    )
    share = float(recognized[known].mean())
    n_units = np.unique(groups[known]).size
    # The spread of the images' scores is too small: resamples share most of their images. So is
    # an interval made from it, which holds the truth in 74 of 100 synthetic tasks.
    spread = math.sqrt(share * (1 - share) / n_units)
    interval = clopper_pearson(share * n_units, n_units)
    return Estimate(share, positive, negative, spread, interval.low, interval.high)


def optimism_warning(train_share: float, estimate: Estimate, n_images: int) -> str | None:
    """A sentence where the training score promises more than out-of-bag keeps, else None.

    That is: more than one image, and more than the estimate's standard error.

    Args:
        train_share: share of the training images that the recognizer recognizes.
        estimate: of the same kind of vote.
        n_images: training images.
    """
    excess = train_share - estimate.share
    if math.isnan(excess) or excess <= max(1 / n_images, estimate.standard_error) + _EXACT:
        return None
    return (
        f"The training images promise {train_share * n_images:.0f} of {n_images}, but images left "
        f"out of training keep only {estimate.share * n_images:.1f} of {n_images} (95 % interval "
        f"{estimate.low * n_images:.1f} to {estimate.high * n_images:.1f}): expect the lower "
        "number on new images, and label more of them."
    )


def known_mean(values: Floats) -> Floats:
    """Mean over the first axis, passing over NaN; NaN of nothing, without a warning."""
    known = ~np.isnan(values)
    total = np.where(known, values, 0.0).sum(axis=0)
    n_known = np.asarray(known.sum(axis=0))
    means = np.full(n_known.shape, np.nan)
    np.divide(total, n_known, out=means, where=n_known > 0)
    return means
