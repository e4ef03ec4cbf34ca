"""Long work as an object: iterate it for its reports, or run it to its end with a progress bar."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Generic, TypeVar

from vqa_state.study.progress_bar import Position, progress_bar

__all__ = ["Run", "Stop", "never", "on_interrupt"]

Report = TypeVar("Report")

Stop = Callable[[], bool]
"""Asked often by long work; once it gives True, the work keeps what came and ends."""


def never() -> bool:
    """The `Stop` of work that nobody stops from outside."""
    return False


class Run(Generic[Report]):
    """Long work that was not begun yet; it can be run once.

        last = ask(project, model).run()           # with a progress bar

        run = ask(project, model)                  # or report by report
        for report in run:
            print(report.n_asked)
            if report.n_failed > 10:
                run.stop()

    There is one way to stop: `stop()`, from the loop or from another thread. Within about a second
    the work stores what came and gives its last report, which says that it was stopped. `run()`
    does that at the first Ctrl-C (or "interrupt" of a notebook); a second one ends at once. A loop
    that is left by `break` ends the work where it is. In all cases stored answers stay, and
    starting again goes on from there.

    Args:
        title: of the progress bar.
        work: makes the reports; it is given what says whether it was stopped.
        position: of a report on the bar.
        stop: a second source of stops, asked beside `stop()`.
    """

    def __init__(
        self,
        title: str,
        work: Callable[[Stop], Iterator[Report]],
        position: Callable[[Report], Position],
        stop: Stop = never,
    ) -> None:
        self._title = title
        self._work = work
        self._position = position
        self._stop_given = stop
        self._stopped = threading.Event()
        self._begun = False

    def __repr__(self) -> str:
        return f"<Run {self._title}: iterate it, or call .run()>"

    @property
    def stopped(self) -> bool:
        """Whether somebody asked the work to stop; it may have come to its end nevertheless."""
        return self._stopped.is_set() or self._stop_given()

    def stop(self) -> None:
        """Ask the work to keep what came and to end. May be called from any thread."""
        self._stopped.set()

    def __iter__(self) -> Iterator[Report]:
        """Do the work, a report at a time.

        Raises:
            RuntimeError: if it was begun before.
            VQAStateError: whatever the work raises.
        """
        if self._begun:
            raise RuntimeError(f"this {self._title} was begun already; make another one to go on")
        self._begun = True
        return self._reports()

    def _reports(self) -> Iterator[Report]:
        # `yield from` closes the work, and frees its locks, when a loop over this is left.
        yield from self._work(lambda: self.stopped)

    def run(self) -> Report:
        """Do all of the work with a progress bar on stderr; the first Ctrl-C stops it.

        Returns:
            The last report.

        Raises:
            RuntimeError: if it was begun before.
            VQAStateError: whatever the work raises.
        """
        last: list[Report] = []
        with on_interrupt(self.stop), progress_bar(self._title) as move:
            for report in self:
                move(self._position(report))
                last = [report]
        (report,) = last
        return report


@contextmanager
def on_interrupt(call: Callable[[], None]) -> Iterator[None]:
    """Call this at the first Ctrl-C instead of raising; a second one raises as ever.

    Signals reach the main thread alone, so elsewhere nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def heard(_: int, __: FrameType | None) -> None:
        signal.signal(signal.SIGINT, before)
        call()

    before = signal.signal(signal.SIGINT, heard)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
