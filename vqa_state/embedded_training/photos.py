"""Labelled photos beside the rendered scenes: one half trains, the other half only measures."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from vqa_state.embedded_training.dataset import Example
from vqa_state.errors import ProjectError

__all__ = ["PHOTO_FOLDERS", "is_training_photo", "load_photos"]

#: Folder of a photo set -> the thing that it shows. Below it: open/ID.jpg and closed/ID.jpg.
PHOTO_FOLDERS: Mapping[str, str] = MappingProxyType(
    {"refrigerator_open": "refrigerator", "door_open": "door", "cabinet_or_drawer_open": "cabinet"}
)


def is_training_photo(path: Path) -> bool:
    """Whether a photo may train. The id decides, since one photo may be cut for two folders."""
    return hashlib.sha256(path.stem.encode()).digest()[0] % 2 == 0


def load_photos(folder: Path, *, training: bool) -> list[Example]:
    """The training half or the measuring half of all photo sets, ordered by path.

    Raises:
        ProjectError: if the folder holds none of the known photo sets.
    """
    examples = []
    for name, thing in PHOTO_FOLDERS.items():
        for state in ("open", "closed"):
            for path in sorted((folder / name / state).glob("*.jpg")):
                if is_training_photo(path) == training:
                    scene = f"photo/{path.stem}"
                    examples.append(Example(path, thing, state == "open", {}, scene))
    if not examples:
        raise ProjectError(
            f"no photos in {folder}; expected {', '.join(PHOTO_FOLDERS)} with open/ and closed/"
        )
    return examples
