"""Models of other installed packages, by the entry point group `vqa_state.models`.

A package offers one in its pyproject.toml, as a name and a factory without arguments:

    [project.entry-points."vqa_state.models"]
    brightness = "acme_models:BrightnessModel"

Its code is imported when that model is made, and not before.
"""

from functools import cache
from typing import TYPE_CHECKING

from vqa_state.errors import ModelError, VQAStateError
from vqa_state.models._base import VQAModel

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

__all__ = ["GROUP", "make_plugin", "plugin_names"]

GROUP = "vqa_state.models"
_PARTS = ("name", "fingerprint", "notes", "answer")


def plugin_names() -> list[str]:
    """Names that installed packages give to models, sorted, each once.

    A name with a colon would be an address, so it is left out.
    """
    return sorted({point.name for point in _entry_points() if ":" not in point.name})


def make_plugin(name: str, *, is_taken: bool = False) -> VQAModel:
    """Import the package that offers this model, and make the model.

    Args:
        name: one of `plugin_names`.
        is_taken: whether a model of this package, or a registered one, has the name.

    Raises:
        ModelError: if the name has two models, if the package's code raises, or if what it
            makes is no model; the message names the package.
    """
    point = _only(name, is_taken)
    package = _package(point)
    try:
        model = point.load()()
    except VQAStateError:
        raise
    except Exception as error:  # somebody else's code may raise anything
        raise ModelError(
            f"the model {name!r} of the package {package!r} cannot be made "
            f"({type(error).__name__}: {str(error)[:300]}); update that package, or uninstall it "
            f"with: pip uninstall {package}"
        ) from error
    lacking = [part for part in _PARTS if not hasattr(model, part)]
    if lacking:
        raise ModelError(
            f"what the package {package!r} offers as the model {name!r} is a "
            f"{type(model).__name__} without {', '.join(lacking)}; update that package "
            "(docs/models.md says what a model must have)"
        )
    made: VQAModel = model
    return made


def _only(name: str, is_taken: bool) -> "EntryPoint":
    found = [point for point in _entry_points() if point.name == name]
    packages = sorted(_package(point) for point in found)
    if is_taken or len(found) > 1:
        others = "another model here has that name" if is_taken else "there must be one"
        raise ModelError(
            f"a model called {name!r} is offered by {' and by '.join(packages)}, but {others}; "
            f"uninstall one, so that it is clear which model answers: pip uninstall {packages[-1]}"
        )
    return found[0]


def _package(point: "EntryPoint") -> str:
    return point.dist.name if point.dist else point.value.partition(":")[0]


@cache  # what is installed does not change while the program runs, and pages ask often
def _entry_points() -> tuple["EntryPoint", ...]:
    from importlib.metadata import entry_points  # takes a twentieth of a second

    return tuple(entry_points(group=GROUP))
