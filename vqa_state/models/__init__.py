"""VQA models by name or address. Each is imported only when it is first made."""

from collections.abc import Callable
from importlib import import_module

from vqa_state.errors import UnknownModelError
from vqa_state.models._base import Failure, Interruptible, Reply, VQAModel
from vqa_state.models.address import ModelAddress
from vqa_state.models.approval import approve, check_approved, from_anywhere
from vqa_state.models.import_faults import import_fault
from vqa_state.models.plugins import make_plugin, plugin_names

__all__ = [
    "Factory",
    "Failure",
    "Interruptible",
    "Reply",
    "VQAModel",
    "choose",
    "create",
    "load_model",
    "names",
    "register",
]

Factory = Callable[[], VQAModel]


def register(name: str, factory: Factory) -> None:
    """Make `factory` available as `name`.

    Raises:
        ValueError: if the name is taken; silently replacing a model would change results without
            a trace.
    """
    if name in names():
        raise ValueError(f"a model is already registered as {name!r}")
    _factories[name] = factory


def names() -> list[str]:
    """Registered names in order of registration, then those of installed packages, sorted."""
    return list(dict.fromkeys((*_factories, *plugin_names())))


def choose(name: str) -> str:
    """What the user typed or picked as a model: remember the yes, and give the name to keep.

    Call it only for a user's own choice, never for what a file says.

    Raises:
        UnknownModelError: if it is neither a registered name nor an address.
        ModelError: if the address cannot be used.
        ProjectError: if the yes cannot be written.
    """
    address = _parsed(name)
    if address is None:
        return name
    address = from_anywhere(address)
    approve(address)
    return str(address)


def load_model(name: str, *, approve: bool = False) -> VQAModel:
    """Load a model by name or address, ready to answer.

        model = load_model("embedded")
        model = load_model("hub:Salesforce/blip-vqa-base", approve=True)

    Args:
        name: "embedded", a registered name, one of an installed package (`models.plugins`), or an
            address: hub:OWNER/NAME, folder:/path/to/model, server:http://host:port/v1#MODEL.
        approve: say yes to a model from outside this package, once for this machine. Leave it out
            for a name that a file gives.

    Raises:
        UnknownModelError: if there is no such name.
        NotApprovedError: if nobody said yes to this model on this machine.
        MissingPackageError: if a package that it needs is not installed.
        ModelError: if it is not on this disk, its weights are damaged, or its package is broken.
    """
    return create(choose(name) if approve else name)


def create(name: str) -> VQAModel:
    """Load the model called `name`: a registered name, or an address (`models.address`).

    Raises:
        UnknownModelError: if it is neither.
        NotApprovedError: if the user never chose this model on this machine.
        MissingPackageError: if a package that it needs is not installed.
        ModelError: if it is not on this disk, or its weights are damaged.
    """
    address = _parsed(name)
    if address is not None:
        check_approved(address)
        from vqa_state.models.opening import open_model

        return open_model(address)
    if name in plugin_names():
        return make_plugin(name, is_taken=name in _factories)
    try:
        return _factories[name]()
    except ImportError as error:
        fault = import_fault(name, error)
        if fault is None:
            raise  # our own mistake, not a missing package
        raise fault from error


def _parsed(name: str) -> ModelAddress | None:
    """The address, or None for a registered name."""
    if name in names():
        return None
    if ":" not in name:
        raise UnknownModelError(name, names())
    return ModelAddress.parse(name)


def _embedded() -> VQAModel:
    return import_module("vqa_state.models.embedded.model").EmbeddedModel()  # type: ignore[no-any-return]


_factories: dict[str, Factory] = {"embedded": _embedded}
