"""VQA models by name. Each is imported only when it is first made."""

from collections.abc import Callable
from importlib import import_module

from vqa_state.errors import MissingPackageError, UnknownModelError
from vqa_state.models.base import Failure, Reply, VQAModel

__all__ = ["Factory", "Failure", "Reply", "VQAModel", "create", "names", "register"]

Factory = Callable[[], VQAModel]


def register(name: str, factory: Factory) -> None:
    """Make `factory` available as `name`.

    Raises:
        ValueError: if the name is taken; silently replacing a model would change results without
            a trace.
    """
    if name in _factories:
        raise ValueError(f"a model is already registered as {name!r}")
    _factories[name] = factory


def names() -> list[str]:
    """Registered names, in order of registration."""
    return list(_factories)


def create(name: str) -> VQAModel:
    """Load the model called `name`.

    Raises:
        UnknownModelError: if nothing is registered under `name`.
        MissingPackageError: if a package that it needs is not installed.
        ModelError: if its weights are missing or damaged.
    """
    if name not in _factories:
        raise UnknownModelError(name, names())
    try:
        return _factories[name]()
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("vqa_state"):
            raise  # our own mistake, not a missing package
        raise MissingPackageError(name, error.name) from error


def _embedded() -> VQAModel:
    return import_module("vqa_state.models.embedded").EmbeddedModel()  # type: ignore[no-any-return]


_factories: dict[str, Factory] = {"embedded": _embedded}
