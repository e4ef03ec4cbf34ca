"""Weights: read from safetensors only; an older kind of file is converted once, on request."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from vqa_state.errors import ModelError
from vqa_state.models.local.families import missing_weights, read_config
from vqa_state.models.local.ofa.config import OfaConfig

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from vqa_state.models.local.ofa.network import OfaNetwork

__all__ = ["content_digest", "convert_checkpoint", "load_network"]

_UNSAFE = "pytorch_model.bin"
_WEIGHTS = "model.safetensors"
_INDEX = "model.safetensors.index.json"

#: What else of a folder can change an answer.
_TEXTS = ("config.json", "configuration.json", "vocab.json", "merges.txt")

_TABLE = "encoder.embed_tokens.weight"

#: Two more names of the table of words.
_TIED = ("decoder.embed_tokens.weight", "decoder.output_projection.weight")


def convert_checkpoint(folder: Path, target: Path | None = None) -> Path:
    """Write the weights of `pytorch_model.bin` as `model.safetensors`.

    Nothing else in it is read: with `weights_only`, torch refuses all that is not numbers.
    The same checkpoint gives the same bytes, wherever it is written.

    Args:
        folder: of the checkpoint.
        target: folder to write to; the same one if None.

    Returns:
        The file.

    Raises:
        ModelError: if the checkpoint is missing, damaged, or holds more than weights, or if the
            file cannot be written. An older file is then as it was.
    """
    import torch

    source = folder / _UNSAFE
    try:
        loaded = torch.load(source, map_location="cpu", weights_only=True)
    except Exception as error:  # a damaged or hostile file makes it raise nearly anything
        raise ModelError(
            f"{source} cannot be converted ({type(error).__name__}: {_first_line(error)}); it must "
            "be a file of weights and nothing else: download or copy the model again"
        ) from error
    if not isinstance(loaded, dict) or not all(map(torch.is_tensor, loaded.values())):
        raise ModelError(
            f"{source} holds other things than weights; a checkpoint for fairseq must first be "
            "saved in the format of transformers"
        )
    return _write(_each_once(loaded, source), (target or folder) / _WEIGHTS)


def load_network(folder: Path, config: OfaConfig, dtype: "torch.dtype") -> "OfaNetwork":
    """The network with the folder's weights, on the processor, ready to answer.

    Raises:
        ModelError: if the weights are missing, damaged, not converted or of another network.
    """
    import torch

    from vqa_state.models.local.ofa.network import OfaNetwork, fixed_buffers

    state = fixed_buffers(config) | _read(folder)
    state |= {name: state[_TABLE] for name in _TIED if _TABLE in state}
    for name, value in state.items():
        if value.is_floating_point():
            state[name] = value.to(dtype)
    with torch.device("meta"):
        network = OfaNetwork(config)
    for name, value in network.state_dict().items():
        if name.endswith("num_batches_tracked"):  # of training; old files lack it
            state.setdefault(name, torch.zeros_like(value, device="cpu"))
    try:
        network.load_state_dict(state, assign=True)
    except RuntimeError as error:
        raise ModelError(
            f"the weights in {folder} do not fit its config.json ({_first_line(error, 3)}); "
            "download or copy the model again"
        ) from error
    network.tie()
    return network.eval().requires_grad_(False)


def content_digest(folder: Path) -> str:
    """First 16 hex digits of the SHA-256 of the folder's settings, words and safetensors files.

    Raises:
        ModelError: if a file is missing or cannot be read.
    """
    names = [name for name in _TEXTS if (folder / name).is_file()] + _weight_files(folder)
    digest = hashlib.sha256()
    try:
        for name in names:
            with (folder / name).open("rb") as file:
                digest.update(
                    f"{name} {hashlib.file_digest(file, 'sha256').hexdigest()}\n".encode()
                )
    except OSError as error:
        raise ModelError(f"cannot read {folder / name} ({error.strerror})") from error
    return digest.hexdigest()[:16]


def _weight_files(folder: Path) -> list[str]:
    missing = missing_weights(folder)
    if missing and (folder / _UNSAFE).is_file():
        raise ModelError(
            f"{folder} holds its weights as {_UNSAFE}, which is not read; make a safe copy of "
            f"them once with: python -m vqa_state models convert {str(folder)!r}"
        )
    if missing:
        raise ModelError(
            f"{folder} lacks {', '.join(missing[:3])}; download or copy the model again"
        )
    if (folder / _WEIGHTS).is_file():
        return [_WEIGHTS]
    return sorted(set(read_config(folder, _INDEX)["weight_map"].values()))


def _read(folder: Path) -> "dict[str, Tensor]":
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    state: dict[str, Tensor] = {}
    for name in _weight_files(folder):
        try:
            state |= load_file(folder / name)
        except (OSError, SafetensorError) as error:
            raise ModelError(
                f"{folder / name} is damaged ({error}); download or convert the model again"
            ) from error
    return state


def _each_once(state: "Mapping[str, Tensor]", source: Path) -> "dict[str, Tensor]":
    """One copy of the table of words, and no memory shared; the file format takes neither."""
    for name in _TIED:
        if name in state and not (_TABLE in state and state[name].equal(state[_TABLE])):
            raise ModelError(f"{source}: {name} is another table than {_TABLE}; this is no OFA")
    seen: set[int] = set()
    single = {}
    for name, value in state.items():
        if name not in _TIED:
            single[name] = value.clone() if value.data_ptr() in seen else value.contiguous()
            seen.add(value.data_ptr())
    return single


def _write(state: "dict[str, Tensor]", path: Path) -> Path:
    from safetensors.torch import save_file

    unfinished = path.with_suffix(".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_file(state, unfinished, metadata={"format": "pt"})
        unfinished.replace(path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise ModelError(
            f"cannot write {path} ({error.strerror or error}); check free disk space and "
            "permissions, or name another folder"
        ) from error
    return path


def _first_line(error: Exception, n_lines: int = 1) -> str:
    return " ".join(str(error).split("\n")[:n_lines])[:300]
