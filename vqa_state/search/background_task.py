"""Runs a solver in a thread, so that what it finds is seen while it works, and a stop is heard."""

import math
import queue
import threading
import time
from collections.abc import Callable, Generator
from typing import Generic, TypeVar

__all__ = ["BackgroundTask", "StopPoll", "time_limit"]

_POLL_SECONDS = 0.1

# Answers up to which nodes and deterministic time alone limit a solver, so that it repeats: those
# of 64 questions and 20 images. Beyond, a single node or a simplification may take minutes.
_FEW_CELLS = 64 * 20
_MOST_SECONDS = 60.0

News = TypeVar("News")


def time_limit(n_images: int, n_questions: int) -> float:
    """How long a solver may work on a table besides its own limits; infinite for a small one."""
    return math.inf if n_images * n_questions <= _FEW_CELLS else _MOST_SECONDS


class StopPoll:
    """Asks for a stop by the clock, some ten times a second, however often it is called.

    So a loop may call it at every turn. What was told once is not asked again.

    Args:
        stop: whether to stop.
    """

    def __init__(self, stop: Callable[[], bool]) -> None:
        self._stop, self._told, self._next = stop, False, 0.0

    def __call__(self) -> bool:
        """Whether to stop, as far as is known since the last time of asking."""
        now = time.monotonic()
        if not self._told and now >= self._next:
            self._told = self._stop()
            self._next = now + _POLL_SECONDS
        return self._told


class BackgroundTask(Generic[News]):
    """Iterates over what `task` puts; ends when the task ends, or soon after a stop.

    The solver must let other threads run, as compiled ones do. Leaving the loop early, by a stop
    or by no longer iterating, calls `interrupt`.

    Args:
        task: the work; gets a function that it calls with each piece of news.
        stop: asked several times a second.
        interrupt: tells the task to end soon; None if it cannot be told. Then its thread goes on
            unheard up to its own limit, and does not keep the program from ending.
    """

    def __init__(
        self,
        task: Callable[[Callable[[News], None]], None],
        stop: Callable[[], bool],
        interrupt: Callable[[], None] | None = None,
    ) -> None:
        self._task, self._stop, self._interrupt = task, StopPoll(stop), interrupt
        self._news: queue.SimpleQueue[tuple[News] | None] = queue.SimpleQueue()
        self._error: BaseException | None = None
        self.stopped = False

    def __iter__(self) -> Generator[News, None, None]:
        thread = threading.Thread(target=self._run, name="solver", daemon=True)
        thread.start()
        try:
            while (news := self._next()) is not None:
                yield news[0]
        finally:
            while self._interrupt is not None and thread.is_alive():
                self._interrupt()  # again, because a solver that has not begun does not hear it
                thread.join(_POLL_SECONDS)
        if self._error is not None:
            raise self._error

    def _next(self) -> tuple[News] | None:
        """The next piece of news; None at the end or after a stop."""
        while not self._stop():  # before each, because news may come without a pause
            try:
                return self._news.get(timeout=_POLL_SECONDS)
            except queue.Empty:
                continue
        self.stopped = True
        return None

    def _run(self) -> None:
        try:
            self._task(lambda news: self._news.put((news,)))
        except BaseException as error:  # noqa: BLE001  # raised again where the news is read
            self._error = error
        finally:
            self._news.put(None)
