"""What the folders in a file's name say: the state and the side of its picture."""

from pathlib import PurePosixPath
from typing import Final

from vqa_state.project.split import Split
from vqa_state.questions.states import StateNames

__all__ = ["folder_label", "folder_split", "is_hidden", "name_parts", "printable", "why_no_label"]

_IGNORED: Final = {"thumbs.db", "desktop.ini", "__macosx"}
_SIDES: Final = {split.value: split for split in Split}
_NO_FOLDERS: Final = {"..", "~"}
_MOST_SHOWN: Final = 80


def name_parts(name: str) -> tuple[str, ...]:
    """Folders and file; old programs write backslashes."""
    return PurePosixPath(name.replace("\\", "/").lstrip("/")).parts


def is_hidden(part: str) -> bool:
    """Whether a folder or file is one that systems leave behind, or hide."""
    return (part.startswith(".") and part != "..") or part.casefold() in _IGNORED


def printable(name: str) -> str:
    """A name without what a screen or a file cannot hold."""
    return "".join(c if c.isprintable() else "\ufffd" for c in name)


def folder_label(name: str, states: StateNames) -> int | None:
    """+1 or -1 by the innermost folder that is named as a state, or None."""
    labels = (states.label(folder) for folder in reversed(PurePosixPath(name).parts[:-1]))
    return next((label for label in labels if label is not None), None)


def folder_split(name: str) -> Split | None:
    """The side by the innermost folder that is named as one, or None."""
    folders = (folder.casefold() for folder in reversed(PurePosixPath(name).parts[:-1]))
    return next((_SIDES[folder] for folder in folders if folder in _SIDES), None)


def why_no_label(name: str, states: StateNames) -> tuple[str, str]:
    """For a name whose folders give no label: the folders that do not, or "", and the reason."""
    folders = PurePosixPath(name).parts[:-1]
    if all(folder.casefold() in _SIDES or folder in _NO_FOLDERS for folder in folders):
        return "", "no folder names a state"
    path = printable("/".join(folders))
    shown = path if len(path) <= _MOST_SHOWN else f"…{path[-_MOST_SHOWN:]}"
    return shown, f"folder '{shown}' is none of {states.positive}, {states.negative}"
