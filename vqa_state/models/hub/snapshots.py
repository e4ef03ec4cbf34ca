"""Models of the Hugging Face hub: what is on this disk, and how the rest comes here.

The download runs in a process of its own, so that a stop ends it at once, whatever the network
does. What came is kept; the next download goes on from there.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Thread

from vqa_state.errors import ModelError
from vqa_state.models.address import ModelAddress
from vqa_state.models.local.families import missing_weights

__all__ = ["DownloadProgress", "cached_folder", "download", "is_cached"]

_LOOK_SECONDS = 0.2


@dataclass(frozen=True, slots=True)
class DownloadProgress:
    """How much of a model is on this disk.

    Attributes:
        n_bytes: on this disk now.
        total: bytes of all files, 0 while the hub has not said.
        seconds: since this download began.
        began_with: bytes that were there already.
        stopped: the user stopped it.
    """

    n_bytes: int = 0
    total: int = 0
    seconds: float = 0.0
    began_with: int = 0
    stopped: bool = False

    @property
    def seconds_left(self) -> float | None:
        """By the pace of this run; None before its first byte."""
        came = self.n_bytes - self.began_with
        return self.seconds / came * (self.total - self.n_bytes) if came > 0 else None


def is_cached(address: ModelAddress) -> bool:
    """Whether a hub model is whole on this disk. Nothing is asked of the network."""
    folder = _snapshot(address)
    return folder is not None and not missing_weights(folder)


def cached_folder(address: ModelAddress) -> Path:
    """The folder of a hub model on this disk.

    Raises:
        ModelError: if it is not here; the message says how to bring it, with and without network.
    """
    folder = _snapshot(address)
    if folder is None:
        plain = str(ModelAddress(address.source, address.where, revision=address.revision))
        raise ModelError(
            f"the model {address.where} is not on this disk; download it in the app or with: "
            f"python -m vqa_state models download {plain}. Without network, copy its folder from "
            "another machine and use it as folder:/path/to/it"
        )
    return folder


def download(
    address: ModelAddress, stop: Callable[[], bool] = lambda: False
) -> Iterator[DownloadProgress]:
    """Bring a hub model to this disk; only weights as safetensors, configuration and words.

    Yields:
        A report about five times a second.

    Raises:
        ModelError: if the hub cannot be reached, has no such model, or asks for a licence first.
    """
    began = time.monotonic()
    child = subprocess.Popen(  # noqa: S603  # our own interpreter and module, checked words
        [sys.executable, "-m", "vqa_state.models.hub.download", address.where, address.revision],
        stdin=subprocess.PIPE,  # its end tells the child that we are gone
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert child.stdin is not None  # noqa: S101  # it is piped
    assert child.stdout is not None  # noqa: S101  # it is piped
    progress = DownloadProgress()
    try:
        line = _first_line(child, stop)
        if line is None:
            yield replace(progress, stopped=True)
            return
        first = _said(line)
        total = int(str(first.get("total", 0)))
        folder = Path(str(first.get("folder", "")))
        progress = DownloadProgress(total=total, began_with=_size(folder, total))
        while child.poll() is None and "error" not in first:
            if stop():
                yield replace(progress, stopped=True)
                return
            seconds = time.monotonic() - began
            progress = replace(progress, n_bytes=_size(folder, total), seconds=seconds)
            yield progress
            time.sleep(_LOOK_SECONDS)
        last = _said(child.stdout.read() or "{}") if "error" not in first else first
        if child.wait() or "error" in last:
            raise ModelError(str(last.get("error", "the download ended early; start it again")))
        yield replace(progress, n_bytes=total, seconds=time.monotonic() - began)
    finally:
        child.kill()
        child.wait()
        child.stdin.close()
        child.stdout.close()


def _first_line(child: "subprocess.Popen[str]", stop: Callable[[], bool]) -> str | None:
    """What the child says first, once the hub has answered it; None if the user stops before."""
    lines: list[str] = []
    assert child.stdout is not None  # noqa: S101  # it is piped
    reader = Thread(target=lambda out: lines.append(out.readline()), args=(child.stdout,))
    reader.start()
    stopped = False
    while reader.is_alive():
        if stop():
            stopped = True
            child.kill()  # its end is the reader's, too
        reader.join(_LOOK_SECONDS)
    return None if stopped else lines[0]


def _said(line: str) -> dict[str, object]:
    """A line of the child process; one that was killed says nothing."""
    try:
        content = json.loads(line)
    except ValueError:
        return {"error": "the download ended early; start it again, and it goes on"}
    return content if isinstance(content, dict) else {}


def _size(folder: Path, total: int) -> int:
    """Bytes below a folder of the cache, unfinished files included; other versions count, too."""
    n_bytes = 0
    for path in folder.glob("blobs/*"):
        try:
            n_bytes += path.stat().st_size
        except OSError:
            continue  # it was renamed meanwhile
    return min(n_bytes, total)


def _snapshot(address: ModelAddress) -> Path | None:
    from huggingface_hub import snapshot_download
    from huggingface_hub.errors import HFValidationError, LocalEntryNotFoundError

    try:
        found = snapshot_download(
            address.where, revision=address.revision or None, local_files_only=True
        )
    except LocalEntryNotFoundError:
        return None
    except HFValidationError as error:
        raise ModelError(f"{address.where!r} is no name of a hub model ({error})") from error
    folder = Path(found)
    return folder if (folder / "config.json").is_file() else None
