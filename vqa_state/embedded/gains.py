"""What the search gains, with intervals over tasks and over pictures."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from vqa_state.embedded.measuring import TaskNumbers

__all__ = ["summarise_gains"]

_CONFIDENCE = 0.95


def summarise_gains(rows: Sequence[TaskNumbers]) -> dict[str, Any]:
    """Mean gain of s+ on scenes and foreign tasks together, paired, with 95 % intervals.

    "tasks" treats the tasks as a sample of tasks (t interval of their mean differences of balanced
    accuracies); "pictures" treats the tested pictures as a sample (normal interval of the mean over
    pictures, each one's gain averaged over the draws in which it was tested).
    """
    used = [row for row in rows if row.group in ("scenes", "foreign")]
    over_all = [row.s_plus - row.s_all for row in used if row.s_plus is not None]
    over_single = [
        row.s_plus - row.single for row in used if row.s_plus is not None and row.single is not None
    ]
    return {
        "over_all": {
            "tasks": _t_interval(over_all),
            "pictures": _t_interval([gain for row in used for gain in row.gain_over_all]),
        },
        "over_single": {
            "tasks": _t_interval(over_single),
            "pictures": _t_interval([gain for row in used for gain in row.gain_over_single]),
        },
    }


def _t_interval(values: Sequence[float]) -> dict[str, float | int]:
    """Mean and its two-sided 95 % interval; n is how many values."""
    n = len(values)
    mean = math.fsum(values) / n
    error = float(np.std(values, ddof=1)) / math.sqrt(n)
    reach = float(stats.t.ppf((1 + _CONFIDENCE) / 2, n - 1)) * error
    return {
        "n": n,
        "mean": round(mean, 4),
        "low": round(mean - reach, 4),
        "high": round(mean + reach, 4),
    }
