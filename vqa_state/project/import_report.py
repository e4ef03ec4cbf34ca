"""What became of files that were to be added: new images, known ones, refused ones, unlabelled."""

from collections import Counter
from dataclasses import dataclass

from vqa_state.project.schema import LabelledImage

__all__ = ["Batch", "ImportReport", "Known", "Refused", "Unlabelled"]


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
class Unlabelled:
    """An image that has no label yet, and why its file gave it none.

    Attributes:
        name: of the file.
        reason: in words; the same for all files of a folder.
        folder: the folders that name no state, or "" if it lies in none that could.
        image_id: of the image, which was added or was there already.
    """

    name: str
    reason: str
    folder: str
    image_id: str


@dataclass(frozen=True, slots=True)
class Batch:
    """What became of the next few files.

    Attributes:
        n_done: files so far, those of earlier batches included.
        n_files: files in all.
        added: new images.
        known: files that were there already.
        refused: files that were skipped.
        unlabelled: files whose image, added or known, has no label.
    """

    n_done: int
    n_files: int
    added: tuple[LabelledImage, ...] = ()
    known: tuple[Known, ...] = ()
    refused: tuple[Refused, ...] = ()
    unlabelled: tuple[Unlabelled, ...] = ()


@dataclass(frozen=True, slots=True)
class ImportReport:
    """What became of each file.

    Attributes:
        added: ids of new images.
        already_there: ids of images that were there already.
        refused: files that were skipped.
        unlabelled: images of both kinds that have no label, each once.
    """

    added: tuple[str, ...]
    already_there: tuple[str, ...]
    refused: tuple[Refused, ...]
    unlabelled: tuple[Unlabelled, ...] = ()

    def reasons(self) -> list[tuple[str, int]]:
        """Why images have no label, and of how many each reason holds; the most first."""
        return Counter(one.reason for one in self.unlabelled).most_common()

    def sentence(self) -> str:
        """The report in one line, for a status field."""
        parts = [f"{len(self.added)} added"]
        if self.already_there:
            parts.append(f"{len(self.already_there)} already there (same bytes)")
        if self.unlabelled:
            (first, _), *others = self.reasons()
            most = ", the most" if others else ""
            parts.append(f"{len(self.unlabelled)} without a label{most}: {first}")
        if self.refused:
            one = self.refused[0]
            parts.append(f"{len(self.refused)} refused, the first: {one.name}: {one.reason}")
        return "; ".join(parts)
