"""Writing files so that a crash or a full disk leaves the old content, never half of the new."""

import contextlib
import os
import tempfile
from pathlib import Path

from vqa_state.errors import ProjectError

__all__ = ["write_atomically"]


def write_atomically(path: Path, data: bytes) -> None:
    """Write beside `path`, flush to disk, then rename over it.

    Raises:
        ProjectError: if the disk is full or the folder cannot be written; `path` is as it was.
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".writing-")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)  # mkstemp makes it private; a project can be shared
        Path(temporary).replace(path)
    except OSError as error:
        if temporary is not None:
            with contextlib.suppress(OSError):
                Path(temporary).unlink(missing_ok=True)
        raise ProjectError(
            f"cannot write {path} ({error.strerror or error}); nothing was changed: check free "
            "disk space and permissions, then try again"
        ) from error
