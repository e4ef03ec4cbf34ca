"""What accuracy costs, as plain values for the trade chart: calls, or images without a verdict."""

from collections.abc import Sequence
from typing import Any

from vqa_state.evaluation.cost_frontier import FrontierPoint
from vqa_state.evaluation.coverage import CoveragePoint
from vqa_state.study.frontier_marks import MarkedPoint

__all__ = ["coverage_value", "frontier_value"]

Value = dict[str, Any]

MAX_POINTS = 30
"""Of a curve; more could not be hit by a finger."""


def frontier_value(
    points: Sequence[FrontierPoint], marks: Sequence[MarkedPoint], texts: Sequence[str]
) -> Value:
    """Recognized training images against calls; a point unfolds its questions.

    Args:
        points: from an assessment, cheapest first.
        marks: subsets that have a name, to be seen beside them.
        texts: of all questions, by their position.
    """
    if not points:
        return {"empty": "Assess first, to the end."}
    dearest = max(points[-1].n_calls, *(one.point.n_calls for one in marks))
    found = [_frontier_point(point, f"at best {point.says}", texts) for point in points]
    named = [_frontier_point(one.point, one.says, texts) | {"marked": True} for one in marks]
    return {
        "x": "calls a decision",
        "y": "recognized training images",
        "x_range": [0, dearest],
        "y_range": [0, points[0].n_images],
        "points": sorted(named + found, key=lambda point: point["x"]),
    }


def _frontier_point(point: FrontierPoint, says: str, texts: Sequence[str]) -> Value:
    return {
        "x": point.n_calls,
        "y": point.n_recognized,
        "says": says,
        "lines": [texts[position] for position in point.subset],
    }


def coverage_value(curve: Sequence[CoveragePoint]) -> Value:
    """Accuracy of the verdicts against the share of images that get one, in percent."""
    covered = [point for point in curve if point.n_covered]
    step = max(1, len(covered) // MAX_POINTS)
    points = [_coverage_point(point) for point in (*covered[:-1:step], *covered[-1:])]
    if not points:
        return {"empty": "Assess first; it needs training images that were out of bag."}
    return {
        "x": "votes with a verdict, %",
        "y": "right verdicts, %",
        "x_range": [0, 100],
        "y_range": [0, 100],
        "points": points[::-1],
    }


def _coverage_point(point: CoveragePoint) -> Value:
    low, high = point.interval.low * 100, point.interval.high * 100
    return {
        "x": point.coverage * 100,
        "y": point.accuracy * 100,
        "low": low,
        "high": high,
        "says": f"{point.sentence()}; unknown below a sureness of {point.min_sureness:.2f}",
        "lines": [],
    }
