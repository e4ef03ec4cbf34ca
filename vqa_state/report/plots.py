"""The two pictures of the report, drawn as SVG without a library, so that they print and scale."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from vqa_state.evaluation.cost_frontier import FrontierPoint
from vqa_state.evaluation.coverage import CoveragePoint
from vqa_state.study.frontier_marks import MarkedPoint

__all__ = ["STYLE", "coverage_plot", "frontier_plot"]

STYLE = """
svg { --line: #1f5fbf; --own: #b34700; width: 44rem; height: auto; display: block; }
svg text { fill: currentColor; font-size: 12px; }
svg .axis { stroke: #888; fill: none; }
svg .line { stroke: var(--line); fill: none; }
svg .dot { fill: var(--line); }
svg path.own { stroke: var(--own); stroke-width: 2.5; fill: none; pointer-events: all; }
svg text.own { fill: var(--own); }
@media (prefers-color-scheme: dark) { svg { --line: #7db0ff; --own: #ffb061; } }
@media print { svg { --line: #1f5fbf; --own: #b34700; } }
"""

_WIDTH, _HEIGHT = 700, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 50, 25, 40, 45
_LETTER, _LINE = 6.5, 14  # of a label, in the picture's units
_ROWS = 12  # below its diamond, a label goes at most so many lines down to be alone


@dataclass(frozen=True, slots=True)
class _Mark:
    """A point of the picture, in shares of its axes, and what it says; a label names one's own."""

    x: float
    y: float
    says: str
    label: str = ""

    @property
    def across(self) -> float:
        return _LEFT + self.x * (_WIDTH - _LEFT - _RIGHT)

    @property
    def down(self) -> float:
        return _HEIGHT - _BOTTOM - self.y * (_HEIGHT - _TOP - _BOTTOM)


def frontier_plot(points: Sequence[FrontierPoint], own: Sequence[MarkedPoint]) -> str:
    """Recognized training images against calls: the frontier, and the project's own subsets.

    Args:
        points: from an assessment, the cheapest first.
        own: from `vqa_state.study.frontier_marks.marked_points`.
    """
    if not points:
        return "<p>Not known: the assessment was stopped.</p>"
    n_images = points[0].n_images
    shown = [*points, *(mark.point for mark in own)]
    most_calls = max(point.n_calls for point in shown)
    least = _least([point.n_recognized / n_images for point in shown]) * n_images

    def mark(point: FrontierPoint, says: str, label: str = "") -> _Mark:
        height = (point.n_recognized - least) / (n_images - least)
        return _Mark(point.n_calls / most_calls, height, says, label)

    return _plot(
        [mark(point, point.says) for point in points],
        [mark(one.point, one.says, one.label) for one in own],
        below=("0", "calls a decision", str(most_calls)),
        beside=(f"{least:g}", "recognized training images", str(n_images)),
    )


def coverage_plot(curve: Sequence[CoveragePoint]) -> str:
    """Right verdicts against single votes that give one, out of bag."""
    covered = [point for point in curve if point.n_covered]
    if not covered:
        return "<p>Not known: no training image was ever out of bag.</p>"
    least = _least([point.accuracy for point in covered])
    marks = [
        _Mark(
            point.coverage,
            (point.accuracy - least) / (1 - least),
            f"from sureness {point.min_sureness:.2f}: {point.sentence()}",
        )
        for point in covered
    ]
    return _plot(
        marks,
        [],
        below=("0 %", "votes with a verdict", "100 %"),
        beside=(f"{100 * least:.0f} %", "right verdicts", "100 %"),
    )


def _least(shares: Sequence[float]) -> float:
    """Where the upright axis begins: at one half, what guessing gives, if nothing lies below."""
    return 0.5 if min(shares) >= 0.5 else 0.0


def _plot(
    marks: Sequence[_Mark],
    own: Sequence[_Mark],
    *,
    below: tuple[str, str, str],
    beside: tuple[str, str, str],
) -> str:
    """Points joined by a line, and diamonds of the user's own; each says what it is.

    `below` and `beside` are the lowest value of an axis, its name, and its highest value.
    """
    line = " ".join(f"{mark.across:.1f},{mark.down:.1f}" for mark in marks)
    words = "".join(f"<li>{escape(mark.says)}</li>" for mark in [*own, *marks])
    return (
        f'<div class="wide"><svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'aria-label="{escape(beside[1])} against {escape(below[1])}">'
        f"{_axes(below, beside)}"
        f'<polyline points="{line}" class="line"/>'
        f"{''.join(_dot(mark) for mark in marks)}{''.join(_diamond(mark) for mark in own)}"
        f"{_labels(own)}</svg></div>"
        f"<details><summary>The points in words</summary><ul>{words}</ul></details>"
    )


def _axes(below: tuple[str, str, str], beside: tuple[str, str, str]) -> str:
    left, bottom = _LEFT, _HEIGHT - _BOTTOM
    right, top = _WIDTH - _RIGHT, _TOP

    def text(x: float, y: float, anchor: str, words: str) -> str:
        return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}">{escape(words)}</text>'

    return (
        f'<path d="M{left} {top}V{bottom}H{right}" class="axis"/>'
        + text(left - 5, bottom + 4, "end", beside[0])
        + text(left - 5, top + 4, "end", beside[2])
        + text(left, top - 18, "start", beside[1])
        + text(left, bottom + 16, "middle", below[0])
        + text((left + right) / 2, bottom + 32, "middle", below[1])
        + text(right, bottom + 16, "middle", below[2])
    )


def _dot(mark: _Mark) -> str:
    return (
        f'<circle cx="{mark.across:.1f}" cy="{mark.down:.1f}" r="4" class="dot">'
        f"<title>{escape(mark.says)}</title></circle>"
    )


def _diamond(mark: _Mark) -> str:
    return (
        f'<path d="M{mark.across:.1f} {mark.down - 9:.1f}l9 9l-9 9l-9 -9z" class="own">'
        f"<title>{escape(mark.says)}</title></path>"
    )


def _labels(own: Sequence[_Mark]) -> str:
    """The names below their diamonds, each place named once, further down where two would meet."""
    names: dict[tuple[float, float], list[str]] = {}
    for mark in own:
        names.setdefault((mark.across, mark.down), []).append(mark.label)
    # Left, right and base line of what stands there: first the diamonds, then label by label.
    taken = [(across - 9, across + 9, down + 4) for across, down in names]
    drawn = []
    for (across, down), labels in names.items():
        words = ", ".join(labels)
        width = _LETTER * len(words)
        left = min(max(across - width / 2, _LEFT + 4), _WIDTH - width - 4)
        base = next(
            (
                at
                for row in range(_ROWS)
                if not _meets(left, width, at := down + 22 + row * _LINE, taken)
            ),
            down + 22,
        )
        taken.append((left, left + width, base))
        drawn.append(f'<text x="{left:.1f}" y="{base:.1f}" class="own">{escape(words)}</text>')
    return "".join(drawn)


def _meets(
    left: float, width: float, base: float, taken: Sequence[tuple[float, float, float]]
) -> bool:
    return any(
        left < other_right and other_left < left + width and abs(base - other_base) < _LINE
        for other_left, other_right, other_base in taken
    )
