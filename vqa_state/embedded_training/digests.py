"""Names for pictures by what is in them, so that nothing kept is used for something else."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import torch

from vqa_state.embedded_training.dataset import Example

__all__ = ["digest", "digest_examples", "digest_file", "digest_tensors"]

_LENGTH = 16


def digest(*parts: object) -> str:
    """16 hexadecimal digits for some plain values (numbers, texts, lists of them), in order."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:_LENGTH]


def digest_file(path: Path) -> str:
    """16 hexadecimal digits for a file's bytes, whatever its name."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:_LENGTH]


def digest_examples(examples: Sequence[Example]) -> str:
    """For all that training learns from: pictures by their bytes, labels, facts, and the order."""
    return digest(
        *(
            [
                digest_file(one.path),
                one.thing,
                one.is_positive,
                sorted(one.facts.items()),
                one.scene,
            ]
            for one in examples
        )
    )


def digest_tensors(module: torch.nn.Module) -> str:
    """For a network's values in full precision."""
    found = hashlib.sha256()
    for name, value in sorted(module.state_dict().items()):
        found.update(name.encode())
        found.update(value.detach().contiguous().numpy().tobytes())
    return found.hexdigest()[:_LENGTH]
