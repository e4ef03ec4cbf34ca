"""Decoded pixels of any mode to RGB, a strip at a time: no second full-size copy is made."""

from collections.abc import Iterator

import numpy as np
from PIL import Image

__all__ = ["as_rgb", "strips", "to_rgb"]

_STRIP_PIXELS = 1_000_000


def strips(size: tuple[int, int]) -> Iterator[tuple[int, int, int, int]]:
    """Boxes (left, top, right, bottom) of whole rows that cover a picture from top to bottom."""
    width, height = size
    rows = max(1, _STRIP_PIXELS // max(1, width))
    for top in range(0, height, rows):
        yield 0, top, width, min(height, top + rows)


def as_rgb(pixels: Image.Image) -> Image.Image:
    """The same object if it has RGB pixels; else Pillow's conversion of it."""
    return pixels if pixels.mode == "RGB" else pixels.convert("RGB")


def to_rgb(decoded: Image.Image) -> Image.Image:
    """RGB; what is transparent becomes white, 16-bit grey is scaled rather than cut off.

    Pixels that are RGB already are given back as they are.
    """
    if decoded.mode == "RGB" and not decoded.has_transparency_data:
        return decoded
    pixels = Image.new("RGB", decoded.size)
    for box in strips(decoded.size):
        pixels.paste(_strip_to_rgb(decoded.crop(box)), box[:2])
    return pixels


def _strip_to_rgb(part: Image.Image) -> Image.Image:
    if part.mode.startswith("I") or part.mode == "F":
        part = Image.fromarray((np.asarray(part, np.float64) / 257).clip(0, 255).astype("uint8"))
    if not part.has_transparency_data:
        return part.convert("RGB")
    layered = part.convert("RGBA")
    background = Image.new("RGBA", layered.size, "white")
    return Image.alpha_composite(background, layered).convert("RGB")
