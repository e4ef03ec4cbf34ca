"""The measured part of docs/embedded_model.md, made from docs/embedded_model.json."""

from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["BEGIN", "END", "tables", "with_tables"]

#: What stands between these lines of the card is written by `evaluate`.
BEGIN = "<!-- measured: begin -->"
END = "<!-- measured: end -->"

_Row = Mapping[str, Any]

_GROUPS = {
    "scenes": "scenes of the measuring split",
    "foreign": "other people's simulators",
    "photos": "photos, the measuring half",
}


def tables(numbers: Mapping[str, Any]) -> str:
    """All tables and the facts about the file, as Markdown."""
    parts = [
        _facts(numbers["file"]),
        _accuracies(numbers["tasks"]),
        *_means(numbers["tasks"]),
        _gains(numbers["gains"]),
        _spread(numbers["tasks"]),
        _calibration(numbers["calibration"]),
        _words(numbers["held_out_nouns"]),
    ]
    return "\n\n".join(parts)


def with_tables(card: str, numbers: Mapping[str, Any]) -> str:
    """The card with its measured part replaced.

    Raises:
        ValueError: if the card lacks one of the two marks.
    """
    before, begin, rest = card.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the card must hold {BEGIN!r} and {END!r}")
    return f"{before}{BEGIN}\n{tables(numbers)}\n{END}{after}"


def _facts(file: _Row) -> str:
    training = file["training"]
    return (
        f"Training: seed {training['seed']}, {training['scenes']} rendered pictures, "
        f"{training['simulators']} of a foreign simulator, {training['photos']} variations of "
        f"photos, {training['epochs']} epochs. Weights: {file['megabytes']} MB, "
        f"{file['parameters']:,} parameters in float16, SHA-256 starts with `{file['digest']}`. "
        f"120 pictures with 64 questions each: {file['seconds_120x64']} s on {file['threads']} "
        "processor threads."
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _accuracies(tasks: Sequence[_Row]) -> str:
    head = (
        "task",
        "pictures",
        "**s+**",
        "s+ in the grid only",
        "s_all, the grid",
        "grid and cues, all",
        "best single",
        "called positive",
        "invalid",
        "questions used",
    )
    rows = [
        (
            f"{row['group']}: {_name(row)}",
            f"{row['n_positive']} + {row['n_negative']}",
            *(
                _percent(row[key])
                for key in ("s_plus", "s_plus_grid", "s_all", "all_questions", "single")
            ),
            _percent(row["called_positive"]),
            _percent(row["invalid"]),
            "–" if row["n_used"] is None else f"{row['n_used']:.0f} of {row['n_questions']}",
        )
        for row in tasks
    ]
    return _table(head, rows)


def _means(tasks: Sequence[_Row]) -> list[str]:
    """One sentence a group."""
    sentences = []
    for group, words in _GROUPS.items():
        rows = [row for row in tasks if row["group"] == group and row["s_plus"] is not None]
        if rows:
            means = [
                sum(row[key] for row in rows) / len(rows) for key in ("s_plus", "s_all", "single")
            ]
            worst = min(rows, key=lambda row: float(row["s_plus"]))
            sentences.append(
                f"Mean over {words}: s+ {_percent(means[0])}, s_all {_percent(means[1])}, best "
                f"single {_percent(means[2])}; the worst with s+ is {_name(worst)}, "
                f"{_percent(worst['s_plus'])}."
            )
    return sentences


def _gains(gains: Mapping[str, Mapping[str, _Row]]) -> str:
    lines = []
    for key, words in (("over_all", "s_all of the grid"), ("over_single", "the best single")):
        for over, one in gains[key].items():
            lines.append(
                f"- s+ against {words}, over {one['n']} {over}: {100 * one['mean']:+.1f} points "
                f"({100 * one['low']:+.1f} to {100 * one['high']:+.1f})"
            )
    title = "What the search gains on scenes and foreign tasks together (95 % intervals, paired):"
    return "\n".join([title, "", *lines])


def _spread(tasks: Sequence[_Row]) -> str:
    head = ("task", "worst single", "median", "best", "standard deviation")
    rows = [
        (
            f"{row['group']}: {_name(row)}",
            *(
                f"{row[key]:.3f}"
                for key in ("single_min", "single_median", "single_max", "single_sd")
            ),
        )
        for row in tasks
    ]
    return "Accuracy of single questions among their valid answers:\n\n" + _table(head, rows)


def _calibration(groups: Mapping[str, _Row]) -> str:
    lines = ["Stated probability of the positive state against what was so (expected error):", ""]
    for group, one in groups.items():
        curve = ", ".join(f"{mean:.2f} → {share:.2f}" for n, mean, share in one["bins"] if n)
        lines.append(f"- {_GROUPS[group]}: error {one['error']:.3f}; {curve}")
    return "\n".join(lines)


def _words(rows: Sequence[_Row]) -> str:
    head = ("thing", "nouns never taught", "recognized with them", "unfit questions refused")
    cells = [
        (
            row["thing"].replace("_", " "),
            ", ".join(row["nouns"]),
            _percent(row["balanced"]),
            _percent(row["refused"]),
        )
        for row in rows
    ]
    return _table(head, cells)


def _name(row: _Row) -> str:
    return str(row["name"]).replace("_", " ")


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"
