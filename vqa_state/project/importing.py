"""Many pictures at once: files, a folder, or a ZIP whose folders name the states.

What got no label by its folders is told with the reason; it waits for a person's label.
"""

import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from itertools import chain, islice
from pathlib import Path

from vqa_state.errors import ImageError
from vqa_state.images import MAX_BYTES, check_side, content_hash
from vqa_state.project.folder_names import (
    folder_label,
    folder_split,
    is_hidden,
    name_parts,
    printable,
    why_no_label,
)
from vqa_state.project.import_report import Batch, ImportReport, Known, Refused, Unlabelled
from vqa_state.project.project import LabelledImage, Project, StateNames
from vqa_state.project.zip_entries import Incoming, ZipLimits, zip_entries

__all__ = [
    "Batch",
    "ImportReport",
    "Known",
    "Refused",
    "Unlabelled",
    "add_files",
    "add_folder",
    "add_zip",
    "added_in_batches",
    "in_turn",
    "still_unlabelled",
]

MAX_ENTRIES = 20_000
MAX_TOTAL_BYTES = 2_000_000_000
_BATCH_FILES = 8
_BATCH_SECONDS = 0.25
"""A batch takes no further file after this time: others wait for the project so long."""
_BREATH_SECONDS = 0.01
"""A lock is not fair: those that wait for it get a moment."""


Opened = Callable[[], AbstractContextManager[Project]]


@contextmanager
def in_turn(project: Project) -> Iterator[Project]:
    """The project for one batch that is saved at its end; then others get their turn."""
    with project.changing():
        yield project
    time.sleep(_BREATH_SECONDS)


def add_files(
    project: Project, files: Iterable[tuple[str, bytes]], label: int | None = None
) -> ImportReport:
    """Add pictures and ZIP files by name and content; names may have folders, as in a ZIP."""
    return _add(project, _expanded(_given(files), lambda: project.states), label)


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

    def states() -> StateNames:
        with opened() as project:
            return project.states

    yield from _batches(opened, _expanded(_given([(name, data)]), states), None)


def add_folder(
    project: Project, folder: Path, label: int | None = None, *, opened: Opened | None = None
) -> ImportReport:
    """Add every file below a folder, or one file; links are not followed, hidden files passed over.

    A folder named as a state labels its pictures; one named train, test or unused gives the side.

    Args:
        project: gets the pictures.
        folder: or a file.
        label: for pictures in no folder that is named as a state.
        opened: as for `added_in_batches`; without it nothing is saved.

    Raises:
        ImageError: if there is no such file or folder.
    """
    try:
        folder.stat()
    except (OSError, ValueError) as error:
        raise ImageError(
            f"there is no file or folder {folder} ({error}); check the path"
        ) from error
    files = _files_below(folder, project.folder)
    return _add(project, _expanded(files, lambda: project.states), label, opened)


def add_zip(project: Project, data: bytes, label: int | None = None) -> ImportReport:
    """Add every picture of a ZIP; see `add_folder` for what its folders mean."""
    return _add(project, _entries(Incoming("ZIP", data), lambda: project.states), label)


def still_unlabelled(project: Project, found: Iterable[Unlabelled]) -> tuple[Unlabelled, ...]:
    """Those whose image has no label now, each image once: a later file may have labelled it."""
    by_id = {one.image_id: one for one in found}
    waiting = {image.id for image in project.images.values() if image.label is None}
    return tuple(one for image_id, one in by_id.items() if image_id in waiting)


def _add(
    project: Project,
    incoming: Iterable[Incoming],
    label: int | None,
    opened: Opened | None = None,
) -> ImportReport:
    batches = list(_batches(opened or (lambda: nullcontext(project)), incoming, label))
    return ImportReport(
        tuple(image.id for batch in batches for image in batch.added),
        tuple(known.image.id for batch in batches for known in batch.known),
        tuple(refused for batch in batches for refused in batch.refused),
        still_unlabelled(project, (one for batch in batches for one in batch.unlabelled)),
    )


