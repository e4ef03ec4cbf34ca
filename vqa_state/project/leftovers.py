"""Files that a killed program left in a project's folder: what they are, and removing them.

Pictures are on disk before project.json names them, and for a moment after it names them no more.
A journal beside it says which, so that no picture goes only because a project.json does not name
it: an older one may have come back from a backup.
"""

import os
import re
import uuid
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from filelock import FileLock, Timeout

from vqa_state.errors import ProjectError
from vqa_state.storage.atomic_write import is_half_written
from vqa_state.storage.locks import LOCK_NAME

__all__ = ["Journal", "has_leftovers", "remove_leftovers", "remove_pictures"]

IMAGES: Final = "images"
THUMBNAILS: Final = "thumbnails"
_FOLDERS: Final = ("", IMAGES, THUMBNAILS, "searches", "recognizers", "assessments", "features")
_PICTURE: Final = re.compile(r"[0-9a-f]{64}\.[a-z]{3,4}")
_JOURNAL: Final = re.compile(r"(\.unsaved-[0-9a-f]{32})(\.lock)?")


class Journal:
    """Names of picture files that project.json may not name. Its lock says that its owner lives."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / f".unsaved-{uuid.uuid4().hex}"
        self._lock = _lock_of(self._path)
        self._names: set[str] = set()

    def note(self, names: Collection[str]) -> None:
        """Write down files before they are written, or before they are no longer named.

        Raises:
            ProjectError: if the disk is full or the folder cannot be written.
        """
        if not names:
            return
        self._names.update(names)
        try:
            if not self._lock.is_locked:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._lock.acquire(timeout=0)
            with self._path.open("ab") as file:
                file.write("".join(f"{name}\n" for name in names).encode("ascii"))
        except OSError as error:
            raise ProjectError(
                f"cannot write into {self._path.parent} ({error.strerror or error}); nothing was "
                "changed: check free disk space and permissions, then try again"
            ) from error

    def forget(self, name: str) -> None:
        """A file was not written after all."""
        self._names.discard(name)
        if not self._names:
            self.close()

    def close(self) -> None:
        """All is saved; the next note begins anew."""
        self._names.clear()
        if self._lock.is_locked:
            _drop(self._path, self._lock)


def has_leftovers(folder: Path, named: Collection[str]) -> bool:
    """Whether there may be something to remove; a program at work looks so, too.

    Args:
        folder: of the project.
        named: the images' file names, as project.json gives them.
    """
    return any(True for _ in _leftovers(folder, named))


def remove_leftovers(folder: Path, named: Collection[str]) -> None:
    """Remove what nobody works on. Only for one who holds the folder's lock.

    Args:
        folder: of the project.
        named: the images' file names, as project.json gives them now.
    """
    for path in list(_leftovers(folder, named)):
        journal = _JOURNAL.fullmatch(path.name)
        if journal:
            _settle(folder / journal[1], named)
        elif path.name != LOCK_NAME:  # the caller's own, which goes with its release
            with suppress(OSError):
                path.unlink(missing_ok=True)


def remove_pictures(folder: Path, names: Collection[str]) -> None:
    """Remove pictures and their thumbnails; one that cannot be removed now stays."""
    for name in names:
        for path in (folder / IMAGES / name, folder / THUMBNAILS / f"{name[:64]}.webp"):
            with suppress(OSError):
                path.unlink(missing_ok=True)


def _leftovers(folder: Path, named: Collection[str]) -> Iterator[Path]:
    """Names alone are looked at, because there may be thousands, at every opening."""
    for place in _FOLDERS:
        for name in _names(folder / place):
            hidden = name.startswith(".")
            if hidden and (is_half_written(name) or (not place and _is_of_a_program(name))):
                yield folder / place / name
    shown = {f"{name[:64]}.webp" for name in named}
    for name in _names(folder / THUMBNAILS).difference(shown):
        if _PICTURE.fullmatch(name):
            yield folder / THUMBNAILS / name


def _is_of_a_program(name: str) -> bool:
    """Whether a program at work keeps a file of this name beside project.json."""
    return name == LOCK_NAME or _JOURNAL.fullmatch(name) is not None


def _names(folder: Path) -> set[str]:
    try:
        return set(os.listdir(folder))  # noqa: PTH208  # thousands of paths would take long
    except OSError:
        return set()


def _settle(path: Path, named: Collection[str]) -> None:
    """Remove the pictures of a journal that project.json does not name, if its owner is gone."""
    lock = _lock_of(path)
    with suppress(Timeout, OSError):
        lock.acquire(timeout=0)
        lines = path.read_text("ascii", "replace").splitlines() if path.exists() else []
        noted = {line for line in lines if _PICTURE.fullmatch(line)}
        remove_pictures(path.parent, noted.difference(named))
        _drop(path, lock)


def _drop(path: Path, lock: FileLock) -> None:
    with suppress(OSError):
        path.unlink(missing_ok=True)
        Path(lock.lock_file).unlink(missing_ok=True)
    lock.release()


def _lock_of(path: Path) -> FileLock:
    return FileLock(path.with_name(f"{path.name}.lock"), thread_local=False)
