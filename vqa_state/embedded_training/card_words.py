"""Where the model fails, in sentences that are made from the numbers and so cannot drift."""

from collections.abc import Mapping, Sequence
from typing import Any

from vqa_state.embedded_training.intervals import Tally, resampled, spread

__all__ = ["GROUPS", "failures", "name_of", "percent", "points", "short_name"]

GROUPS = {
    "scenes": "scenes of the measuring split",
    "foreign": "other people's simulators",
    "photos": "photos, the measuring half",
}

#: A grid that calls this much more or less than half of the pictures positive leans.
_LEAN = 0.1

#: Pairs of a false premise that are refused less often than this are named.
_SELDOM = 0.5

_Row = Mapping[str, Any]


def failures(numbers: Mapping[str, Any]) -> str:
    """A list of what the numbers say, as Markdown."""
    lines = [
        *_leans(numbers["tasks"]),
        *_leans_left(numbers["tasks"]),
        _probabilities(numbers["calibration"]),
        *_search(numbers["groups"], numbers["tasks"]),
        _start(numbers["groups"]),
        _premises(numbers["premises"]),
        _nouns(numbers["nouns"]),
    ]
    return "\n".join(f"- {line}" for line in lines)


def name_of(row: _Row) -> str:
    """Group and name, as in `foreign: adroit door`."""
    return f"{row['group']}: {short_name(row)}"


def short_name(row: _Row) -> str:
    """A task's name in words."""
    return str(row["name"]).replace("_", " ")


def percent(value: float | None) -> str:
    """A share in percent, or a dash."""
    return "–" if value is None else f"{100 * value:.1f} %"


def points(value: float) -> str:
    """A difference in points of a percent, with its sign."""
    rounded = round(100 * value, 1)
    return f"{'−' if rounded < 0 else '+' if rounded > 0 else ''}{abs(rounded):.1f}"


def _leans(tasks: Sequence[_Row]) -> list[str]:
    found = []
    for more, words in ((True, "positive"), (False, "negative")):
        shares = [
            (row, row["called_positive"] if more else 1 - row["called_positive"]) for row in tasks
        ]
        leaning = sorted(
            (pair for pair in shares if pair[1] > 0.5 + _LEAN), key=lambda pair: -pair[1]
        )
        if leaning:
            named = ", ".join(f"{percent(share)} ({name_of(row)})" for row, share in leaning)
            found.append(
                f"**Leans to the {words} state.** The grid calls so many of the pictures {words}, "
                f"weighed so that half would be right: {named}."
            )
    return found


def _leans_left(tasks: Sequence[_Row]) -> list[str]:
    """How far from one half the share called positive is, of the grid and of what was chosen."""
    said = []
    for group, words in GROUPS.items():
        tallies = [
            Tally(**row["tally"])
            for row in tasks
            if row["group"] == group and row["s_plus"] is not None
        ]
        if tallies:
            grid, random, ours = (
                100 * sum(abs(tally.called_positive(way) - 0.5) for tally in tallies) / len(tallies)
                for way in ("s_all", "s_plus_random", "s_plus")
            )
            said.append(
                f"on {words} ({_tasks(len(tallies))}) {grid:.1f} points with the whole grid, "
                f"{random:.1f} with s+ from a random start, {ours:.1f} with s+"
            )
    if not said:
        return []
    return [
        "**The lean before and after choosing.** On the pictures that were not chosen on, the "
        "share called positive is off one half, on average over the searched tasks: "
        f"{'; '.join(said)}."
    ]


def _tasks(n: int) -> str:
    return f"{n} task{'' if n == 1 else 's'}"


def _probabilities(groups: Mapping[str, _Row]) -> str:
    said = []
    for group, one in groups.items():
        stated, share = next((mean, share) for n, mean, share in reversed(one["bins"]) if n)
        said.append(
            f"on {GROUPS[group]} the expected error is {one['error']:.3f}, and where the "
            f"probability averages {stated:.2f} the positive state is there in {share:.2f}"
        )
    worst = max(groups, key=lambda group: float(groups[group]["error"]))
    return f"**Stated probabilities are worst on {GROUPS[worst]}**: {'; '.join(said)}."


