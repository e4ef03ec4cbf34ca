"""The measured parts of docs/embedded_model.md, made from docs/embedded_model.json."""

from collections.abc import Mapping, Sequence
from typing import Any

from vqa_state.embedded_training.card_words import (
    GROUPS,
    failures,
    name_of,
    percent,
    points,
    short_name,
)
from vqa_state.embedded_training.gains import COMPARISONS
from vqa_state.embedded_training.measuring import WAYS

__all__ = ["MARKS", "tables", "with_tables"]

#: What stands between such a pair of lines of the card is written by `evaluate`.
MARKS: Mapping[str, tuple[str, str]] = {
    part: (f"<!-- {part}: begin -->", f"<!-- {part}: end -->") for part in ("measured", "failures")
}

_Row = Mapping[str, Any]

_WAYS = {
    "s_plus": "**s+**",
    "s_plus_random": "s+, random start",
    "s_plus_grid": "s+ in the grid only",
    "s_all": "s_all, the grid",
    "all_questions": "grid and cues, all",
    "single": "best single",
}
_IN_WORDS = {"s_plus": "s+", "s_plus_random": "s+ from a random start", "single": "best single"}


def tables(numbers: Mapping[str, Any]) -> str:
    """All tables and the facts about the file, as Markdown."""
    parts = [
        _facts(numbers["file"], numbers["speed"]),
        _accuracies(numbers["tasks"]),
        _means(numbers["groups"]),
        _worst(numbers["tasks"]),
        _gains(numbers["gains"]),
        _group_gains(numbers["groups"]),
        _spread(numbers["tasks"]),
        _calibration(numbers["calibration"]),
        _nouns(numbers["nouns"]),
        _premises(numbers["premises"]),
    ]
    return "\n\n".join(parts)


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


def _facts(file: _Row, speed: _Row | None) -> str:
    training = file["training"]
    return (
        f"Training: seed {training['seed']}, {training['scenes']} rendered pictures, "
        f"{training['simulators']} of a foreign simulator, {training['photos']} variations of "
        f"photos, {training['epochs']} epochs. {_training_time(training)} Weights: "
        f"{file['megabytes']} MB, {file['parameters']:,} parameters in float16, SHA-256 starts "
        f"with `{file['digest']}`. 120 pictures with 64 questions each: {_speed(speed)}."
    )


def _training_time(training: _Row) -> str:
    if "seconds" not in training:
        return "Training time: not recorded for the shipped weights."
    stages, before = (int(training[key]) / 60 for key in ("seconds", "seconds_before"))
    return f"Training time: {stages:.0f} minutes, after {before:.0f} for scenes and features."


