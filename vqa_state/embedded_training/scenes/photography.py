"""From a clean rendering to something a cheap camera might have taken."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

__all__ = ["photograph"]

Pixels = NDArray[np.float32]


def photograph(rendering: NDArray[np.uint8], rng: np.random.Generator) -> Image.Image:
    """Develop a rendering, (height, width, 3), as an RGB image of the same size.

    A renderer's picture is too clean, too dark and too colourful, and a network trained on it
    learns that; glow, exposure, colour cast, vignette, blur and noise take it away. One picture of
    six stays as rendered, so that the clean look of a simulator is known too.
    """
    if rng.random() < 1 / 6:
        return Image.fromarray(np.ascontiguousarray(rendering))
    pixels = rendering.astype(np.float32) / 255.0
    pixels = _bloom(pixels, float(rng.uniform(0, 0.35)))
    pixels = _fade(pixels, rng)
    pixels = _expose(pixels, rng)
    pixels = pixels * _vignette(pixels.shape[0], pixels.shape[1], float(rng.uniform(0, 0.35)))
    pixels = pixels + rng.normal(0, rng.uniform(0, 0.025), pixels.shape).astype(np.float32)
    image = Image.fromarray((np.clip(pixels, 0, 1) * 255).astype(np.uint8))
    if rng.random() < 0.4:
        image = image.filter(ImageFilter.GaussianBlur(float(rng.uniform(0.3, 1.2))))
    return image


def _bloom(pixels: Pixels, strength: float) -> Pixels:
    """Let what is nearly white shine over its edges, as lamps do in a lens."""
    bright = Image.fromarray((np.clip((pixels - 0.8) * 5, 0, 1) * 255).astype(np.uint8))
    halo = np.asarray(bright.filter(ImageFilter.GaussianBlur(8)), np.float32) / 255.0
    return pixels + strength * halo


def _fade(pixels: Pixels, rng: np.random.Generator) -> Pixels:
    """Take out part of the colour."""
    grey = pixels.mean(axis=2, keepdims=True)
    return np.asarray(grey + (pixels - grey) * rng.uniform(0.45, 1.05), np.float32)


def _expose(pixels: Pixels, rng: np.random.Generator) -> Pixels:
    """Gamma (mostly brighter), gain with a colour cast, contrast."""
    brighter = np.clip(pixels, 0, 1) ** np.float32(rng.uniform(0.65, 1.1))
    cast = rng.uniform(0.75, 1.05) * rng.uniform(0.94, 1.06, 3)
    contrast = rng.uniform(0.8, 1.15)
    return np.asarray((brighter * cast - 0.5) * contrast + 0.5, np.float32)


def _vignette(height: int, width: int, strength: float) -> Pixels:
    """Factors of shape (height, width, 1) that fall towards the corners."""
    y = np.linspace(-1, 1, height, dtype=np.float32)[:, None]
    x = np.linspace(-1, 1, width, dtype=np.float32)[None, :]
    return np.asarray(1 - strength * (x * x + y * y) / 2, np.float32)[..., None]
