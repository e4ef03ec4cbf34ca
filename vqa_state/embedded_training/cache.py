"""Results kept on disk under a digest of all that made them, so that a stopped run goes on."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import torch

from vqa_state.storage.atomic_write import write_atomically

__all__ = ["cached", "digest", "digest_file", "digest_tensors"]

_LENGTH = 16


def cached(file: Path, make: Callable[[], bytes]) -> bytes:
    """The bytes of a file, which is made first if it is missing; it is never left half written."""
    if not file.exists():
        write_atomically(file, make())
    return file.read_bytes()


def digest(*parts: object) -> str:
    """16 hexadecimal digits for some plain values (numbers, texts, lists of them), in order."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:_LENGTH]


def digest_file(path: Path) -> str:
    """16 hexadecimal digits for a file's bytes, whatever its name."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:_LENGTH]


def digest_tensors(module: torch.nn.Module) -> str:
    """16 hexadecimal digits for a network's values in full precision."""
    found = hashlib.sha256()
    for name, value in sorted(module.state_dict().items()):
        found.update(name.encode())
        found.update(value.detach().contiguous().numpy().tobytes())
    return found.hexdigest()[:_LENGTH]
