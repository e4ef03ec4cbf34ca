"""A progress bar on stderr, in a terminal and in a notebook."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

__all__ = ["Position", "progress_bar"]


@dataclass(frozen=True, slots=True)
class Position:
    """How far long work is: `n_done` of `n_total` steps, and what there is to say of them."""

    n_done: int
    n_total: int
    note: str = ""


@contextmanager
def progress_bar(title: str, *more: ProgressColumn) -> Iterator[Callable[[Position], None]]:
    """Draw a bar; the function that is given moves it. Where nobody would see it, none is drawn.

    Args:
        title: stands before the bar.
        more: columns between the elapsed time and the note.
    """
    console = Console(stderr=True)
    columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), *more)
    note = TextColumn("{task.fields[note]}", markup=False)
    hidden = not (sys.stderr.isatty() or console.is_jupyter)
    with Progress(*columns, note, console=console, disable=hidden) as bar:
        task = bar.add_task(title, total=None, note="")

        def move(to: Position) -> None:
            bar.update(task, total=to.n_total, completed=to.n_done, note=to.note)

        yield move
