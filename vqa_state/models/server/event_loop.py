"""Async work for a caller that is not: a loop in a thread of its own, which can be cancelled.

The caller's own thread may run a loop already (a notebook, a web server), so it is not used.
"""

import asyncio
import threading
from collections.abc import Callable, Coroutine
from typing import Generic, TypeVar

__all__ = ["LoopThread"]

Result = TypeVar("Result")


class LoopThread(threading.Thread, Generic[Result]):
    """Runs one coroutine to its end.

    Args:
        work: makes the coroutine; called in the thread.
    """

    def __init__(self, work: Callable[[], Coroutine[None, None, Result]]) -> None:
        super().__init__(name="vqa-state-calls", daemon=True)
        self._work = work
        self._begun = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[Result] | None = None

    def run(self) -> None:
        """See `threading.Thread`; an error is kept for `result`."""
        with asyncio.Runner() as runner:
            self._loop = runner.get_loop()
            self._task = self._loop.create_task(self._work())
            self._begun.set()
            self._loop.run_until_complete(asyncio.wait([self._task]))

    def cancel(self) -> None:
        """Ask the coroutine to end where it waits; returns at once."""
        self._begun.wait()
        if self._loop is None or self._task is None or not self.is_alive():
            return
        try:
            self._loop.call_soon_threadsafe(self._task.cancel)
        except RuntimeError:
            return  # the loop closed in between: there is nothing left to cancel

    def result(self) -> Result:
        """What the coroutine returned; waits for it.

        Raises:
            Whatever the coroutine raised.
        """
        self.join()
        if self._task is None:
            raise RuntimeError("the thread was never started")
        return self._task.result()
