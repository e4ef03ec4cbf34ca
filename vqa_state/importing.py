"""Many pictures at once: files, a folder, or a ZIP whose folders name the states.

Nothing is unpacked to a path: entries are read into memory one by one, with a limit on what is
really read, whatever their headers claim.
"""

import io
import lzma
import os
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from vqa_state.errors import ImageError
from vqa_state.images import MAX_BYTES
from vqa_state.project import Project
from vqa_state.splits import Split

__all__ = ["ImportReport", "Refused", "add_files", "add_folder", "add_zip"]

MAX_ENTRIES = 20_000
MAX_TOTAL_BYTES = 2_000_000_000
_DAMAGE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, OSError, EOFError, ValueError, LookupError,
    RuntimeError, struct.error, MemoryError,
)  # fmt: skip
_IGNORED = {"thumbs.db", "desktop.ini", "__macosx"}


@dataclass(frozen=True, slots=True)
class Refused:
    """A file that was skipped, and why."""

    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class ImportReport:
    """What became of each file: ids added, ids that were there already, files refused."""

    added: tuple[str, ...]
    already_there: tuple[str, ...]
    refused: tuple[Refused, ...]

    def sentence(self) -> str:
        """The report in one line, for a status field."""
        parts = [f"{len(self.added)} added"]
        if self.already_there:
            parts.append(f"{len(self.already_there)} already there (same bytes)")
        if self.refused:
            first = self.refused[0]
            parts.append(f"{len(self.refused)} refused, the first: {first.name}: {first.reason}")
        return "; ".join(parts)


@dataclass(frozen=True, slots=True)
class _Incoming:
    name: str
    """With folders; they may name a state and a split."""
    data: bytes | None
    reason: str = ""


def add_files(
    project: Project, files: Iterable[tuple[str, bytes]], label: int | None = None
) -> ImportReport:
    """Add pictures and ZIP files by name and content."""
    return _add(project, _expanded(_Incoming(name, data) for name, data in files), label)


def add_folder(project: Project, folder: Path, label: int | None = None) -> ImportReport:
    """Add every file below a folder, or one file; links are not followed, hidden files passed over.

    A folder named as a state labels its pictures; one named train, test or unused gives the side.

    Raises:
        ImageError: if there is no such file or folder.
    """
    try:
        folder.stat()
    except (OSError, ValueError) as error:
        raise ImageError(
            f"there is no file or folder {folder} ({error}); check the path"
        ) from error
    return _add(project, _expanded(_files_below(folder, project.folder)), label)


def add_zip(project: Project, data: bytes, label: int | None = None) -> ImportReport:
    """Add every picture of a ZIP; see `add_folder` for what its folders mean."""
    return _add(project, _entries(_Incoming("ZIP", data)), label)


def _add(project: Project, incoming: Iterable[_Incoming], label: int | None) -> ImportReport:
    added: list[str] = []
    known: list[str] = []
    refused: list[Refused] = []
    for item in incoming:
        name = _shown(item.name)
        if item.data is None:
            refused.append(Refused(name, item.reason))
            continue
        try:
            one = project.add(item.data, name, _label_of(project, item.name, label))
        except ImageError as error:
            refused.append(Refused(name, str(error)))
            continue
        (added if one.is_new else known).append(one.image.id)
        split = _split_of(item.name)
        if split is not None:
            project.set_splits([one.image.id], split)
    return ImportReport(tuple(added), tuple(known), tuple(refused))


def _label_of(project: Project, name: str, label: int | None) -> int | None:
    """The innermost folder that is named as a state; else the label given for all."""
    for folder in reversed(PurePosixPath(name).parts[:-1]):
        for words in (folder, folder.replace("_", " ")):
            found = project.states.label(words)
            if found is not None:
                return found
    return label


def _split_of(name: str) -> Split | None:
    """The innermost folder that is named as a side."""
    sides = {split.value: split for split in Split}
    folders = (folder.casefold() for folder in reversed(PurePosixPath(name).parts[:-1]))
    return next((sides[folder] for folder in folders if folder in sides), None)


def _shown(name: str) -> str:
    """A name without what a screen or a file cannot hold."""
    return "".join(c if c.isprintable() else "\ufffd" for c in name)


def _expanded(files: Iterable[_Incoming]) -> Iterator[_Incoming]:
    for file in files:
        data = file.data or b""
        if data[:4] == b"PK\x03\x04" or (file.name.lower().endswith(".zip") and data):
            yield from _entries(file)
        else:
            yield file


def _files_below(path: Path, project_folder: Path) -> Iterator[_Incoming]:
    """Not those of the project itself, whose thumbnails would become images."""
    if path.is_file():
        yield _limited(path, path.name)
        return
    unread: list[OSError] = []
    own = project_folder.resolve()
    for folder, folders, names in os.walk(path, onerror=unread.append):  # does not follow links
        if Path(folder).resolve() == own:
            folders.clear()
            continue
        folders[:] = sorted(f for f in folders if not _hidden(f))
        for name in sorted(n for n in names if not _hidden(n)):
            file = Path(folder) / name
            if file.is_file() and not file.is_symlink():
                yield _limited(file, (Path(path.name) / file.relative_to(path)).as_posix())
    for error in unread:
        yield _Incoming(str(error.filename), None, f"the folder cannot be read ({error.strerror})")


def _limited(path: Path, name: str) -> _Incoming:
    """At most one byte (ZIP: one whole limit) more than is allowed, so that it is refused."""
    limit = MAX_TOTAL_BYTES if path.suffix.lower() == ".zip" else MAX_BYTES
    try:
        with path.open("rb") as file:
            return _Incoming(name, file.read(limit + 1))
    except OSError as error:
        return _Incoming(name, None, f"the file cannot be read ({error.strerror})")


def _hidden(name: str) -> bool:
    return (name.startswith(".") and name != "..") or name.casefold() in _IGNORED


def _entries(file: _Incoming) -> Iterator[_Incoming]:
    """The files of a ZIP. Their names are labels at most: nothing is written to them."""
    within = PurePosixPath(file.name).parent
    try:
        archive = zipfile.ZipFile(io.BytesIO(file.data or b""))
    except _DAMAGE as error:
        yield _Incoming(file.name, None, f"this ZIP file is damaged ({error}); make it again")
        return
    with archive:
        total = 0
        for count, entry in enumerate(archive.infolist()):
            parts = PurePosixPath(entry.filename.replace("\\", "/").lstrip("/")).parts
            if not parts or entry.is_dir() or any(_hidden(part) for part in parts):
                continue
            if count >= MAX_ENTRIES or total > MAX_TOTAL_BYTES:
                yield _Incoming(file.name, None, _too_much())
                return
            item = _read_entry(archive, entry, str(PurePosixPath(within, *parts)))
            total += len(item.data or b"")
            yield item


def _read_entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, name: str) -> _Incoming:
    try:
        with archive.open(entry) as file:
            return _Incoming(name, file.read(MAX_BYTES + 1))
    except _DAMAGE as error:  # RuntimeError: it has a password
        return _Incoming(name, None, f"it cannot be unpacked ({error})")


def _too_much() -> str:
    return (
        f"the ZIP holds more than {MAX_ENTRIES:,} files or {MAX_TOTAL_BYTES / 1e9:.0f} GB; the "
        "rest was not read: split it into smaller ones"
    )
