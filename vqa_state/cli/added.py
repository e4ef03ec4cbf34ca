"""What `add` tells of the files that it was given."""

from typing import Final

from vqa_state.project.importing import ImportReport
from vqa_state.project.project import StateNames

__all__ = ["report_record", "unlabelled_lines"]

_MOST_LINES: Final = 20


def report_record(report: ImportReport) -> dict[str, object]:
    """What became of each file, as JSON."""
    return {
        "added": report.added,
        "already_there": report.already_there,
        "refused": [{"name": one.name, "reason": one.reason} for one in report.refused],
        "unlabelled": [{"name": one.name, "reason": one.reason} for one in report.unlabelled],
    }


def unlabelled_lines(states: StateNames, report: ImportReport) -> list[str]:
    """Why images have no label, where the sentence names not all reasons, and what to do."""
    reasons = report.reasons()
    if not reasons:
        return []
    lines = [f"without a label: {reason} ({n})" for reason, n in reasons[:_MOST_LINES]]
    lines = lines if len(reasons) > 1 else []
    if len(reasons) > _MOST_LINES:
        n_rest = sum(n for _, n in reasons[_MOST_LINES:])
        lines.append(f"without a label: {n_rest} in {len(reasons) - _MOST_LINES} more folders")
    lines.append(
        f"to label them, put them in folders named {states.positive!r} and {states.negative!r} "
        "and add them again, or use `python -m vqa_state label`"
    )
    return lines
