"""One lock a folder: who reads, changes and writes in it is alone, among threads and processes.

The operating system frees the lock of a process that is killed. Reading needs no lock, because
every file is replaced whole.
"""

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final
from weakref import WeakValueDictionary

from filelock import FileLock, Timeout

from vqa_state.errors import ProjectError

__all__ = ["LOCK_NAME", "WAIT_SECONDS", "locked"]

LOCK_NAME: Final = ".changing.lock"

WAIT_SECONDS: Final = 30.0
"""A change takes moments; who holds a folder longer hangs."""

_POLL_SECONDS: Final = 0.002


class _FolderLock:
    """The lock between this process's threads, and around it the lock between processes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.threads = threading.RLock()
        self.file = FileLock(path, mode=0o666, thread_local=False)  # any user of a shared folder


_known: WeakValueDictionary[Path, _FolderLock] = WeakValueDictionary()
_known_guard = threading.Lock()


@contextmanager
def locked(folder: Path, wait: float = WAIT_SECONDS) -> Iterator[None]:
    """Be alone with a folder. A thread that holds its lock already goes right on.

    A folder that nobody may write, such as one on a read-only disk, needs no lock: it can be read,
    and whoever writes is told so there.

    Args:
        folder: made if it is missing.
        wait: seconds until a lock that somebody else holds is given up.

    Raises:
        ProjectError: if somebody else holds the lock for longer, or it cannot be made.
    """
    lock = _lock_of(folder)
    if not lock.threads.acquire(timeout=wait):
        raise _busy(lock.path)
    try:
        is_held = _acquire(lock, wait)
        try:
            yield
        finally:
            if is_held:
                _release(lock)
    finally:
        lock.threads.release()


def _lock_of(folder: Path) -> _FolderLock:
    path = folder.resolve() / LOCK_NAME
    with _known_guard:
        return _known.setdefault(path, _FolderLock(path))


def _acquire(lock: _FolderLock, wait: float) -> bool:
    """False for a folder that cannot be written, and so needs no lock."""
    folder = lock.path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.file.acquire(timeout=wait, poll_interval=_POLL_SECONDS)
    except Timeout as error:
        raise _busy(lock.path) from error
    except OSError as error:
        if folder.is_dir() and not os.access(folder, os.W_OK):
            return False
        raise ProjectError(
            f"cannot write {lock.path} ({error.strerror or error}); nothing was changed: check "
            "free disk space and permissions, then try again"
        ) from error
    if _is_outermost(lock):
        with suppress(OSError), lock.path.open("r+b") as file:  # a disk may be full
            file.write(
                f"{os.getpid()} {socket.gethostname()}\n".encode()
            )  # before older, longer text
    return True


def _is_outermost(lock: _FolderLock) -> bool:
    """Not within another hold. Where a disk has no locks, filelock's own file is left alone."""
    return lock.file.lock_counter == 1 and type(lock.file) is FileLock


def _release(lock: _FolderLock) -> None:
    """The file goes while it is locked: who waits for it then sees that it is none any more.

    Windows does not let it go, and filelock removes it there.
    """
    if _is_outermost(lock):
        with suppress(OSError):
            lock.path.unlink()
    lock.file.release()


def _busy(path: Path) -> ProjectError:
    return ProjectError(
        f"{path.parent} is being changed by {_holder(path)}, and has been for longer than a change "
        "takes; nothing was changed here: wait until it is done, or end it if it hangs, then try "
        "again"
    )


def _holder(path: Path) -> str:
    try:
        process, machine = path.read_text("utf-8")[:300].splitlines()[0].split(maxsplit=1)
    except (OSError, ValueError, IndexError):
        return "another program"
    if machine != socket.gethostname():
        return f"process {process} on the machine {machine}"
    ours = process == str(os.getpid())
    return "another page or job of this program" if ours else f"process {process} on this machine"
