"""Random numbers and choices from one generator, and the generator of each scene."""

import hashlib
from collections.abc import Sequence
from enum import StrEnum
from typing import TypeVar

import numpy as np

__all__ = ["RandomDraws", "SceneSplit", "generator_of", "scene_generator"]

T = TypeVar("T")


class SceneSplit(StrEnum):
    """Three sets of scenes that share no shape, colour, texture, light or camera."""

    TRAIN = "train"
    MEASURE = "measure"
    SAMPLE = "sample"


def scene_generator(thing: str, split: SceneSplit, seed: int) -> np.random.Generator:
    """The one source of randomness of one scene.

    The split is part of the hash, so seed 3 of `measure` has nothing in common with seed 3 of
    `train`: geometry, textures and noise are all drawn from this generator.
    """
    return generator_of(f"{split.value}/{thing}/{seed}")


def generator_of(address: str) -> np.random.Generator:
    """A generator that is seeded by the hash of a text."""
    digest = hashlib.sha256(address.encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "big"))


class RandomDraws:
    """Draws plain numbers and choices from a generator."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def uniform(self, low: float, high: float) -> float:
        """One number in [low, high)."""
        return float(self.rng.uniform(low, high))

    def uniforms(self, *ranges: tuple[float, float]) -> tuple[float, ...]:
        """One number from each range, in order."""
        return tuple(self.uniform(*one) for one in ranges)

    def chance(self, probability: float) -> bool:
        """True with the given probability."""
        return bool(self.rng.random() < probability)

    def count(self, low: int, high: int) -> int:
        """One whole number from low to high, both included."""
        return int(self.rng.integers(low, high + 1))

    def pick(self, options: Sequence[T]) -> T:
        """One of the options."""
        return options[int(self.rng.integers(len(options)))]

    def side(self) -> float:
        """-1 (left, front) or +1 (right, back)."""
        return self.pick((-1.0, 1.0))
