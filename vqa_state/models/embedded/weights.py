"""The weights file: safetensors, half precision, with what made it in its header."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save

from vqa_state.errors import ModelError
from vqa_state.models.embedded.network import VQANetwork
from vqa_state.storage.atomic_write import write_atomically

__all__ = [
    "SECONDS",
    "WEIGHTS",
    "count_parameters",
    "load_network",
    "load_stage",
    "read_header",
    "save_network",
    "weights_digest",
]

#: The file that ships with the package.
WEIGHTS = Path(__file__).with_name("weights.safetensors")

#: Begins the names of wall times in a header.
SECONDS = "seconds"


def save_network(
    network: VQANetwork,
    path: Path,
    about: Mapping[str, str],
    precision: torch.dtype = torch.float16,
) -> None:
    """Write the network, unless told otherwise in half precision. `about` goes into the header."""
    state = network.state_dict()
    tensors = {name: value.to(precision).contiguous() for name, value in state.items()}
    write_atomically(path, save(tensors, metadata=dict(about)))


def load_stage(network: VQANetwork, path: Path, about: Mapping[str, str]) -> bool:
    """Whether `path` was saved with the same `about`; then `network` has its weights.

    How long it took, `SECONDS`, may differ.
    """
    if not path.exists() or _without_times(read_header(path)) != _without_times(about):
        return False
    network.load_state_dict(load_file(path))
    return True


def _without_times(about: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in about.items() if not name.startswith(SECONDS)}


def load_network(path: Path = WEIGHTS) -> VQANetwork:
    """The network in float32, ready to answer.

    Raises:
        ModelError: if the file is missing, damaged or made for another network.
    """
    # Convolutions take half the time with the channels last.
    network = VQANetwork()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    try:
        tensors = load_file(path)
        network.load_state_dict({name: value.float() for name, value in tensors.items()})
    except (OSError, SafetensorError, RuntimeError) as error:
        raise ModelError(
            f"the embedded model's weights at {path} are missing or damaged; install the package "
            "again, or make new ones with: python -m vqa_state.embedded_training.train --out DIR"
        ) from error
    return network.eval()


def weights_digest(path: Path = WEIGHTS) -> str:
    """The first 16 hexadecimal digits of the file's SHA-256.

    Raises:
        ModelError: if the file cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    except OSError as error:
        raise ModelError(
            f"the embedded model's weights at {path} cannot be read; install the package again"
        ) from error


def read_header(path: Path = WEIGHTS) -> dict[str, str]:
    """What made the file, as `save_network` wrote it."""
    with safe_open(path, framework="pt") as file:
        return dict(file.metadata() or {})


def count_parameters(network: torch.nn.Module) -> int:
    """The number of single weights."""
    return sum(parameter.numel() for parameter in network.parameters())
