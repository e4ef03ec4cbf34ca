"""Train / test split: stratified, seeded, look-alikes on one side.

A test image that is nearly a training image would let the test say what training knows already.
"""

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum

__all__ = [
    "Split",
    "astride",
    "divide",
]


class Split(StrEnum):
    """What an image is for. Test images never influence a choice."""

    TRAIN = "train"
    TEST = "test"
    UNUSED = "unused"


def divide(
    labels: Mapping[str, int],
    groups: Iterable[Sequence[str]],
    fixed: Mapping[str, Split],
    *,
    train_share: float,
    seed: int,
) -> dict[str, Split]:
    """Give every labelled image without a side one of train and test.

    Each state is divided by `train_share` on its own; a group goes to one side as a whole, to
    that of its members which have one already. The order of the images does not matter.

    A state needs both sides. Where all images of one look alike (a camera that never moves), its
    groups are divided after all; `astride` finds them, so that the user can be told.

    Args:
        labels: +1 or -1 of each id to divide or already divided.
        groups: look-alikes; ids that are not in `labels` are passed over.
        fixed: sides that stay as they are.
        train_share: in (0, 1).
        seed: another seed gives another division.

    Raises:
        ValueError: if `train_share` is not between 0 and 1.
    """
    if not 0.0 < train_share < 1.0:
        raise ValueError(f"the share of training images must be between 0 and 1, got {train_share}")
    unused = {i for i, side in fixed.items() if side is Split.UNUSED}
    used = {i: label for i, label in labels.items() if i not in unused}
    taken = {i: side for i, side in fixed.items() if i in used}
    whole = [tuple(sorted(i for i in group if i in used)) for group in groups]
    sides = _assign(used, whole, taken, train_share, seed)
    one_sided = _one_sided_states(used, sides)
    if one_sided:
        kept = [group for group in whole if not one_sided & {used[i] for i in group}]
        sides = _assign(used, kept, taken, train_share, seed)
    return sides


def astride(groups: Iterable[Sequence[str]], sides: Mapping[str, Split]) -> list[Sequence[str]]:
    """The groups with images on both sides: there, the test repeats what training saw."""
    both = {Split.TRAIN, Split.TEST}
    return [group for group in groups if both <= {sides.get(i) for i in group}]


def _assign(
    labels: Mapping[str, int],
    groups: Iterable[Sequence[str]],
    taken: Mapping[str, Split],
    train_share: float,
    seed: int,
) -> dict[str, Split]:
    sides, filled = dict(taken), _Filled(labels, taken, train_share)
    for unit in _units(labels, groups, seed):
        free = [i for i in unit if i not in taken]
        before = {taken[i] for i in unit if i in taken}
        if len(before) > 1:  # the user or an earlier division put it on both sides
            for image_id in free:
                sides[image_id] = filled.put([image_id])
        elif free:
            sides.update(dict.fromkeys(free, filled.put(free, before.pop() if before else None)))
    return sides


def _one_sided_states(labels: Mapping[str, int], sides: Mapping[str, Split]) -> set[int]:
    """States with two images or more, all of them on one side."""
    of_state = {state: [i for i in labels if labels[i] == state] for state in (1, -1)}
    return {
        state
        for state, ids in of_state.items()
        if len(ids) > 1 and len({sides[i] for i in ids}) < 2
    }


def _units(
    labels: Mapping[str, int], groups: Iterable[Sequence[str]], seed: int
) -> list[tuple[str, ...]]:
    """Groups and single images, the largest first, else in an order that only the seed decides."""
    units = [tuple(group) for group in groups if group]
    alone = set(labels).difference(*units)
    units += [(image_id,) for image_id in alone]
    return sorted(units, key=lambda unit: (-len(unit), _shuffled(unit[0], seed)))


def _shuffled(image_id: str, seed: int) -> bytes:
    return hashlib.sha256(f"{seed}:{image_id}".encode()).digest()


class _Filled:
    """How many images of each state stand on each side."""

    def __init__(
        self, labels: Mapping[str, int], sides: Mapping[str, Split], train_share: float
    ) -> None:
        self._labels = labels
        self._shares = {Split.TRAIN: train_share, Split.TEST: 1 - train_share}
        self._counts = Counter((side, labels[i]) for i, side in sides.items())

    def put(self, unit: Sequence[str], side: Split | None = None) -> Split:
        """Count a unit on a side, by default on the emptier one, and say on which."""
        states = [self._labels[i] for i in unit]
        chosen = side or self._emptier(set(states))
        self._counts.update((chosen, state) for state in states)
        return chosen

    def _emptier(self, states: set[int]) -> Split:
        """The side on which these states are furthest below their share; train on a tie."""

        def fill(side: Split) -> float:
            return sum(self._counts[side, state] for state in states) / self._shares[side]

        return min(self._shares, key=fill)
