"""The linear probe: what the user would have taken instead of questions, a trained classifier.

Logistic regression on features of the embedded model's image network
(`vqa_state.models.embedded.pooled`), trained on the same training images and judged on the same
test images, in the same table, and out of bag on the very resamples that the votes were estimated
on. If it wins, the report says so.

    odds(image) = w x + b,   x the mean features of its copies, standardized by the training images

The positive state wins above 0, the negative one below; exactly 0 is unknown. The strength of the
penalty is chosen by cross-validation among the training images, in every resample anew;
near-duplicates stay on one side. (Every copy as a row of its own recognizes no more and takes
twenty times as long: docs/decisions/0013-the-rival.md.)

Source: A. S. Razavian et al., "CNN features off-the-shelf: an astounding baseline for recognition",
CVPR workshops 2014.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.estimates import Estimate, estimate, known_mean
from vqa_state.votes.logistic import fit_logistic
from vqa_state.votes.resampling import divisible

__all__ = [
    "STRENGTHS",
    "LinearProbe",
    "ProbeResamples",
    "fit_linear_probe",
    "linear_probe_out_of_bag",
]

STRENGTHS = (1 / 4096, 1 / 1024, 1 / 256, 1 / 64, 1 / 16, 1 / 4, 1.0)
"""Weaker ones than a vote's, too: a thousand features tell twenty images apart easily."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearProbe:
    """A trained classifier of image features; arrays are (n_features,), float64.

    Attributes:
        center: mean of the training images' features.
        scale: their standard deviation, 1 where a feature never changes.
        coefficients: of the standardized features.
        intercept: in the same unit.
        strength: of the penalty, chosen by cross-validation.
    """

    center: NDArray[np.float64]
    scale: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    intercept: float
    strength: float

    def odds(self, features: NDArray[np.float32]) -> NDArray[np.float64]:
        """Logarithm of the odds for the positive state, (n_images,).

        Args:
            features: (n_images, n_copies, n_features).

        Raises:
            ValueError: if the shape does not fit.
        """
        if features.ndim != 3 or features.shape[2] != self.center.size or not features.shape[1]:
            raise ValueError(
                f"features must be (n_images, n_copies, {self.center.size}), got {features.shape}"
            )
        standardized = (_of_images(features) - self.center) / self.scale
        odds: NDArray[np.float64] = standardized @ self.coefficients + self.intercept
        return odds

    def decide(self, features: NDArray[np.float32]) -> NDArray[np.int8]:
        """+1 positive, -1 negative, 0 unknown, (n_images,)."""
        sides: NDArray[np.int8] = np.sign(self.odds(features)).astype(np.int8)
        return sides

    def recognized(
        self, features: NDArray[np.float32], labels: NDArray[np.int8]
    ) -> NDArray[np.bool_]:
        """Which images it recognizes, (n_images,), as in `SubsetScore.recognized`."""
        right: NDArray[np.bool_] = self.decide(features) == labels
        return right


def fit_linear_probe(
    features: NDArray[np.float32],
    labels: NDArray[np.int8],
    groups: NDArray[np.int64] | None = None,
) -> LinearProbe:
    """Train on the training images. The same arguments give the same linear probe.

    Args:
        features: (n_images, n_copies, n_features), of the copies that are asked about.
        labels: +1 or -1, (n_images,).
        groups: number of each image's group of near-duplicates, (n_images,); all different without
            it.

    Raises:
        NothingToSearchError: if a state has no image.
        ValueError: if shapes differ or a feature is not finite.
    """
    groups = np.arange(len(labels)) if groups is None else groups
    if features.ndim != 3 or not len(features) == len(labels) == len(groups):
        raise ValueError(
            f"features must be (n_images, n_copies, n_features) with {len(labels)} images, got "
            f"{features.shape}"
        )
    if set(labels.tolist()) != {1, -1}:
        raise NothingToSearchError(
            "a linear probe needs labelled training images of both states; label some of the other"
        )
    rows = _of_images(features)
    center, spread = rows.mean(axis=0), rows.std(axis=0)
    scale = np.where(spread > 0, spread, 1.0)
    fit = fit_logistic((rows - center) / scale, labels, groups, STRENGTHS)
    return LinearProbe(center, scale, fit.coefficients, fit.intercept, fit.strength)


@dataclass(frozen=True, slots=True, eq=False)
class ProbeResamples:
    """After one resample more.

    Attributes:
        n_done: resamples done, from 1.
        n_total: resamples in all.
        recognized: share of the resamples lacking the image whose linear probe recognizes it,
            (n_images,); NaN for an image that was never out.
        estimate: what share of new images the linear probe will recognize, as for the votes.
    """

    n_done: int
    n_total: int
    recognized: NDArray[np.float64]
    estimate: Estimate


def linear_probe_out_of_bag(
    features: NDArray[np.float32],
    labels: NDArray[np.int8],
    groups: NDArray[np.int64],
    resamples: Sequence[NDArray[np.intp]],
) -> Iterator[ProbeResamples]:
    """Train a linear probe on every resample and judge it on the images that the resample lacks.

    Args:
        features: (n_images, n_copies, n_features).
        labels: +1 or -1, (n_images,).
        groups: number of each image's group of near-duplicates, (n_images,).
        resamples: positions of each resample's images, from `vqa_state.evaluation.out_of_bag`, so
            that linear probe and votes are judged on the same images.

    Yields:
        One report a resample. The caller stops by no longer iterating.

    Source: as `vqa_state.evaluation.out_of_bag`.
    """
    kept = divisible(labels, groups)
    recognized = np.full((len(resamples), len(labels)), np.nan)
    for number, drawn in enumerate(resamples):
        probe = fit_linear_probe(features[drawn], labels[drawn], kept[drawn])
        out = np.ones(len(labels), dtype=bool)
        out[drawn] = False
        recognized[number, out] = probe.recognized(features[out], labels[out])
        shares = known_mean(recognized[: number + 1])
        yield ProbeResamples(number + 1, len(resamples), shares, estimate(shares, labels, kept))


def _of_images(features: NDArray[np.float32]) -> NDArray[np.float64]:
    """Mean over the copies, (n_images, n_features)."""
    means: NDArray[np.float64] = features.astype(np.float64).mean(axis=1)
    return means
