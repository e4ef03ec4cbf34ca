"""A model in the hands of one thread at a time, and a stop between two of its forward passes.

A generation is many passes. Its loop may be a library's, so the stop is looked for where every
pass begins: in a hook of the module that is called for it.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from torch.nn import Module

__all__ = ["Stopped", "Turns", "till_stopped"]

T = TypeVar("T")

#: How long a caller waits before it looks again whether it gives up.
_LOOK_SECONDS = 0.1


class Stopped(Exception):  # noqa: N818
    """A user's stop on its way out of a generation; see `till_stopped`."""


@dataclass(frozen=True, eq=False)
class Turns:
    """Gives a model to one caller at a time.

    Attributes:
        steps: modules; every call of one is a forward pass that a stop may come before.
        stop: whether its caller gives up; None if it never does.
        lock: shared by all callers.
    """

    steps: Sequence["Module"] = ()
    stop: Callable[[], bool] | None = None
    lock: threading.Lock = field(default_factory=threading.Lock)

    def until(self, stop: Callable[[], bool]) -> "Turns":
        """Those of a caller who may give up, in the same queue as all others."""
        return replace(self, stop=stop)

    @contextmanager
    def take(self) -> Iterator[None]:
        """Have the model for some passes.

        Raises:
            Stopped: before the first pass that would begin after the stop, or while others have it.
        """
        self._wait()
        try:
            self._look()
            # Hooks are the model's own, but nobody else can call it meanwhile.
            steps = self.steps if self.stop else ()
            hooks = [module.register_forward_pre_hook(self._look) for module in steps]
            try:
                yield
            finally:
                for hook in hooks:
                    hook.remove()
        finally:
            self.lock.release()

    def _wait(self) -> None:
        """Take the lock; a block of somebody else's may take minutes, and a stop shall not."""
        while not self.lock.acquire(timeout=_LOOK_SECONDS):
            self._look()

    def _look(self, *_: object) -> None:
        if self.stop is not None and self.stop():
            raise Stopped


def till_stopped(replies: Iterator[T]) -> Iterator[T]:
    """The replies up to a stop, which ends them without an error."""
    with suppress(Stopped):
        yield from replies
