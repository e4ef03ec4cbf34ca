"""Which image to label next, which label to look at again, and which label to suggest.

All three read the *margin* of an image: how clearly a vote speaks for the positive state, from 1
(every answer for it) over 0 (a tie) to -1 (every answer against it), see
vqa_state/votes/reject_option.py.

Source: D. D. Lewis, W. A. Gale, "A sequential algorithm for training text classifiers", SIGIR 1994
(the closest vote first); C. E. Brodley, M. A. Friedl, "Identifying mislabeled training data",
Journal of Artificial Intelligence Research 1999 (votes of recognizers that never saw the image).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "DoubtfulLabel",
    "OpenImage",
    "Suggestion",
    "closest_votes",
    "doubtful_labels",
    "suggestions",
]

STRONGLY = 0.5
"""A vote against the label is strong from this margin on: where all is clear, 3 answers in 4."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class OpenImage:
    """An image without a label, and how close its vote is.

    Attributes:
        image_id: its id.
        margin: of its vote, in [-1, 1]; NaN if no answer was a clear yes or no.
    """

    image_id: str
    margin: float

    def reason(self, positive: str, negative: str) -> str:
        """Why it stands where it stands, in one sentence."""
        if np.isnan(self.margin):
            return "no answer was a clear yes or no"
        if self.margin == 0:
            return f"the vote is a tie between {positive} and {negative}"
        name = positive if self.margin > 0 else negative
        return f"the vote leans to {name} by {abs(self.margin):.2f} of 1"


@dataclass(frozen=True, slots=True)
class DoubtfulLabel:
    """A training image whose out-of-bag vote is strongly against its label.

    Attributes:
        image_id: its id.
        label: the label that it has, +1 or -1.
        margin: of the out-of-bag vote, in [-1, 1], with the sign of the other state.
    """

    image_id: str
    label: int
    margin: float

    def reason(self, positive: str, negative: str) -> str:
        """Why the label is doubtful, in one sentence."""
        label, vote = (positive, negative) if self.label > 0 else (negative, positive)
        return (
            f"its label says {label}, but recognizers that were chosen without it say {vote} "
            f"(by {abs(self.margin):.2f} of 1): the label may be wrong, or the image is hard"
        )


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A label for an image that has none, for a person to accept.

    Attributes:
        image_id: its id.
        label: +1 or -1.
        sureness: of the vote, in (0, 1].
    """

    image_id: str
    label: int
    sureness: float


def closest_votes(image_ids: Sequence[str], margins: Floats) -> tuple[OpenImage, ...]:
    """Images without a label, the closest vote first: their labels teach the most.

    Images without a clear answer come last: no choice of questions could use their label.

    Args:
        image_ids: n_images ids.
        margins: of a vote on each, (n_images,) in [-1, 1]; NaN if no answer was clear.

    Raises:
        ValueError: if the lengths differ or a margin is out of range.

    Source: Lewis and Gale 1994, uncertainty sampling.
    """
    _require(image_ids, margins)
    order = np.argsort(np.abs(margins), kind="stable")  # NaN last
    return tuple(OpenImage(image_ids[i], float(margins[i])) for i in order)


def doubtful_labels(
    image_ids: Sequence[str],
    labels: NDArray[np.int8],
    margins: Floats,
    *,
    strongly: float = STRONGLY,
) -> tuple[DoubtfulLabel, ...]:
    """Training images that may be mislabelled, the strongest vote against the label first.

    Give it training images only: a test image whose label is changed because of a vote is no test
    any more. The margin must be out of bag, as a recognizer chosen with the wrong label repeats it.

    Args:
        image_ids: n_images ids of training images.
        labels: +1 or -1, (n_images,).
        margins: out-of-bag, (n_images,) in [-1, 1]; NaN for an image that was never out of bag.
        strongly: margin against the label from which on it is listed, in (0, 1].

    Raises:
        ValueError: if lengths differ, or a value is out of range.

    Source: Brodley and Friedl 1999.
    """
    _require(image_ids, margins)
    if labels.shape != margins.shape or not np.isin(labels, (-1, 1)).all():
        raise ValueError(f"labels must be {margins.size} values of +1 or -1, got {labels}")
    if not 0 < strongly <= 1:
        raise ValueError(f"strongly must be above 0 and at most 1, got {strongly}")
    against = -labels * margins
    order = np.argsort(-against, kind="stable")  # NaN last
    return tuple(
        DoubtfulLabel(image_ids[i], int(labels[i]), float(margins[i]))
        for i in order
        if against[i] >= strongly
    )


def suggestions(
    image_ids: Sequence[str], margins: Floats, *, min_sureness: float = 0.0
) -> tuple[Suggestion, ...]:
    """Labels for images without one, the surest first: a person looks, and accepts with one key.

    Args:
        image_ids: n_images ids.
        margins: of the chosen recognizer's vote, (n_images,) in [-1, 1]; NaN if nothing was clear.
        min_sureness: below it, and for a tie, nothing is suggested; in [0, 1].

    Raises:
        ValueError: if the lengths differ, or a value is out of range.
    """
    _require(image_ids, margins)
    if not 0 <= min_sureness <= 1:
        raise ValueError(f"min_sureness must be in [0, 1], got {min_sureness}")
    sureness = np.abs(margins)
    order = np.argsort(-sureness, kind="stable")
    return tuple(
        Suggestion(image_ids[i], 1 if margins[i] > 0 else -1, float(sureness[i]))
        for i in order
        if sureness[i] > 0 and sureness[i] >= min_sureness
    )


def _require(image_ids: Sequence[str], margins: Floats) -> None:
    if margins.shape != (len(image_ids),):
        raise ValueError(f"need one margin for each of {len(image_ids)}, got {margins.shape}")
    if (np.abs(margins) > 1).any():
        raise ValueError(f"margins must be in [-1, 1] or NaN, got {margins}")