def _speed(speed: _Row | None) -> str:
    if speed is None:
        return "not measured"
    return (
        f"{speed['seconds_120x64']} s on {speed['threads']} processor threads of an idle machine "
        f"({speed['date']})"
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _accuracies(tasks: Sequence[_Row]) -> str:
    head = ("task", "pictures", *_WAYS.values(), "called positive", "invalid", "questions used")
    rows = [
        (
            name_of(row),
            f"{row['n_positive']} + {row['n_negative']}",
            *(_with_interval(row[way], row["intervals"].get(way)) for way in _WAYS),
            percent(row["called_positive"]),
            percent(row["invalid"]),
            "–" if row["n_used"] is None else f"{row['n_used']:.0f} of {row['n_questions']}",
        )
        for row in tasks
    ]
    title = (
        "Accuracies in percent; in brackets 95 % intervals over pictures (Wilson's for each state, "
        "put together; a picture counts once however many draws tested it):"
    )
    return f"{title}\n\n{_table(head, rows)}"


def _with_interval(value: float | None, *intervals: Sequence[float] | None) -> str:
    if value is None:
        return "–"
    inside = "; ".join(
        "–" if ends is None else f"{_ends(ends[0], 0.0)}–{_ends(ends[1], 1.0)}"
        for ends in intervals
    )
    return f"{100 * value:.1f} ({inside})"


def _ends(value: float, limit: float) -> str:
    """An end of an interval in percent, not beyond 0 or 100."""
    return f"{100 * (max(value, limit) if limit == 0 else min(value, limit)):.0f}"


def _means(groups: Mapping[str, _Row]) -> str:
    head = ("mean over", *(_WAYS[way] for way in WAYS))
    rows = [
        (
            f"{GROUPS[group]}, {len(one['tasks'])} tasks",
            *(
                _with_interval(mean["mean"], mean["tasks"], mean["pictures"])
                for mean in (one["means"][way] for way in WAYS)
            ),
        )
        for group, one in groups.items()
    ]
    title = (
        "Means in percent; in brackets 95 % intervals, first over tasks (Student's t; – where "
        "fewer than three tasks were searched), then over the pictures of these tasks (bootstrap):"
    )
    return f"{title}\n\n{_table(head, rows)}"


def _worst(tasks: Sequence[_Row]) -> str:
    found = []
    for group, words in GROUPS.items():
        rows = [row for row in tasks if row["group"] == group and row["s_plus"] is not None]
        if rows:
            worst = min(rows, key=lambda row: float(row["s_plus"]))
            found.append(f"of {words} {short_name(worst)} ({percent(worst['s_plus'])})")
    return f"The worst with s+: {', '.join(found)}."


def _gains(gains: Mapping[str, _Row]) -> str:
    lines = [
        "What the search gains on scenes and foreign tasks together (95 % intervals, paired):",
        "",
    ]
    for key, one in gains.items():
        way, other = COMPARISONS[key]
        against = "s_all of the grid" if other == "s_all" else "the best single"
        lines.append(
            f"- {_IN_WORDS[way]} against {against}: {points(one['mean'])} points; over "
            f"{one['n_tasks']} tasks {_from_to(one['tasks'])}, over {one['n_pictures']} pictures "
            f"{_from_to(one['pictures'])}"
        )
    return "\n".join(lines)


def _group_gains(groups: Mapping[str, _Row]) -> str:
    lines = ["The same for each group apart, against s_all:", ""]
    for group, one in groups.items():
        for key in ("over_all", "random_over_all"):
            gain = one["gains"][key]
            lines.append(
                f"- {GROUPS[group]}, {_IN_WORDS[COMPARISONS[key][0]]}: {points(gain['mean'])} "
                f"points; over {gain['n_tasks']} tasks {_from_to(gain['tasks'])}, over "
                f"{gain['n_pictures']} pictures {_from_to(gain['pictures'])}"
            )
    return "\n".join(lines)


def _from_to(ends: Sequence[float] | None) -> str:
    return "unknown (too few)" if ends is None else f"{points(ends[0])} to {points(ends[1])}"


def _spread(tasks: Sequence[_Row]) -> str:
    head = ("task", "worst single", "median", "best", "standard deviation")
    keys = ("single_min", "single_median", "single_max", "single_sd")
    rows = [(name_of(row), *(f"{row[key]:.3f}" for key in keys)) for row in tasks]
    return "Accuracy of single questions among their valid answers:\n\n" + _table(head, rows)


def _calibration(groups: Mapping[str, _Row]) -> str:
    lines = ["Stated probability of the positive state against what was so (expected error):", ""]
    for group, one in groups.items():
        curve = ", ".join(f"{mean:.2f} → {share:.2f}" for n, mean, share in one["bins"] if n)
        lines.append(f"- {GROUPS[group]}: error {one['error']:.3f}; {curve}")
    return "\n".join(lines)


def _nouns(rows: Sequence[_Row]) -> str:
    """Nouns that share a word with a taught one beside wholly new ones."""
    head = ("thing", "wholly new nouns", "recognized", "nouns with a taught word", "recognized")
    cells = []
    for thing in dict.fromkeys(row["thing"] for row in rows):
        line = [thing.replace("_", " ")]
        for is_new in (True, False):
            fitting = [r for r in rows if r["thing"] == thing and r["is_new"] == is_new]
            words = [
                (", ".join(r["nouns"]), _with_interval(r["balanced"], r["interval"]))
                for r in fitting
            ]
            line += words[0] if words else ("none", "–")
        cells.append(line)
    means = [
        sum(r["balanced"] for r in rows if r["is_new"] == is_new)
        / max(1, sum(r["is_new"] == is_new for r in rows))
        for is_new in (True, False)
    ]
    title = (
        f"Scenes asked with nouns that training never used, {rows[0]['n_pictures']} pictures a "
        "thing, in percent (95 % intervals over pictures). A noun has a taught word if one of its "
        "words is one of the lexicon's nouns, holds one (icebox: box) or is part of one:"
    )
    end = f"Means: {percent(means[0])} with wholly new nouns, {percent(means[1])} with the others."
    return f"{title}\n\n{_table(head, cells)}\n\n{end}"


def _premises(rows: Sequence[_Row]) -> str:
    asked = list(dict.fromkeys(other for row in rows for other in row["refused"]))
    head = ("shown ↓ asked about →", *(other.replace("_", " ") for other in asked))
    cells = [
        (
            row["shown"].replace("_", " "),
            *(
                f"{100 * row['refused'][other]:.0f}" if other in row["refused"] else "–"
                for other in asked
            ),
        )
        for row in rows
    ]
    title = (
        "False premises: the share of answers, in percent, that are neither yes nor no where the "
        "whole grid about one thing is asked before pictures of another "
        f"({rows[0]['n_pictures']} pictures a thing, six copies; – where the questions fit, since "
        "all of these have doors):"
    )
    return f"{title}\n\n{_table(head, cells)}"
