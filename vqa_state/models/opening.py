"""Makes the model that an address names; loads what its family needs, and nothing else."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from vqa_state.errors import ModelError
from vqa_state.models._base import VQAModel
from vqa_state.models.address import ModelAddress, Source
from vqa_state.models.hub.snapshots import cached_folder
from vqa_state.models.import_faults import import_fault
from vqa_state.models.local.families import Family, family_of, missing_weights
from vqa_state.models.local.loading import loading
from vqa_state.models.local.runtime import choose_runtime

__all__ = ["folder_of", "open_model"]

#: Family -> module and class; all take (folder, name, runtime, prompt).
_CLASSES = {
    Family.BLIP: ("vqa_state.models.local.blip", "BlipModel"),
    Family.VILT: ("vqa_state.models.local.vilt", "ViltModel"),
    Family.OFA: ("vqa_state.models.local.ofa.model", "OfaModel"),
    Family.CHAT: ("vqa_state.models.chat.model", "ChatModel"),
}


def open_model(address: ModelAddress) -> VQAModel:
    """Load a local model, or make the client of a server.

    Raises:
        MissingPackageError: if a package that it needs is not installed.
        ModelError: if it is not on this disk, is damaged or of a kind that we cannot use.
    """
    name = str(address)
    try:
        if address.source is Source.SERVER:
            server = import_module("vqa_state.models.server.model")
            return server.ServerModel(  # type: ignore[no-any-return]
                address.where, address.model, name, address.prompt
            )
        folder = folder_of(address)
        runtime = choose_runtime(address.device, address.precision)
        module, kind = _CLASSES[_usable(folder)]
        with _without_bars(), loading(folder, name):
            made = getattr(import_module(module), kind)(folder, name, runtime, address.prompt)
    except ImportError as error:
        fault = import_fault(name, error)
        if fault is None:
            raise  # our own mistake, not a missing package
        raise fault from error
    return made  # type: ignore[no-any-return]


@contextmanager
def _without_bars() -> Iterator[None]:
    """The library draws bars of its own while it loads; whoever called us draws ours."""
    from transformers.utils import logging

    drawn = logging.is_progress_bar_enabled()
    logging.disable_progress_bar()  # type: ignore[no-untyped-call]
    try:
        yield
    finally:
        if drawn:
            logging.enable_progress_bar()  # type: ignore[no-untyped-call]


def folder_of(address: ModelAddress) -> Path:
    """The folder of a local model.

    Raises:
        ModelError: if it is not on this disk.
    """
    if address.source is Source.HUB:
        return cached_folder(address)
    try:
        folder = Path(address.where).expanduser()
        is_there = folder.is_dir()
    except (OSError, RuntimeError):  # a name that is too long, the home of a user that is none
        folder, is_there = Path(address.where), False
    if not is_there:
        raise ModelError(
            f"there is no folder {str(folder)[:200]}; copy the model there, or name the folder "
            "that holds it"
        )
    return folder


def _usable(folder: Path) -> Family:
    family, missing = family_of(folder), missing_weights(folder)
    if not missing:
        return family
    if (folder / "pytorch_model.bin").is_file():
        raise ModelError(
            f"{folder} holds its weights as pytorch_model.bin, which is not read; make a safe copy "
            f"of them once with: python -m vqa_state models convert {str(folder)!r}"
        )
    raise ModelError(f"{folder} lacks {', '.join(missing[:3])}; download or copy the model again")
