"""What the words of a command mean: a path, or the images of a project."""

from collections.abc import Iterable
from pathlib import Path

import typer

from vqa_state.errors import ProjectError
from vqa_state.project.project import LabelledImage, Project

__all__ = ["chosen_images", "given_path"]

#: First letters of an id, at least; fewer are a slip more often than a choice.
_FEWEST_LETTERS = 4

_SHOWN = 5  # images that an error names


def given_path(text: str) -> Path:
    """A path as typed. An empty one is none: pathlib would take it for the current folder.

    Raises:
        BadParameter: if it is empty.
    """
    if not text:
        raise typer.BadParameter("a path is empty; type '.' if you mean the current folder")
    return Path(text)


def chosen_images(project: Project, words: Iterable[str]) -> list[str]:
    """The ids of the images that words stand for: one image a word, each named once.

    A word is an image's name, or else the first letters of its id.

    Raises:
        ProjectError: if a word is too short, or stands for no image or for several.
    """
    return list(dict.fromkeys(_chosen(project, word) for word in words))


def _chosen(project: Project, word: str) -> str:
    images = project.images.values()
    fitting = [image for image in images if image.name == word]
    if not fitting and len(word) < _FEWEST_LETTERS:
        raise ProjectError(
            f"no image is named {word!r}; give a name, or at least {_FEWEST_LETTERS} letters with "
            "which an id begins (label PROJECT lists both)"
        )
    fitting = fitting or [image for image in images if image.id.startswith(word)]
    if not fitting:
        raise ProjectError(
            f"no image is named {word!r} or has an id that begins so; label PROJECT lists both"
        )
    if len(fitting) > 1:
        raise ProjectError(
            f"{word!r} stands for {len(fitting)} images ({_listed(fitting)}); give more letters of "
            "the id of each image that you mean"
        )
    return fitting[0].id


def _listed(images: list[LabelledImage]) -> str:
    shown = ", ".join(f"{image.id:.12} {image.name}" for image in images[:_SHOWN])
    return shown + (", …" if len(images) > _SHOWN else "")
