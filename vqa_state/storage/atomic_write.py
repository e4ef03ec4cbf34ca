"""Writing files so that a crash or a full disk leaves the old content, never half of the new."""

import contextlib
import os
import re
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from vqa_state.errors import ProjectError
from vqa_state.storage.locks import locked

__all__ = ["PROJECT_FILE", "drop_half_written", "is_half_written", "write_atomically"]

PROJECT_FILE: Final = "project.json"
"""A folder that holds it is a project's."""

_HALF_WRITTEN: Final = re.compile(r"\.writing-[0-9a-f]+")
_OLD_SECONDS: Final = 3600.0


def write_atomically(path: Path, data: bytes) -> None:
    """Write beside `path`, flush to disk, then rename over it.

    A file in a project's folder, or in a folder of it, is written under the project's lock. So
    what is half-written there while one holds the lock was left by somebody who was killed.

    Raises:
        ProjectError: if the disk is full, the folder cannot be written, or somebody else holds
            the project's lock; `path` is as it was.
    """
    temporary = path.parent / f".writing-{uuid.uuid4().hex}"
    with _alone(path.parent):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with temporary.open("xb") as file:  # the user's own umask says who may read it
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        except OSError as error:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise ProjectError(
                f"cannot write {path} ({error.strerror or error}); nothing was changed: check free "
                "disk space and permissions, then try again"
            ) from error


def is_half_written(name: str) -> bool:
    """Whether a file of this name is one that `write_atomically` had not finished."""
    return _HALF_WRITTEN.fullmatch(name) is not None


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    for place in (folder, folder.parent):
        if (place / PROJECT_FILE).exists():
            with locked(place):
                yield
            return
    drop_half_written(folder, older_than=_OLD_SECONDS)  # no lock tells who lives, but an hour does
    yield


def drop_half_written(folder: Path, older_than: float = 0.0) -> None:
    """Remove what writers that were killed left in a folder.

    Args:
        folder: in which nobody else writes now.
        older_than: seconds; younger files stay.
    """
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if not is_half_written(entry.name) or not entry.is_file(follow_symlinks=False):
                continue
            if time.time() - entry.stat(follow_symlinks=False).st_mtime >= older_than:
                Path(entry.path).unlink(missing_ok=True)
