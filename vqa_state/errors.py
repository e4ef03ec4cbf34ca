"""Every error that this package raises on purpose.

VQAStateError
├── ImageError             a picture is damaged, too large or of a kind that we do not read
├── QuestionError          a wording, a state phrase or a question cannot be used
├── ProjectError           a project folder is missing, damaged, newer than this program or busy
│   └── ConflictError      two programs changed the same thing of a project in two ways
├── StoreError             the answer store cannot be read or written
├── ModelError             a model cannot be loaded, or gave no usable reply
│   ├── UnknownModelError  no model has that name
│   ├── NotApprovedError   the user has not yet said yes to this model on this machine
│   └── MissingPackageError  the model needs a package that is not installed
├── MissingExtraError      a part of the program was left out when it was installed
├── NothingToSearchError   the project has too little to choose questions from
│   └── MissingAnswersError  images lack answers, and nobody said that the others are enough
└── RecognizerError        a recognizer file is damaged, newer than this program, for another model

A message names what was given, what is allowed and what to do next; the app and the command
line show it as it is.
"""

from importlib.util import find_spec
from typing import Final

__all__ = [
    "EXTRAS",
    "ImageError",
    "MissingExtraError",
    "MissingPackageError",
    "ModelError",
    "NotApprovedError",
    "NothingToSearchError",
    "ProjectError",
    "QuestionError",
    "RecognizerError",
    "StoreError",
    "UnknownModelError",
    "VQAStateError",
    "require_package",
]

EXTRAS: Final = {
    "deap": "search",
    "fastapi": "app",
    "gradio": "app",
    "ortools": "search",
    "starlette": "app",
    "tokenizers": "local",
    "transformers": "local",
    "uvicorn": "app",
}
"""Packages that a plain installation lacks, and the extra of pyproject.toml that brings each."""


class VQAStateError(Exception):
    """Base class: the command line and the app show its message and carry on."""


class ImageError(VQAStateError):
    """A picture is damaged, too large or of a kind that we do not read."""


class QuestionError(VQAStateError):
    """A wording, a state phrase or a question cannot be used."""


class ProjectError(VQAStateError):
    """A project folder is missing, damaged, newer than this program or busy."""


class ConflictError(ProjectError):
    """Two programs changed the same thing of a project in two ways."""

    def __init__(self, conflicts: list[str]) -> None:
        more = f"; and {len(conflicts) - 3} more" if len(conflicts) > 3 else ""
        super().__init__(
            f"not saved: {'; '.join(conflicts[:3])}{more}. The project was changed by another "
            "program since it was opened; open it again, look, and repeat what is still right"
        )


class StoreError(VQAStateError):
    """The answer store cannot be read or written."""


class ModelError(VQAStateError):
    """A model cannot be loaded, or gave no usable reply."""


class UnknownModelError(ModelError):
    """No model has that name."""

    def __init__(self, name: str, known: list[str]) -> None:
        super().__init__(
            f"unknown model {name!r}; choose one of: {', '.join(sorted(known))}, or give an "
            "address: hub:OWNER/NAME, folder:/path/to/model, server:http://host:port/v1#MODEL"
        )


class NotApprovedError(ModelError):
    """The user has not yet said yes to this model on this machine."""

    def __init__(self, model: str, plain: str) -> None:
        super().__init__(
            f"the model {model!r} was never used on this machine, so it is not loaded or called "
            "because a file names it; if you trust it, say so in the app or with: "
            f"python -m vqa_state models approve {plain!r}"
        )


class MissingPackageError(ModelError):
    """The model needs a package that is not installed."""

    def __init__(self, model: str, package: str) -> None:
        super().__init__(
            f"the model {model!r} needs the package {package!r}, which is not installed; "
            f"install it with: {_command(package)}"
        )


class MissingExtraError(VQAStateError):
    """A part of the program was left out when it was installed."""

    def __init__(self, what: str, package: str) -> None:
        super().__init__(
            f"{what} needs the package {package!r}, which is not installed; install it with: "
            f"{_command(package)}"
        )


class NothingToSearchError(VQAStateError):
    """The project has too little to choose questions from."""


class MissingAnswersError(NothingToSearchError):
    """Images lack answers, and nobody said that the others are enough."""


class RecognizerError(VQAStateError):
    """A recognizer file is damaged, newer than this program or for another model."""


def require_package(package: str, what: str) -> None:
    """Do nothing if a package of an extra is installed; it is not imported.

    Raises:
        MissingExtraError: if it is not; the message says how to install it for `what`.
    """
    if find_spec(package) is None:
        raise MissingExtraError(what, package)


def _command(package: str) -> str:
    extra = EXTRAS.get(package)
    return f"pip install {package}" if extra is None else f"pip install 'vqa-state[{extra}]'"
