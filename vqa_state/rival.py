"""The rival: what the user would have taken instead of questions, a small trained image classifier.

Logistic regression on features of the embedded model's image network (`vqa_state.embedded.pooled`),
trained on the copies of the same training images and judged on the same test images, in the same
table. If it wins, the report says so.

    odds(image) = mean over its copies of (w x + b),   x standardized by the training copies

The positive state wins above 0, the negative one below; exactly 0 is unknown. The strength of the
penalty is chosen by cross-validation among the training images; look-alikes, and all copies of one
image, stay on one side.

Source: A. S. Razavian et al., "CNN features off-the-shelf: an astounding baseline for recognition",
CVPR workshops 2014.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.errors import NothingToSearchError
from vqa_state.voting.logistic import fit_logistic

__all__ = ["STRENGTHS", "Rival", "fit_rival"]

STRENGTHS = (1 / 4096, 1 / 1024, 1 / 256, 1 / 64, 1 / 16, 1 / 4, 1.0)
"""Weaker ones than a vote's, too: a thousand features tell twenty images apart easily."""


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """A trained classifier of image features; arrays are (n_features,), float64.

    Attributes:
        center: mean of the training copies.
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
        """Logarithm of the odds for the positive state, mean over the copies, (n_images,).

        Args:
            features: (n_images, n_copies, n_features).

        Raises:
            ValueError: if the shape does not fit.
        """
        if features.ndim != 3 or features.shape[2] != self.center.size or not features.shape[1]:
            raise ValueError(
                f"features must be (n_images, n_copies, {self.center.size}), got {features.shape}"
            )
        standardized = (features.astype(np.float64) - self.center) / self.scale
        odds: NDArray[np.float64] = (standardized @ self.coefficients).mean(axis=1)
        return odds + self.intercept

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


def fit_rival(
    features: NDArray[np.float32],
    labels: NDArray[np.int8],
    groups: NDArray[np.int64] | None = None,
) -> Rival:
    """Train on the training images. The same arguments give the same rival.

    Args:
        features: (n_images, n_copies, n_features), those of the copies that are asked about, too.
        labels: +1 or -1, (n_images,).
        groups: number of each image's group of look-alikes, (n_images,); all different without it.

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
            "the rival needs labelled training images of both states; label some of the other"
        )
    n_images, n_copies, n_features = features.shape
    rows = features.astype(np.float64).reshape(n_images * n_copies, n_features)
    center, spread = rows.mean(axis=0), rows.std(axis=0)
    scale = np.where(spread > 0, spread, 1.0)
    copies_of = np.repeat(np.arange(n_images), n_copies)
    standardized = (rows - center) / scale
    fit = fit_logistic(standardized, labels[copies_of], groups[copies_of], STRENGTHS)
    return Rival(center, scale, fit.coefficients, fit.intercept, fit.strength)
