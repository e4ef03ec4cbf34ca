"""The unchanging first blocks of the trunk, computed once a picture and kept on disk."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from safetensors.torch import load, save
from torch import Tensor

from vqa_state.embedded_training.cache import cached, digest, digest_file, digest_tensors
from vqa_state.embedded_training.dataset import Example
from vqa_state.models.embedded.pixels import normalise, to_square
from vqa_state.models.embedded.trunk import INPUT_SIZE, Trunk

__all__ = ["N_FROZEN_BLOCKS", "embed_examples", "n_chunks", "varied"]

#: Blocks that training leaves as ImageNet made them; their output is (80, 14, 14).
N_FROZEN_BLOCKS = 8

_CHUNK = 480
_BATCH = 24


def embed_examples(
    trunk: Trunk, examples: Sequence[Example], folder: Path, seed: int
) -> Iterator[Tensor]:
    """Yield maps of shape (n, 80, 14, 14) in float16, chunk by chunk, in the examples' order.

    Every picture is varied once (see `varied`). A chunk that an earlier run has left in `folder`
    is read instead of computed; it is known by the trunk's weights, the pictures' bytes, the block
    and the seed.
    """
    made_by = digest(digest_tensors(trunk), N_FROZEN_BLOCKS, INPUT_SIZE, seed)
    for start in range(0, len(examples), _CHUNK):
        chunk = examples[start : start + _CHUNK]
        name = digest(made_by, *(digest_file(example.path) for example in chunk))
        embed = partial(_embed, trunk, chunk, seed)
        yield load(cached(folder / f"{name}.safetensors", embed))["maps"]


def n_chunks(examples: Sequence[Example]) -> int:
    """How many chunks `embed_examples` yields."""
    return -(-len(examples) // _CHUNK)


def varied(pixels: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.float32]:
    """A (224, 224, 3) picture mirrored, cut, and changed in brightness and in each channel."""
    if rng.random() < 0.5:
        pixels = pixels[:, ::-1]
    side = int(INPUT_SIZE * rng.uniform(0.72, 1))
    top, left = rng.integers(0, INPUT_SIZE - side + 1, 2)
    cut = Image.fromarray(np.ascontiguousarray(pixels[top : top + side, left : left + side]))
    again = cut.resize((INPUT_SIZE, INPUT_SIZE), Image.Resampling.BILINEAR)
    changed = np.asarray(again, np.float32) * rng.uniform(0.8, 1.2) + rng.uniform(-28, 28, 3)
    return np.clip(changed, 0, 255).astype(np.float32)


@torch.inference_mode()
def _embed(trunk: Trunk, chunk: Sequence[Example], seed: int) -> bytes:
    """The maps of some pictures as a safetensors file."""
    maps = []
    for start in range(0, len(chunk), _BATCH):
        pictures = [
            varied(_read(example), np.random.default_rng([seed, start + number]))
            for number, example in enumerate(chunk[start : start + _BATCH])
        ]
        pixels = torch.from_numpy(normalise(np.stack(pictures)))
        pixels = pixels.contiguous(memory_format=torch.channels_last)
        maps.append(trunk.begin(pixels, N_FROZEN_BLOCKS).half().contiguous())
    return save({"maps": torch.cat(maps)})


def _read(example: Example) -> NDArray[np.uint8]:
    with Image.open(example.path) as image:
        return to_square(image)
