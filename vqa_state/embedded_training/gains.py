"""What the search gains, and the groups' means, with intervals over tasks and over pictures."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from vqa_state.embedded_training.intervals import mean_interval, resampled, spread
from vqa_state.embedded_training.measuring import WAYS, TaskNumbers

__all__ = ["COMPARISONS", "summarise_gains", "summarise_groups"]

#: Name -> (a way of choosing questions, the way that it is compared with).
COMPARISONS: Mapping[str, tuple[str, str]] = {
    "over_all": ("s_plus", "s_all"),
    "over_single": ("s_plus", "single"),
    "random_over_all": ("s_plus_random", "s_all"),
    "random_over_single": ("s_plus_random", "single"),
}


def summarise_gains(rows: Sequence[TaskNumbers]) -> dict[str, Any]:
    """Mean gains on scenes and foreign tasks together, paired, with 95 % intervals."""
    used = [row for row in rows if row.group in ("scenes", "foreign") and row.s_plus is not None]
    return {name: _mean(used, *ways) for name, ways in COMPARISONS.items()}


def summarise_groups(rows: Sequence[TaskNumbers]) -> dict[str, Any]:
    """Of each group: its tasks with a search, means of all ways, and gains, with intervals."""
    groups = {}
    for group in dict.fromkeys(row.group for row in rows):
        used = [row for row in rows if row.group == group and row.s_plus is not None]
        if used:
            groups[group] = {
                "tasks": [row.name for row in used],
                "means": {way: _mean(used, way) for way in WAYS},
                "gains": {name: _mean(used, *ways) for name, ways in COMPARISONS.items()},
            }
    return groups


def _mean(rows: Sequence[TaskNumbers], way: str, minus: str | None = None) -> dict[str, Any]:
    """Mean over tasks of a balanced accuracy or of a difference of two.

    "tasks" treats the tasks as a sample of tasks; None where they are too few. "pictures" keeps
    the tasks and draws their pictures anew.
    """
    tallies = [row.tally for row in rows]
    values = [tally.balanced(way, minus) for tally in tallies]
    return {
        "n_tasks": len(rows),
        "n_pictures": sum(row.n_positive + row.n_negative for row in rows),
        "mean": round(math.fsum(values) / len(values), 4),
        "tasks": mean_interval(values),
        "pictures": spread(resampled(tallies, way, minus)),
    }
