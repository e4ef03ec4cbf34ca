"""Small generated pictures for all tests."""

import io

import numpy as np
from PIL import Image


def draw(number: int, size: tuple[int, int] = (32, 24)) -> Image.Image:
    """A picture of random blocks; two numbers give two pictures that do not look alike."""
    blocks = np.random.default_rng(number).integers(0, 256, (6, 8, 3), np.uint8)
    return Image.fromarray(blocks).resize(size, Image.Resampling.NEAREST)


def encode(pixels: Image.Image, kind: str = "PNG", **options) -> bytes:
    out = io.BytesIO()
    pixels.save(out, kind, **options)
    return out.getvalue()


def picture(number: int, kind: str = "PNG", **options) -> bytes:
    """The bytes of a small picture file; another number gives another picture."""
    return encode(draw(number), kind, **options)
