"""The smallest sureness, learned for a wanted coverage.

A robot may rather ask a person than act on a doubtful verdict. What is learned is one number: a
vote whose sureness (`vqa_state.votes.reject_option`) is below it gets `unknown`. It comes from
out-of-bag votes of the training images, that is from votes of recognizers that were chosen without
the image, for the share of votes that shall give a verdict. Test images never enter it.

Every single out-of-bag vote counts, one for each resample and each image that the resample lacks: a
new image gets one vote, too. A mean over an image's votes spreads less than one vote does, so a
sureness learned from means keeps a large coverage too rarely, and a small one too often.

Source: C. K. Chow, "On optimum recognition error and reject tradeoff", IEEE Transactions on
Information Theory 1970.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.table import AnswerTable
from vqa_state.evaluation.intervals import Interval, clopper_pearson
from vqa_state.evaluation.out_of_bag import OutOfBag
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import VoteKind

__all__ = ["MAX_POINTS", "CoveragePoint", "choose_point", "coverage_curve", "single_votes"]

MAX_POINTS = 200
"""Points of a curve at most; so a wanted coverage is met to half a percent."""

Floats = NDArray[np.float64]
States = NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class CoveragePoint:
    """What one smallest sureness would do to the single out-of-bag votes.

    Attributes:
        min_sureness: votes below it say `unknown`.
        n_images: images that were ever out of bag, each with one vote a resample that lacks it.
        n_votes: single votes in all.
        n_covered: votes that give a verdict.
        n_correct: votes whose verdict is right.
        interval: 95 % interval of the accuracy; NaN to NaN without a verdict. Votes on one image
            are not independent, nor are near-duplicates, so it is as wide as an exact one of fewer:
            with w verdicts in each group, (sum of w)² / (sum of w²) of them, which is right if all
            verdicts in a group are right or wrong together, and else too wide.
    """

    min_sureness: float
    n_images: int
    n_votes: int
    n_covered: int
    n_correct: int
    interval: Interval

    @property
    def coverage(self) -> float:
        """Share of the votes that give a verdict, in [0, 1]."""
        return self.n_covered / self.n_votes

    @property
    def accuracy(self) -> float:
        """Share of the verdicts that are right, in [0, 1]; NaN without a verdict."""
        return self.n_correct / self.n_covered if self.n_covered else math.nan

    def sentence(self) -> str:
        """How many verdicts there are, and how many of them are right."""
        given = (
            f"{self.n_covered} of {self.n_votes} out-of-bag votes on {self.n_images} images give a "
            "verdict"
        )
        if not self.n_covered:
            return given
        return (
            f"{given}, {self.n_correct} of them the right one ({self.accuracy:.0%}, 95 % interval "
            f"{self.interval.low:.0%} to {self.interval.high:.0%})"
        )


def single_votes(out: OutOfBag, kind: VoteKind, train: AnswerTable) -> tuple[Floats, States]:
    """The votes of each resample on the images that it lacks.

    Args:
        out: resamples of the training images.
        kind: which vote of each resample.
        train: the training images' answers.

    Returns:
        Their sureness in [0, 1], NaN for images of the resample, and the state that they lean to,
        +1, -1 or 0; both (n_resamples, n_images).
    """
    shape = len(out.resamples), train.n_images
    sureness, states = np.full(shape, np.nan), np.zeros(shape, np.int8)
    for number, resample in enumerate(out.resamples):
        rule, left = AbstainRule(resample.votes[kind]), resample.out
        shares = train.p_positive[left] if kind.by_p_yes else None
        sureness[number, left] = rule.sureness(train.verdicts[left], shares)
        states[number, left] = rule.states(train.verdicts[left], shares)
    return np.minimum(sureness, 1.0), states


def coverage_curve(
    sureness: Floats, states: States, labels: States, groups: NDArray[np.int64] | None = None
) -> tuple[CoveragePoint, ...]:
    """Accuracy against coverage, over single votes.

    Args:
        sureness: of each out-of-bag vote, (n_resamples, n_images) in [0, 1]; NaN where the image is
            in the resample: there is no such vote.
        states: the state that each vote leans to, +1, -1 or 0, (n_resamples, n_images).
        labels: +1 or -1, (n_images,).
        groups: number of each image's group of near-duplicates, (n_images,); all different without
            it.

    Returns:
        At most `MAX_POINTS` points with rising `min_sureness` and falling coverage; the first has
        `min_sureness` 0. Where more could be told apart, about evenly spaced in coverage.

    Raises:
        ValueError: if the arrays do not fit, a sureness is out of range, or there is no vote.

    Source: Chow 1970.
    """
    groups = np.arange(labels.size) if groups is None else groups
    fits = sureness.ndim == 2 and sureness.shape == states.shape
    if not fits or not sureness.shape[1:] == labels.shape == groups.shape:
        raise ValueError(
            f"need votes as (n_resamples, n_images) and one label and group an image, got "
            f"{sureness.shape}, {states.shape}, {labels.shape} and {groups.shape}"
        )
    resamples, images = np.nonzero(~np.isnan(sureness))
    sure, leaning = sureness[resamples, images], states[resamples, images]
    if sure.size == 0 or not ((sure >= 0) & (sure <= 1)).all():
        raise ValueError(f"need at least one out-of-bag vote, sureness in [0, 1]; got {sureness}")
    right = leaning == labels[images]
    group = np.unique(groups[images], return_inverse=True)[1]
    n_images = int(np.unique(images).size)

    def point(least: float) -> CoveragePoint:
        covered = (sure >= least) & (leaning != 0)
        n_correct = int(np.count_nonzero(covered & right))
        interval = _interval(n_correct, np.bincount(group[covered]))
        n_covered = int(np.count_nonzero(covered))
        return CoveragePoint(least, n_images, sure.size, n_covered, n_correct, interval)

    return tuple(point(least) for least in _levels(sure, leaning))


def _levels(sure: Floats, leaning: States) -> list[float]:
    """Smallest surenesses, rising, each of which covers fewer votes than the one before."""
    leans = np.sort(sure[leaning != 0])
    found: dict[int, float] = {leans.size: 0.0}  # by how many votes are covered
    distinct = np.unique(leans)
    counts = leans.size - np.searchsorted(leans, distinct)
    steps = np.arange(1, MAX_POINTS) * leans.size / (MAX_POINTS - 1)
    # Of each step of coverage the strictest level that reaches it: the last of falling counts.
    reaching = np.searchsorted(-counts, -np.ceil(steps - 1e-9), side="right") - 1
    chosen = range(distinct.size) if distinct.size < MAX_POINTS else np.unique(reaching).tolist()
    for level in (_rounded_down(float(distinct[place])) for place in chosen):
        n_covered = int(leans.size - np.searchsorted(leans, level))
        if n_covered not in found:
            found[n_covered] = level
    return sorted(found.values())


def _interval(n_correct: int, n_of_group: NDArray[np.intp]) -> Interval:
    """As `CoveragePoint.interval` says; `n_of_group` are the verdicts in each group."""
    n_covered = int(n_of_group.sum())
    n_independent = n_covered**2 / float((n_of_group**2).sum()) if n_covered else 0.0
    share = n_correct / n_covered if n_covered else 0.0
    return clopper_pearson(share * n_independent, n_independent)


def _rounded_down(sureness: float) -> float:
    """To six digits, as a file shows them; exact, so that the vote itself still reaches it."""
    return math.floor(Fraction(sureness) * 1_000_000) / 1_000_000


def choose_point(curve: Sequence[CoveragePoint], coverage: float) -> CoveragePoint:
    """The strictest point at which at least `coverage` of the votes give a verdict.

    If even the first point covers fewer, because of ties and images without a valid answer, it is
    the first: more cannot be had. New images get only about this share.

    Args:
        curve: from `coverage_curve`.
        coverage: wanted share of votes with a verdict, in (0, 1].

    Raises:
        ValueError: if the share is out of range.
    """
    if not 0 < coverage <= 1:
        raise ValueError(f"coverage must be above 0 and at most 1, got {coverage}")
    wanted = Fraction(repr(float(coverage)))
    enough = [point for point in curve if point.n_covered >= wanted * point.n_votes]
    return enough[-1] if enough else curve[0]
