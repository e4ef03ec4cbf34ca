"""Whether a model is on this disk, and what is still to do before it can be used."""

from enum import StrEnum
from pathlib import Path

from vqa_state.errors import ModelError
from vqa_state.models.address import ModelAddress, Source
from vqa_state.models.local.families import missing_weights, read_config
from vqa_state.models.opening import folder_of

__all__ = ["Standing", "convert", "standing"]

_OLD_WEIGHTS = "pytorch_model.bin"


class Standing(StrEnum):
    """How far a model is."""

    READY = "ready"
    """It can be loaded, or it is behind a server."""
    ABSENT = "absent"
    """It is not here, or files are missing."""
    OLD_WEIGHTS = "old weights"
    """All of it is here, but its weights are of a kind that is converted first."""


def standing(address: ModelAddress) -> Standing:
    """How far the model is; nothing is asked of a network."""
    if address.source is Source.SERVER:
        return Standing.READY
    try:
        folder = folder_of(address)
        read_config(folder)
        if not missing_weights(folder):
            return Standing.READY
    except ModelError:
        return Standing.ABSENT
    is_old = (folder / _OLD_WEIGHTS).is_file()
    return Standing.OLD_WEIGHTS if is_old else Standing.ABSENT


def convert(address: ModelAddress) -> Path:
    """Write the weights of a model on this disk as safetensors; no code in it is run.

    Returns:
        The file.

    Raises:
        ModelError: if there is nothing to convert, it is damaged, or the file cannot be written.
    """
    from vqa_state.models.local.ofa.loading import convert_checkpoint

    if standing(address) is not Standing.OLD_WEIGHTS:
        raise ModelError(f"{address} holds no {_OLD_WEIGHTS} to convert on this disk")
    return convert_checkpoint(folder_of(address))
