"""The files of a ZIP, one by one in memory, with limits on what is really read.

Nothing is unpacked to a path: names are labels at most, and headers are not believed.
"""

import io
import lzma
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from vqa_state.project.folder_names import is_hidden, name_parts
from vqa_state.project.zip_names import entry_names
from vqa_state.questions.states import StateNames

__all__ = ["Incoming", "ZipLimits", "zip_entries"]

_DAMAGE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, OSError, EOFError, ValueError, LookupError,
    RuntimeError, struct.error, MemoryError,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Incoming:
    """A file that may become an image.

    Attributes:
        name: with folders; they may name a state and a split.
        data: its content; None if it cannot be read.
        reason: why it cannot be read.
        n_files: how many came in the same file.
    """

    name: str
    data: bytes | None
    reason: str = ""
    n_files: int = 1


@dataclass(frozen=True, slots=True)
class ZipLimits:
    """The most that is read of one ZIP.

    Attributes:
        n_entries: files and folders.
        n_bytes: of all files together, unpacked.
        entry_bytes: of one file; one more is read, so that it can be refused.
    """

    n_entries: int
    n_bytes: int
    entry_bytes: int


def zip_entries(
    file: Incoming, states: Callable[[], StateNames], limits: ZipLimits
) -> Iterator[Incoming]:
    """The files of a ZIP, without those that systems leave behind.

    Args:
        file: the ZIP; its own folders stand before those in it.
        states: gives the names by which the code page of file names is found; see `zip_names`.
        limits: what is read at most; a ZIP with more ends with a refusal.
    """
    within = PurePosixPath(file.name).parent
    try:
        archive = zipfile.ZipFile(io.BytesIO(file.data or b""))
    except _DAMAGE as error:
        yield Incoming(file.name, None, f"this ZIP file is damaged ({error}); make it again")
        return
    with archive:
        names = entry_names(archive.infolist(), states)
        listed = zip(archive.infolist(), map(name_parts, names), strict=True)
        wanted = [
            (number, entry, parts)
            for number, (entry, parts) in enumerate(listed)
            if parts and not entry.is_dir() and not any(map(is_hidden, parts))
        ]
        total = 0
        for number, entry, parts in wanted:
            if number >= limits.n_entries or total > limits.n_bytes:
                yield Incoming(file.name, None, _too_much(limits))
                return
            item = _read(archive, entry, str(PurePosixPath(within, *parts)), limits.entry_bytes)
            total += len(item.data or b"")
            yield replace(item, n_files=len(wanted))


def _read(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, name: str, limit: int) -> Incoming:
    try:
        with archive.open(entry) as file:
            return Incoming(name, file.read(limit + 1))
    except _DAMAGE as error:  # RuntimeError: it has a password
        return Incoming(name, None, f"it cannot be unpacked ({error})")


def _too_much(limits: ZipLimits) -> str:
    return (
        f"the ZIP holds more than {limits.n_entries:,} files or {limits.n_bytes / 1e9:.0f} GB; the "
        "rest was not read: split it into smaller ones"
    )
