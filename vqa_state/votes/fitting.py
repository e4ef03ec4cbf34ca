"""Learning each kind of vote from labelled training images, and from nothing else.

*Threshold.* Midway between the mean shares of the two states over the training images. Where the
means stand the wrong way round, one half. (The threshold of the best training accuracy with the
widest gap gained less on new images: docs/decisions/0009-kinds-of-vote.md.)

*Weighted.* Logistic regression with an L2 penalty on one feature a question: the mean verdict of
the copies (an invalid answer counts 0), or twice the mean share for the positive state less one.
Coefficients become whole weights first, the largest `MAX_WEIGHT`; questions whose weight rounds to
0 are not asked. Then the intercept becomes the threshold:

    sum(w v) + b > 0   is   share > (1 - b / sum|w|) / 2,   share as in `vqa_state.votes.rules`.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import positions
from vqa_state.votes.logistic import fit_logistic
from vqa_state.votes.rules import MAX_WEIGHT, MILLION, Ballots, FittedVote, VoteKind

__all__ = ["available_kinds", "fit_vote", "fit_votes"]

_EDGE = 1 / MILLION

_APART = 1e-9
"""Means closer than this are one: floats of equal fractions differ by their order of summing."""


def available_kinds(ballots: Ballots) -> tuple[VoteKind, ...]:
    """The kinds that these answers allow, the simplest first."""
    known = ballots.p_positive is not None
    return tuple(kind for kind in VoteKind if known or kind is not VoteKind.WEIGHTED_P_YES)


def fit_votes(
    ballots: Ballots,
    labels: NDArray[np.int8],
    subset: Sequence[int],
    groups: NDArray[np.int64] | None = None,
) -> dict[VoteKind, FittedVote]:
    """A vote of every available kind, the simplest first; arguments as in `fit_vote`."""
    kinds = available_kinds(ballots)
    return {kind: fit_vote(kind, ballots, labels, subset, groups) for kind in kinds}


def fit_vote(
    kind: VoteKind,
    ballots: Ballots,
    labels: NDArray[np.int8],
    subset: Sequence[int],
    groups: NDArray[np.int64] | None = None,
) -> FittedVote:
    """Learn a vote. The same arguments give the same vote.

    Args:
        kind: what to learn.
        ballots: the training images' answers to all questions.
        labels: their states, +1 or -1, (n_images,), both present.
        subset: questions that the search chose. The weighted kinds choose their own from all.
        groups: number of the group of look-alikes of each image, (n_images,); they stay together
            in cross-validation. Without it, every image is a group of its own.

    Raises:
        ValueError: if the labels do not fit or lack a state, or the subset is empty or not one.
    """
    if labels.shape != (ballots.n_images,) or set(labels.tolist()) != {1, -1}:
        raise ValueError(f"need {ballots.n_images} labels of +1 and -1, both present; got {labels}")
    if kind.weighted:
        return _weighted(kind, ballots, labels, groups)
    chosen = tuple(sorted(positions(subset, ballots.n_questions).tolist()))
    plain = _equal(kind, chosen)
    if kind is VoteKind.PAPER:
        return plain
    return _equal(kind, chosen, _between(plain.shares(ballots), labels))


def _between(shares: NDArray[np.float64], labels: NDArray[np.int8]) -> float:
    """The threshold midway between the states' mean shares; images without a vote say nothing."""
    states = [shares[(labels == state) & ~np.isnan(shares)] for state in (1, -1)]
    if any(state.size == 0 for state in states):
        return 0.5
    positive, negative = (float(state.mean()) for state in states)
    return _rounded((positive + negative) / 2) if positive - negative > _APART else 0.5


def _weighted(
    kind: VoteKind,
    ballots: Ballots,
    labels: NDArray[np.int8],
    groups: NDArray[np.int64] | None,
) -> FittedVote:
    groups = np.arange(ballots.n_images) if groups is None else groups
    fit = fit_logistic(_features(kind, ballots), labels, groups)
    largest = float(np.abs(fit.coefficients).max(initial=0))
    if largest == 0:  # no answer differs between images: nothing to learn from
        return _equal(kind, tuple(range(ballots.n_questions)))
    whole = np.rint(fit.coefficients * (MAX_WEIGHT / largest)).astype(np.int64)
    used = np.flatnonzero(whole)
    intercept = fit.intercept * (MAX_WEIGHT / largest)
    return FittedVote(
        kind=kind,
        questions=tuple(used.tolist()),
        weights=tuple(np.abs(whole[used]).tolist()),
        flipped=tuple((whole[used] < 0).tolist()),
        threshold=_rounded((1 - intercept / int(np.abs(whole).sum())) / 2),
    )


def _features(kind: VoteKind, ballots: Ballots) -> NDArray[np.float64]:
    """(n_images, n_questions) in [-1, 1]."""
    if kind is VoteKind.WEIGHTED_ANSWERS:
        return (ballots.positive - ballots.negative) / ballots.n_copies
    if ballots.p_positive is None:
        raise ValueError("a vote by p_yes needs the model's own share for every answer")
    return 2 * ballots.p_positive / (MILLION * ballots.n_copies) - 1


def _equal(kind: VoteKind, questions: tuple[int, ...], threshold: float = 0.5) -> FittedVote:
    n_used = len(questions)
    return FittedVote(kind, questions, (1,) * n_used, (False,) * n_used, threshold)


def _rounded(threshold: float) -> float:
    return round(min(max(threshold, _EDGE), 1 - _EDGE), 6)