def _search(groups: Mapping[str, _Row], tasks: Sequence[_Row]) -> list[str]:
    """One line a group: what choosing gained or lost against asking the whole grid."""
    lines = []
    for group, one in groups.items():
        gain = one["gains"]["over_all"]
        over_tasks = "unknown" if gain["tasks"] is None else _from_to(gain["tasks"])
        line = (
            f"**On {GROUPS[group]} the search {_gains_or_loses(gain)} against asking the whole "
            f"grid**: {percent(one['means']['s_plus']['mean'])} against "
            f"{percent(one['means']['s_all']['mean'])}, {points(gain['mean'])} points (95 % "
            f"interval over pictures {_from_to(gain['pictures'])}, over the {gain['n_tasks']} "
            f"tasks {over_tasks})."
        )
        if group == "photos":
            line += _photos([row for row in tasks if row["name"] in one["tasks"]])
        lines.append(line)
    return lines


def _gains_or_loses(gain: _Row) -> str:
    """A word for the sign, and whether luck of the pictures or of the tasks might explain it."""
    if round(gain["mean"], 3) == 0:
        return "neither gains nor loses"
    ends = [gain["pictures"], *([] if gain["tasks"] is None else [gain["tasks"]])]
    sure = all(low > 0 or high < 0 for low, high in ends)
    return f"{'gains' if gain['mean'] > 0 else 'loses'}{'' if sure else ', perhaps by chance,'}"


def _photos(rows: Sequence[_Row]) -> str:
    said = []
    for row in rows:
        if row["group"] == "photos":
            interval = spread(resampled([Tally(**row["tally"])], "s_plus", "s_all"))
            said.append(
                f"{short_name(row)} {percent(row['s_plus'])} against {percent(row['s_all'])} "
                f"({_from_to(interval)} points, {row['n_positive']} + {row['n_negative']} photos)"
            )
    better = [row for row in rows if row["group"] == "photos" and row["s_plus"] < row["s_all"]]
    plainly = (
        " Asking all questions of the grid was better there:" if len(better) == len(said) else ""
    )
    return f"{plainly} {', '.join(said)}."


def _start(groups: Mapping[str, _Row]) -> str:
    said = [
        f"on {GROUPS[group]} {percent(one['means']['s_plus_random']['mean'])} instead of "
        f"{percent(one['means']['s_plus']['mean'])}"
        for group, one in groups.items()
    ]
    return (
        "**What rests on our change of the search.** With the paper's random start, s+ "
        f"recognizes {', '.join(said)}."
    )


def _premises(rows: Sequence[_Row]) -> str:
    pairs = sorted(
        (share, row["shown"].replace("_", " "), asked.replace("_", " "))
        for row in rows
        for asked, share in row["refused"].items()
    )
    mean = sum(share for share, _, _ in pairs) / len(pairs)
    seldom = [
        f"{shown} asked about {asked} ({100 * share:.0f} %)"
        for share, shown, asked in pairs
        if share < _SELDOM
    ]
    named = f"refused in less than half: {', '.join(seldom)}" if seldom else "none below half"
    return (
        f"**False premises.** Questions about a thing that is not there are refused in "
        f"{percent(mean)} on average over {len(pairs)} pairs of things, but unevenly; {named}."
    )


def _nouns(rows: Sequence[_Row]) -> str:
    worst = min(rows, key=lambda row: float(row["balanced"]))
    nouns = ", ".join(f'"{noun}"' for noun in worst["nouns"])
    low, high = worst["interval"]
    thing = worst["thing"].replace("_", " ")
    return (
        f"**Nouns that were never taught.** Worst is {thing} as {nouns}: "
        f"{percent(worst['balanced'])} (95 % interval {percent(low)} to {percent(high)})."
    )


def _from_to(ends: Sequence[float]) -> str:
    return f"{points(ends[0])} to {points(ends[1])}"
