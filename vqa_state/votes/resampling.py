"""Bootstrap resamples of labelled images: both states, near-duplicates together."""

import numpy as np
from numpy.typing import NDArray

from vqa_state.votes.folds import strata

__all__ = ["divisible", "draw_resample"]


def divisible(labels: NDArray[np.int8], groups: NDArray[np.int64]) -> NDArray[np.int64]:
    """The groups, but those of a state that has only one are parted into single images."""
    kept = groups.copy()
    for state in (1, -1):
        own = np.unique(kept[labels == state])
        if own.size == 1:
            parted = np.flatnonzero(kept == own[0])
            kept[parted] = kept.max() + 1 + np.arange(parted.size)
    return kept


def draw_resample(
    labels: NDArray[np.int8], groups: NDArray[np.int64], rng: np.random.Generator
) -> NDArray[np.intp]:
    """Images of a resample: groups drawn with replacement, so many of each stratum as it has.

    A resample must hold both states; where mixed groups leave that to chance, it is drawn again.
    """
    members = {group: np.flatnonzero(groups == group) for group in np.unique(groups).tolist()}
    pools = _pools(labels, groups)
    while True:
        chosen = [group for pool in pools for group in rng.choice(pool, size=len(pool)).tolist()]
        drawn = np.concatenate([members[group] for group in chosen])
        if np.unique(labels[drawn]).size == 2 and np.unique(drawn).size < labels.size:
            return drawn


def _pools(labels: NDArray[np.int8], groups: NDArray[np.int64]) -> list[list[int]]:
    """Strata to draw from. A stratum of one group would never be out, so it joins another."""
    positive, both, negative = strata(labels, groups)
    if len(both) == 1:
        min(positive, negative, key=len).append(both.pop())
    if 1 in (len(positive), len(negative)):
        return [[*positive, *both, *negative]]
    return [pool for pool in (positive, both, negative) if pool]
