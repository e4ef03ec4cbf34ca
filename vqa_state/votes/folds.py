"""Folds for cross-validation: both states in each, near-duplicates together."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["strata", "stratified_folds"]


def strata(labels: NDArray[np.int8], groups: NDArray[np.int64]) -> list[list[int]]:
    """Groups with images of the positive state alone, of both, and of the negative one alone.

    Args:
        labels: +1 or -1, (n_images,).
        groups: number of the group of near-duplicates of each image, (n_images,).

    Returns:
        Three lists of group numbers, each in the order of the images.
    """
    found: tuple[list[int], list[int], list[int]] = ([], [], [])
    for group in dict.fromkeys(groups.tolist()):
        states = set(labels[groups == group].tolist())
        found[1 if len(states) > 1 else 0 if 1 in states else 2].append(group)
    return list(found)


def stratified_folds(
    labels: NDArray[np.int8], groups: NDArray[np.int64], n_folds: int
) -> NDArray[np.int64]:
    """Number of each image's fold, (n_images,), from 0.

    Groups are dealt out in turns, those of one state after those of the other. There are fewer
    folds than asked for if a state has fewer groups; a single one leaves nothing to validate.
    """
    positive, both, negative = strata(labels, groups)
    fewest = min(len(positive) + len(both), len(both) + len(negative))
    n_folds = max(1, min(n_folds, fewest))
    fold_of = {group: turn % n_folds for turn, group in enumerate([*positive, *both, *negative])}
    return np.array([fold_of[group] for group in groups.tolist()], dtype=np.int64)
