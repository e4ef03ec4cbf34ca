"""Shifted copies of an image: (pixels, seed, copy number) → the same copy everywhere.

Source: paper II-A. The shifts come from SHA-256 of the project's seed, the pixel hash, the copy's
number and the channel, so neither order nor machine nor a search's own seed changes them.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

import numpy as np
import numpy.typing as npt
from PIL import Image

__all__ = ["Augmentation", "AugmentationKind", "copies"]

MAX_COPIES = 100


class AugmentationKind(StrEnum):
    """How a copy differs from its image."""

    RGB_SHIFT = "rgb-shift"
    GAUSSIAN_NOISE = "gaussian-noise"


@dataclass(frozen=True, slots=True)
class Augmentation:
    """Which copies of every image a model is asked about.

    Attributes:
        kind: one value per channel (the paper's), or noise on every value.
        amount: share of full scale in (0, 1]: the largest shift, or the noise's deviation.
        n_copies: the image itself is not one of them.
    """

    kind: AugmentationKind = AugmentationKind.RGB_SHIFT
    amount: float = 0.1
    n_copies: int = 6

    def __post_init__(self) -> None:
        if not 0.0 < self.amount <= 1.0:
            raise ValueError(f"the amount must be above 0 and at most 1, got {self.amount}")
        if not 1 <= self.n_copies <= MAX_COPIES:
            raise ValueError(f"the copies must be 1 to {MAX_COPIES}, got {self.n_copies}")


def copies(
    pixels: Image.Image, pixel_hash: str, augmentation: Augmentation, seed: int
) -> Iterator[Image.Image]:
    """All copies of an RGB image, made one by one so that a large one is not held six times."""
    for number in range(augmentation.n_copies):
        yield copy_of(pixels, pixel_hash, augmentation, seed, number)


def copy_of(
    pixels: Image.Image, pixel_hash: str, augmentation: Augmentation, seed: int, number: int
) -> Image.Image:
    """Copy `number` (0 to n_copies - 1) of an RGB image."""
    if augmentation.kind is AugmentationKind.RGB_SHIFT:
        return _rgb_shift(pixels, rgb_shifts(pixel_hash, augmentation.amount, seed, number))
    return _gaussian_noise(pixels, pixel_hash, augmentation.amount, seed, number)


def rgb_shifts(pixel_hash: str, amount: float, seed: int, number: int) -> tuple[float, ...]:
    """One shift a channel, uniform in [-amount, amount], as a share of full scale."""
    draws = (
        int.from_bytes(_digest(seed, pixel_hash, number, channel)[:8], "big") / 2**64
        for channel in range(3)
    )
    return tuple((2 * draw - 1) * amount for draw in draws)


def _rgb_shift(pixels: Image.Image, shifts: tuple[float, ...]) -> Image.Image:
    levels = np.arange(256)
    tables = [np.floor(levels + 255 * shift + 0.5).clip(0, 255) for shift in shifts]
    return pixels.point(np.concatenate(tables).astype(int).tolist())


def _gaussian_noise(
    pixels: Image.Image, pixel_hash: str, amount: float, seed: int, number: int
) -> Image.Image:
    """NumPy promises the bits of Philox for ever, but not those of `normal`: so a table of it."""
    values = np.asarray(pixels)
    key = int.from_bytes(_digest(seed, pixel_hash, number, "noise")[:16], "big")
    words = np.random.Philox(key=key).random_raw(-(-values.size // 4))
    draws = words.astype("<u8").view("<u2")[: values.size].reshape(values.shape)
    steps = np.floor(_normal_quantiles() * 255 * amount + 0.5).astype(np.int16)
    noise = steps[draws]  # (height, width, 3), at most ±1100
    return Image.fromarray((values + noise).clip(0, 255).astype(np.uint8))


@cache
def _normal_quantiles() -> npt.NDArray[np.float64]:
    """(65536,): equally likely values of the standard normal distribution."""
    from scipy.special import ndtri

    return np.asarray(ndtri((np.arange(65536) + 0.5) / 65536))


def _digest(seed: int, pixel_hash: str, number: int, channel: int | str) -> bytes:
    return hashlib.sha256(f"{seed}:{pixel_hash}:{number}:{channel}".encode()).digest()
