"""What an import that failed means for a user: which package to install, or to make fit."""

import re
from collections.abc import Iterator
from traceback import walk_tb

from vqa_state.errors import MissingPackageError, ModelError

__all__ = ["import_fault", "misfit", "missing_package"]

#: Libraries as transformers calls them in its errors -> what pip calls them.
_PACKAGES = {
    "Torchvision": "torchvision",
    "SentencePiece": "sentencepiece",
    "protobuf": "protobuf",
    "PyAv": "av",
    "timm": "timm",
    "PIL": "pillow",
}

#: How it is said that a package is missing, the surest way first.
_ASKED_FOR = (
    r"requires the (?:🤗 )?([\w-]+) library",
    r"pip install (?:-U )?([A-Za-z][\w.-]*)",
    r"No module named '(\w+)",
)

#: Packages that a model shall never bring: `kernels` fetches native code from the hub and runs it.
_REFUSED = {"kernels"}


def import_fault(model: str, error: ImportError) -> ModelError | None:
    """The error to show instead, or None if the mistake is our own."""
    chain = list(_chain(error))
    if any((getattr(one, "name", None) or "").startswith("vqa_state") for one in chain):
        return None
    if fault := misfit(model, error):
        return fault
    for one in chain:
        if package := missing_package(str(one)):
            return MissingPackageError(model, package)
    return ModelError(
        f"the model {model!r} cannot be loaded, for a package cannot be imported "
        f"({type(chain[-1]).__name__}: {str(chain[-1])[:200]}); install it again"
    )


def missing_package(message: str) -> str | None:
    """The package that an ImportError of transformers asks for, as pip calls it."""
    found = None
    for pattern in _ASKED_FOR:
        found = found or re.search(pattern, message)
    package = _PACKAGES.get(found[1], found[1].lower()) if found else None
    return None if package in _REFUSED else package


def misfit(model: str, error: BaseException) -> ModelError | None:
    """What to say if torchvision, which transformers imports where it is, breaks at its import."""
    broken = next((one for one in _chain(error) if _comes_from(one, "torchvision")), None)
    if broken is None:
        return None
    return ModelError(
        f"the model {model!r} cannot be loaded, for the installed torchvision does not fit torch "
        f"{_installed('torch')} ({type(broken).__name__}: {str(broken)[:200]}); install one that "
        f'does with: pip install "torchvision{_fitting()}" or remove it with: pip uninstall '
        "torchvision"
    )


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """An error and what caused it, outermost first."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__


def _comes_from(error: BaseException, package: str) -> bool:
    """Whether a module of this package was being imported as it was raised."""
    frames = (frame for frame, _ in walk_tb(error.__traceback__))
    return any(
        frame.f_code.co_name == "<module>"
        and frame.f_globals.get("__name__", "").split(".")[0] == package
        for frame in frames
    )


def _fitting() -> str:
    """As pip takes it; torchvision 0.15 came with torch 2.0, and the two go on in step."""
    found = re.match(r"2\.(\d+)", _installed("torch"))
    return f"==0.{int(found[1]) + 15}.*" if found else ""


def _installed(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # a twentieth of a second

    try:
        return version(package)
    except PackageNotFoundError:
        return "(not installed)"
