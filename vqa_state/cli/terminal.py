"""What the command line shows: progress on stderr, tables or one JSON document on stdout."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import pandas as pd
from rich.console import Console
from rich.progress import TimeRemainingColumn
from rich.table import Table

from vqa_state.models.hub.snapshots import DownloadProgress
from vqa_state.models.length_limit import cut_off_words
from vqa_state.recognizer.verdict import Verdict
from vqa_state.study.assess import Assessment, AssessProgress
from vqa_state.study.collect import AskPlan, AskProgress
from vqa_state.study.optimize import OptimizeProgress
from vqa_state.study.progress_bar import Position, progress_bar
from vqa_state.study.run import on_interrupt
from vqa_state.study.vision_check import CheckProgress, ModelCheck
from vqa_state.study.workflows import asking_position, assessing_position, optimizing_position

__all__ = [
    "asked_sentence",
    "interruptible",
    "plan_record",
    "print_json",
    "print_table",
    "say",
    "show_asking",
    "show_assessing",
    "show_check",
    "show_download",
    "show_search",
    "verdict_record",
]


def say(sentence: str) -> None:
    """One line for the person at the terminal; stdout stays free for results."""
    Console(stderr=True, highlight=False).print(sentence, markup=False, soft_wrap=True)


def print_json(document: object) -> None:
    """One JSON document on stdout; undefined numbers become null."""
    sys.stdout.write(json.dumps(_plain(document), indent=1, ensure_ascii=False) + "\n")


def print_table(frame: pd.DataFrame, title: str) -> None:
    """A data frame of texts on stdout."""
    table = Table(title=title, title_justify="left")
    for column in frame.columns:
        table.add_column(str(column))
    for row in frame.itertuples(index=False):
        table.add_row(*map(str, row))
    width = None if sys.stdout.isatty() else 200  # a pipe has no width to fold to
    Console(width=width, markup=False).print(table)


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """A stop flag that the first Ctrl-C sets; a second one ends the program at once."""
    asked = False

    def stop() -> None:
        nonlocal asked
        asked = True
        say("stopping; what came is kept (Ctrl-C again to end at once)")

    with on_interrupt(stop):
        yield lambda: asked


def show_asking(reports: Iterator[AskProgress]) -> AskProgress:
    """Draw the reports and give back the last one."""
    with progress_bar("asking") as move:
        for last in reports:
            move(asking_position(last))
    return last


def show_download(reports: Iterator[DownloadProgress]) -> DownloadProgress:
    """Draw the reports and give back the last one."""
    last = DownloadProgress()
    with progress_bar("downloading (MB)") as move:
        for last in reports:
            left = last.seconds_left
            note = "" if left is None else f"about {left:.0f} s left"
            move(Position(last.n_bytes // 1_000_000, last.total // 1_000_000, note))
    return last


def show_check(reports: Iterator[CheckProgress]) -> ModelCheck | None:
    """Draw the reports and give back what was found; None after a stop."""
    found = None
    with progress_bar("checking (calls)") as move:
        for last in reports:
            move(Position(last.n_done, last.n_total))
            found = last.result
    return found


def show_search(reports: Iterator[OptimizeProgress]) -> OptimizeProgress:
    """Draw the reports and give back the last one."""
    with progress_bar("searching", TimeRemainingColumn()) as move:
        for last in reports:
            move(optimizing_position(last))
    return last


def show_assessing(reports: Iterator[AssessProgress]) -> Assessment | None:
    """Draw the reports and give back what was found; None if nothing was."""
    found = None
    with progress_bar("assessing") as move:
        for last in reports:
            move(assessing_position(last))
            found = last.assessment
    return found


def asked_sentence(progress: AskProgress, model: str = "") -> str:
    """How asking the model of this name ended."""
    words = (
        f"{progress.n_asked:,} of {progress.n_calls:,} answers asked in {progress.seconds:.1f} s, "
        f"{progress.n_stored:,} from the store"
    )
    if progress.n_failed:
        words += f"; {progress.n_failed:,} failed ({progress.last_failure}): run it again for these"
    if progress.n_cut_off:
        words += f"; {cut_off_words(progress.n_cut_off, model)}"
    return words + ("; stopped by you" if progress.stopped else "")


def plan_record(plan: AskPlan) -> dict[str, Any]:
    """A plan as JSON."""
    return asdict(plan) | {"n_calls": plan.n_calls, "n_to_ask": plan.n_to_ask}


def verdict_record(verdict: Verdict) -> dict[str, Any]:
    """A verdict as JSON, without the single votes."""
    record = asdict(verdict) | {"n_cut_off": verdict.n_cut_off}
    del record["votes"]
    return record


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and value != value:
        return None
    return value
