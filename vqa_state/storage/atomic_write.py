"""Writing files so that a crash or a full disk leaves the old content, never half of the new."""

import contextlib
import os
import uuid
from pathlib import Path

from vqa_state.errors import ProjectError

__all__ = ["write_atomically"]


def write_atomically(path: Path, data: bytes) -> None:
    """Write beside `path`, flush to disk, then rename over it.

    Raises:
        ProjectError: if the disk is full or the folder cannot be written; `path` is as it was.
    """
    temporary = path.parent / f".writing-{uuid.uuid4().hex}"
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
