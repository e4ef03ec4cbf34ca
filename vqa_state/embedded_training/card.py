"""The measured parts of docs/embedded_model.md, made from docs/embedded_model.json.

Their text stands in two templates beside this file, one for the tables and one for a list of where
the model fails. Numbers and what depends on them are filled in, so no word drifts from the figures.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from vqa_state.embedded_training.gains import COMPARISONS
from vqa_state.embedded_training.intervals import Tally, resampled, spread

__all__ = ["MARKS", "failures", "points", "tables", "with_tables"]

#: What stands between such a pair of lines of the card is written by `evaluate`.
MARKS: Mapping[str, tuple[str, str]] = {
    part: (f"<!-- {part}: begin -->", f"<!-- {part}: end -->") for part in ("measured", "failures")
}

#: A grid that calls this much more or less than half of the pictures positive leans.
_LEAN = 0.1

#: Pairs of a false premise that are refused less often than this are named.
_SELDOM = 0.5

_GROUP_NAMES = {
    "scenes": "scenes of the measuring split",
    "foreign": "other people's simulators",
    "photos": "photos, the measuring half",
}
_WAY_HEADS = {
    "s_plus": "**s+**",
    "s_plus_random": "s+, random start",
    "s_plus_grid": "s+ in the grid only",
    "s_all": "s_all, the grid",
    "all_questions": "grid and cues, all",
    "single": "best single",
}
_WAY_NAMES = {"s_plus": "s+", "s_plus_random": "s+ from a random start"}

_Row = Mapping[str, Any]


def with_tables(card: str, numbers: Mapping[str, Any]) -> str:
    """The card with its measured parts replaced.

    Raises:
        ValueError: if the card lacks one of the marks.
    """
    for part, write in (("measured", tables), ("failures", failures)):
        begin, end = MARKS[part]
        before, found_begin, rest = card.partition(begin)
        _, found_end, after = rest.partition(end)
        if not found_begin or not found_end:
            raise ValueError(f"the card must hold {begin!r} and {end!r}")
        card = f"{before}{begin}\n{write(numbers)}\n{end}{after}"
    return card


def tables(numbers: Mapping[str, Any]) -> str:
    """All tables and the facts about the file, as Markdown."""
    return _fill(
        "card_measured.md.jinja",
        numbers,
        ways=_WAY_HEADS.keys(),
        way_heads=_WAY_HEADS.values(),
        way_names=_WAY_NAMES,
        comparisons=COMPARISONS,
        searched=_searched(numbers["tasks"]),
        noun_means=[_mean_of_nouns(numbers["nouns"], is_new) for is_new in (True, False)],
        premise_things=_things_asked_about(numbers["premises"]),
    )


def failures(numbers: Mapping[str, Any]) -> str:
    """A list of where the model fails, as Markdown."""
    tasks, searched = numbers["tasks"], _searched(numbers["tasks"])
    pairs = sorted(
        (share, row["shown"].replace("_", " "), asked.replace("_", " "))
        for row in numbers["premises"]
        for asked, share in row["refused"].items()
    )
    photos = searched.get("photos", [])
    calibration = numbers["calibration"]
    return _fill(
        "card_failures.md.jinja",
        numbers,
        leans={"positive": _leaning(tasks, True), "negative": _leaning(tasks, False)},
        distances={group: _distances(rows) for group, rows in searched.items()},
        worst_calibrated=max(calibration, key=lambda group: float(calibration[group]["error"])),
        photos=[(row, _gain_interval(row)) for row in photos],
        all_was_better=all(row["s_plus"] < row["s_all"] for row in photos),
        pairs=pairs,
        mean_refused=sum(share for share, _, _ in pairs) / len(pairs),
        seldom_refused=[pair for pair in pairs if pair[0] < _SELDOM],
    )


def _fill(template: str, numbers: Mapping[str, Any], **derived: Any) -> str:
    """A template filled with the measured numbers and with what was derived from them."""
    environment = Environment(
        loader=PackageLoader(__package__, ""),
        autoescape=select_autoescape(),  # Markdown is not escaped
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.filters |= {
        "gain": _gain,
        "minutes": lambda seconds: f"{int(seconds) / 60:.0f}",
        "percent": _percent,
        "points": points,
        "span": _span,
        "task": lambda row: f"{row['group']}: {_words(row['name'])}",
        "verb": _verb,
        "with_intervals": _with_intervals,
        "words": _words,
    }
    filled = environment.get_template(template).render(numbers, group_names=_GROUP_NAMES, **derived)
    return filled.strip()


def points(value: float) -> str:
    """A difference in points of a percent, with its sign."""
    rounded = round(100 * value, 1)
    return f"{'−' if rounded < 0 else '+' if rounded > 0 else ''}{abs(rounded):.1f}"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"


def _span(ends: Sequence[float] | None) -> str:
    return "unknown (too few)" if ends is None else f"{points(ends[0])} to {points(ends[1])}"


def _gain(gain: _Row) -> str:
    return (
        f"{points(gain['mean'])} points; over {gain['n_tasks']} tasks {_span(gain['tasks'])}, over "
        f"{gain['n_pictures']} pictures {_span(gain['pictures'])}"
    )


def _with_intervals(value: float | None, *intervals: Sequence[float] | None) -> str:
    """A share in percent with its intervals, which do not reach beyond 0 and 100."""
    if value is None:
        return "–"
    spans = (
        "–" if ends is None else f"{100 * max(ends[0], 0.0):.0f}–{100 * min(ends[1], 1.0):.0f}"
        for ends in intervals
    )
    return f"{100 * value:.1f} ({'; '.join(spans)})"


def _verb(gain: _Row) -> str:
    """A word for the sign, and whether luck of the pictures or of the tasks might explain it."""
    if round(gain["mean"], 3) == 0:
        return "neither gains nor loses"
    ends = [gain["pictures"], *([] if gain["tasks"] is None else [gain["tasks"]])]
    sure = all(low > 0 or high < 0 for low, high in ends)
    return f"{'gains' if gain['mean'] > 0 else 'loses'}{'' if sure else ', perhaps by chance,'}"


def _searched(tasks: Sequence[_Row]) -> dict[str, list[_Row]]:
    """The tasks with a search of each group that has some."""
    found = {
        group: [row for row in tasks if row["group"] == group and row["s_plus"] is not None]
        for group in _GROUP_NAMES
    }
    return {group: rows for group, rows in found.items() if rows}


def _leaning(tasks: Sequence[_Row], positive: bool) -> list[tuple[float, _Row]]:
    """Tasks whose grid calls too many pictures positive (or negative), and how many."""
    shares = [
        (row["called_positive"] if positive else 1 - row["called_positive"], row) for row in tasks
    ]
    return sorted((pair for pair in shares if pair[0] > 0.5 + _LEAN), key=lambda pair: -pair[0])


def _distances(rows: Sequence[_Row]) -> tuple[float, ...]:
    """The number of tasks, then how far the share called positive is from half, in points.

    For the grid, the search from a random start, and our search.
    """
    tallies = [Tally(**row["tally"]) for row in rows]
    far = (
        100 * sum(abs(tally.called_positive(way) - 0.5) for tally in tallies) / len(tallies)
        for way in ("s_all", "s_plus_random", "s_plus")
    )
    return (len(tallies), *far)


def _gain_interval(row: _Row) -> list[float]:
    """Interval over pictures of what s+ gains against the whole grid on one task."""
    return spread(resampled([Tally(**row["tally"])], "s_plus", "s_all"))


def _mean_of_nouns(rows: Sequence[_Row], is_new: bool) -> float:
    fitting = [float(row["balanced"]) for row in rows if row["is_new"] == is_new]
    return sum(fitting) / max(1, len(fitting))


def _things_asked_about(rows: Sequence[_Row]) -> list[str]:
    return list(dict.fromkeys(asked for row in rows for asked in row["refused"]))
