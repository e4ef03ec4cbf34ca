"""What a page tells of a model while it is asked: its notes, and a warning if it does not see."""

from collections.abc import Iterator
from dataclasses import dataclass

from vqa_state.models import VQAModel
from vqa_state.study.vision_check import CheckProgress, first_look
from vqa_state.web.jobs import StopFlag
from vqa_state.web.view_data import Value, duration, note

__all__ = ["Telling", "Told", "look_first", "look_note", "with_told"]


@dataclass(frozen=True)
class Told:
    """Sentences for the user, and whether one of them is a warning."""

    sentences: tuple[str, ...] = ()
    warns: bool = False


class Telling:
    """What was told last, of each project's jobs."""

    def __init__(self) -> None:
        self._told: dict[tuple[str, str], Told] = {}

    def __call__(self, pid: str, kind: str) -> Told:
        """Of this kind of job; nothing if none ran."""
        return self._told.get((pid, kind), Told())

    def forget(self, pid: str, kind: str) -> None:
        """A new job begins."""
        self._told.pop((pid, kind), None)

    def keep(self, pid: str, kind: str, told: Told) -> None:
        """In the place of what was told before."""
        self._told[pid, kind] = told


def look_first(
    telling: Telling, pid: str, kind: str, model: VQAModel, stop: StopFlag
) -> Iterator[CheckProgress]:
    """Look at a model once before a job asks it, and tell what is to be known of it."""
    notes = tuple(model.notes)
    telling.keep(pid, kind, Told(notes))
    for report in first_look(model, stop):
        found = report.result
        if found is not None and found.warns:
            telling.keep(pid, kind, Told((found.sentence, *notes), warns=True))
        yield report


def look_note(report: CheckProgress) -> Value:
    """How far the look is."""
    share = report.n_done / report.n_total if report.n_total else 1.0
    seconds = report.seconds_left
    left = "" if seconds is None else f", at most {duration(seconds)} left"
    return note(
        f"Looking whether the model sees: {report.n_done} of at most {report.n_total} calls{left}",
        share=share,
    )


def with_told(shown: Value, told: Told) -> Value:
    """A note with what was told below it; a warning gives it its colour."""
    text = "\n".join((shown["text"], *told.sentences))
    is_calm = shown["tone"] in ("plain", "good")
    return shown | {"text": text, "tone": "warn" if told.warns and is_calm else shown["tone"]}
