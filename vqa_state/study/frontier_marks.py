"""Where a project's own subsets stand beside the frontier: what was searched, and the baselines.

Like the frontier, they are judged by training images only, so showing them is no look at the test.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vqa_state.answers.rates import count
from vqa_state.evaluation.cost_frontier import FrontierPoint, point_of
from vqa_state.evaluation.held_out import Baseline
from vqa_state.project.searches import Results

__all__ = ["MarkedPoint", "cheaper_sentence", "marked_points"]

_UNMARKED = (Baseline.S_DOES, Baseline.S_IS)


@dataclass(frozen=True, slots=True)
class MarkedPoint:
    """One subset with the names that it has.

    Attributes:
        names: of all candidates with this very subset, as in the table of recognizers.
        point: its questions, its calls, and what it recognizes on the training images.
    """

    names: tuple[str, ...]
    point: FrontierPoint

    @property
    def label(self) -> str:
        """Its names in a few letters."""
        return ", ".join(self.names)

    @property
    def says(self) -> str:
        """What it is, in one line."""
        return f"{self.label}: {self.point.says}"


def marked_points(found: Results) -> tuple[MarkedPoint, ...]:
    """The four searches' subsets, all questions and the best single one, the cheapest first.

    They need not lie on the frontier, and one that was proved may lie above it, for the frontier is
    the best that was found.

    Args:
        found: a project's present results.
    """
    subsets: dict[tuple[int, ...], list[str]] = {}
    for row in found.evaluation.rows:
        if row.name not in _UNMARKED:
            subsets.setdefault(tuple(sorted(row.subset)), []).append(row.name.value)
    return _placed(found, subsets)


def cheaper_sentence(marks: Sequence[MarkedPoint], chosen: str) -> str:
    """Whether a cheaper one of the marked subsets recognizes as many; "" if none does.

    Args:
        marks: from `marked_points`.
        chosen: a name among them.
    """
    own = next(mark.point for mark in marks if chosen in mark.names)
    for mark in marks:  # the cheapest first
        point, more = mark.point, mark.point.n_recognized - own.n_recognized
        if point.n_calls < own.n_calls and more >= 0:
            plural = "" if point.n_questions == 1 else "s"
            what = f"as many training images as {chosen}" if more == 0 else f"{more} more"
            return (
                f"{mark.names[0]} recognizes {what} with {point.n_questions} question{plural} "
                f"instead of {own.n_questions}."
            )
    return ""


def _placed(
    found: Results, subsets: Mapping[tuple[int, ...], list[str]]
) -> tuple[MarkedPoint, ...]:
    counts = count(found.train)
    marks = [MarkedPoint(tuple(n), point_of(counts, subset)) for subset, n in subsets.items()]
    return tuple(sorted(marks, key=lambda mark: mark.point.n_calls))