def _batches(opened: Opened, incoming: Iterable[Incoming], label: int | None) -> Iterator[Batch]:
    files, n_done = iter(incoming), 0
    for first in files:
        few, unlabelled = [], []
        with opened() as project:
            for item in _few(chain([first], files)):
                few.append(_taken(project, item, label))
                unlabelled += _without_label(project, item.name, few[-1])
        n_done += len(few)
        yield Batch(
            n_done,
            max(n_done, first.n_files),  # a ZIP that is too large is refused after its files
            tuple(one for one in few if isinstance(one, LabelledImage)),
            tuple(one for one in few if isinstance(one, Known)),
            tuple(one for one in few if isinstance(one, Refused)),
            tuple(unlabelled),
        )


def _few(files: Iterator[Incoming]) -> Iterator[Incoming]:
    began = time.monotonic()
    for file in islice(files, _BATCH_FILES):
        yield file
        if time.monotonic() - began > _BATCH_SECONDS:
            return


def _taken(project: Project, item: Incoming, label: int | None) -> LabelledImage | Known | Refused:
    name = printable(item.name)
    if item.data is None:
        return Refused(name, item.reason)
    try:
        if content_hash(item.data) not in project.images:
            check_side(item.data)
        own = folder_label(item.name, project.states)
        one = project.add(item.data, name, label if own is None else own)
    except ImageError as error:
        return Refused(name, str(error))
    split = folder_split(item.name)
    if split is not None:
        project.set_splits([one.image.id], split)
    image = project.images[one.image.id]
    return image if one.is_new else Known(name, image)


def _without_label(
    project: Project, name: str, one: LabelledImage | Known | Refused
) -> list[Unlabelled]:
    image = one.image if isinstance(one, Known) else one
    if isinstance(image, Refused) or image.label is not None:
        return []
    folder, reason = why_no_label(name, project.states)
    return [Unlabelled(printable(name), reason, folder, image.id)]


def _given(files: Iterable[tuple[str, bytes]]) -> Iterator[Incoming]:
    """Files with the names that they would have in a ZIP; a file in no folder is never hidden."""
    for name, data in files:
        parts = name_parts(name)
        if len(parts) < 2 or not any(map(is_hidden, parts)):
            yield Incoming("/".join(parts) or name, data)


def _expanded(files: Iterable[Incoming], states: Callable[[], StateNames]) -> Iterator[Incoming]:
    for file in files:
        data = file.data or b""
        if data[:4] == b"PK\x03\x04" or (file.name.lower().endswith(".zip") and data):
            yield from _entries(file, states)
        else:
            yield file


def _files_below(path: Path, project_folder: Path) -> Iterator[Incoming]:
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
        folders[:] = sorted(f for f in folders if not is_hidden(f))
        for name in sorted(n for n in names if not is_hidden(n)):
            file = Path(folder) / name
            if file.is_file() and not file.is_symlink():
                yield _limited(file, (Path(path.name) / file.relative_to(path)).as_posix())
    for error in unread:
        yield Incoming(str(error.filename), None, f"the folder cannot be read ({error.strerror})")


def _limited(path: Path, name: str) -> Incoming:
    """At most one byte (ZIP: one whole limit) more than is allowed, so that it is refused."""
    limit = MAX_TOTAL_BYTES if path.suffix.lower() == ".zip" else MAX_BYTES
    try:
        with path.open("rb") as file:
            return Incoming(name, file.read(limit + 1))
    except OSError as error:
        return Incoming(name, None, f"the file cannot be read ({error.strerror})")


def _entries(file: Incoming, states: Callable[[], StateNames]) -> Iterator[Incoming]:
    limits = ZipLimits(MAX_ENTRIES, MAX_TOTAL_BYTES, entry_bytes=MAX_BYTES)
    return zip_entries(file, states, limits)
