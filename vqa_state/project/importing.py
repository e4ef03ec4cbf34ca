"""Many pictures at once: files, a folder, or a ZIP whose folders name the states.

Nothing is unpacked to a path: entries are read into memory one by one, with a limit on what is
really read, whatever their headers claim.
"""

import io
import lzma
import os
import struct
import time
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path, PurePosixPath

from vqa_state.errors import ImageError
from vqa_state.images.reading import MAX_BYTES, check_side, content_hash
from vqa_state.project.project import LabelledImage, Project
from vqa_state.project.split import Split

__all__ = [
    "Batch",
    "ImportReport",
    "Known",
    "Refused",
    "add_files",
    "add_folder",
    "add_zip",
    "added_in_batches",
]

MAX_ENTRIES = 20_000
MAX_TOTAL_BYTES = 2_000_000_000
_DAMAGE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, OSError, EOFError, ValueError, LookupError,
    RuntimeError, struct.error, MemoryError,
)  # fmt: skip
_BATCH_FILES = 8
_BATCH_SECONDS = 0.25
"""A batch takes no further file after this time: others wait for the project so long."""
_IGNORED = {"thumbs.db", "desktop.ini", "__macosx"}


@dataclass(frozen=True, slots=True)
class Refused:
    """A file that was skipped, and why."""

    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Known:
    """A file whose bytes the project has already, and the image that they are."""

    name: str
    image: LabelledImage


@dataclass(frozen=True, slots=True)
class Batch:
    """What became of the next few files.

    Attributes:
        n_done: files so far, those of earlier batches included.
        n_files: files in all.
        added: new images.
        known: files that were there already.
        refused: files that were skipped.
    """

    n_done: int
    n_files: int
    added: tuple[LabelledImage, ...] = ()
    known: tuple[Known, ...] = ()
    refused: tuple[Refused, ...] = ()


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
    n_files: int = 1
    """How many came in the same file."""


Opened = Callable[[], AbstractContextManager[Project]]


def add_files(
    project: Project, files: Iterable[tuple[str, bytes]], label: int | None = None
) -> ImportReport:
    """Add pictures and ZIP files by name and content; names may have folders, as in a ZIP."""
    return _add(project, _expanded(_given(files)), label)


def added_in_batches(opened: Opened, name: str, data: bytes) -> Iterator[Batch]:
    """Add one picture or ZIP file, a few pictures at a time.

    Args:
        opened: gives the project for one batch, and saves it if it shall be saved; between two
            batches nobody holds it.
        name: of the file; it may have folders, which mean what they mean in a ZIP.
        data: content of the file.

    Raises:
        ProjectError: if it cannot be written, or whatever `opened` raises; earlier batches stay.
    """
    yield from _batches(opened, _expanded(_given([(name, data)])), None)


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
    batches = list(_batches(lambda: nullcontext(project), incoming, label))
    return ImportReport(
        tuple(image.id for batch in batches for image in batch.added),
        tuple(known.image.id for batch in batches for known in batch.known),
        tuple(refused for batch in batches for refused in batch.refused),
    )


def _batches(opened: Opened, incoming: Iterable[_Incoming], label: int | None) -> Iterator[Batch]:
    files, n_done = iter(incoming), 0
    for first in files:
        with opened() as project:
            few = [_taken(project, item, label) for item in _few(chain([first], files))]
        n_done += len(few)
        yield Batch(
            n_done,
            max(n_done, first.n_files),  # a ZIP that is too large is refused after its files
            tuple(one for one in few if isinstance(one, LabelledImage)),
            tuple(one for one in few if isinstance(one, Known)),
            tuple(one for one in few if isinstance(one, Refused)),
        )


def _few(files: Iterator[_Incoming]) -> Iterator[_Incoming]:
    began = time.monotonic()
    for file in islice(files, _BATCH_FILES):
        yield file
        if time.monotonic() - began > _BATCH_SECONDS:
            return


def _taken(project: Project, item: _Incoming, label: int | None) -> LabelledImage | Known | Refused:
    name = _shown(item.name)
    if item.data is None:
        return Refused(name, item.reason)
    try:
        if content_hash(item.data) not in project.images:
            check_side(item.data)
        one = project.add(item.data, name, _label_of(project, item.name, label))
    except ImageError as error:
        return Refused(name, str(error))
    split = _split_of(item.name)
    if split is not None:
        project.set_splits([one.image.id], split)
    image = project.images[one.image.id]
    return image if one.is_new else Known(name, image)


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


def _given(files: Iterable[tuple[str, bytes]]) -> Iterator[_Incoming]:
    """Files with the names that they would have in a ZIP; a file in no folder is never hidden."""
    for name, data in files:
        parts = _parts(name)
        if len(parts) < 2 or not any(map(_hidden, parts)):
            yield _Incoming("/".join(parts) or name, data)


def _parts(name: str) -> tuple[str, ...]:
    """Folders and file; old programs write backslashes."""
    return PurePosixPath(name.replace("\\", "/").lstrip("/")).parts


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
        listed = [(entry, _parts(entry.filename)) for entry in archive.infolist()]
        wanted = [
            (number, entry, parts)
            for number, (entry, parts) in enumerate(listed)
            if parts and not entry.is_dir() and not any(map(_hidden, parts))
        ]
        total = 0
        for number, entry, parts in wanted:
            if number >= MAX_ENTRIES or total > MAX_TOTAL_BYTES:
                yield _Incoming(file.name, None, _too_much())
                return
            item = _read_entry(archive, entry, str(PurePosixPath(within, *parts)))
            total += len(item.data or b"")
            yield replace(item, n_files=len(wanted))


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
