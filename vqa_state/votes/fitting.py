"""Learning each kind of vote from labelled training images, and from nothing else."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import positions
from vqa_state.votes.rules import Ballots, FittedVote, VoteKind

__all__ = ["available_kinds", "fit_vote", "fit_votes"]


def available_kinds(ballots: Ballots) -> tuple[VoteKind, ...]:
    """The kinds that these answers allow, the simplest first."""
    known = ballots.p_positive is not None
    return tuple(kind for kind in VoteKind if known or not kind.by_p_yes)


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
        groups: number of each image's group of near-duplicates, (n_images,); they stay together in
            cross-validation. Without it, every image is a group of its own.

    Raises:
        ValueError: if the labels do not fit or lack a state, or the subset is empty or not one.
    """
    if labels.shape != (ballots.n_images,) or set(labels.tolist()) != {1, -1}:
        raise ValueError(f"need {ballots.n_images} labels of +1 and -1, both present; got {labels}")
    chosen = tuple(sorted(positions(subset, ballots.n_questions).tolist()))
    groups = np.arange(ballots.n_images) if groups is None else groups
    learned = kind.rule.fit(ballots, labels, chosen, groups)
    return FittedVote(
        kind=kind,
        questions=learned.questions,
        weights=tuple(abs(weight) for weight in learned.weights),
        flipped=tuple(weight < 0 for weight in learned.weights),
        threshold=learned.threshold,
    )
