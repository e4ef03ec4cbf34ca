"""Which pictures belong to which split: every scene is drawn from the hash of its own address."""

import hashlib
from enum import StrEnum

import numpy as np

__all__ = ["PAPER_THINGS", "THINGS", "Split", "scene_generator"]

#: The ten things of the paper (section III), in its order, then seven that it does not have.
THINGS = (
    "door",
    "elevator",
    "cabinet",
    "refrigerator",
    "microwave",
    "transparent_door",
    "light",
    "display",
    "handbag",
    "water",
    "drawer",
    "window",
    "curtain",
    "laptop",
    "box_lid",
    "gate",
    "oven",
)

#: The ten of the paper.
PAPER_THINGS = THINGS[:10]


class Split(StrEnum):
    """Three sets of scenes that share no shape, colour, texture, light or camera."""

    TRAIN = "train"
    MEASURE = "measure"
    SAMPLE = "sample"


def scene_generator(thing: str, split: Split, seed: int) -> np.random.Generator:
    """The one source of randomness of one scene.

    The split is part of the hash, so seed 3 of `measure` has nothing in common with seed 3 of
    `train`: geometry, textures and noise are all drawn from this generator.
    """
    address = f"{split.value}/{thing}/{seed}".encode()
    return np.random.default_rng(int.from_bytes(hashlib.sha256(address).digest()[:16], "big"))
