"""From any picture to the network's input."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vqa_state.models.embedded.trunk import INPUT_SIZE

__all__ = ["normalise", "to_square"]


def to_square(image: Image.Image) -> NDArray[np.uint8]:
    """RGB pixels of shape (224, 224, 3), squeezed to a square; transparency becomes white."""
    if image.has_transparency_data:
        rgba = image.convert("RGBA")
        image = Image.alpha_composite(Image.new("RGBA", rgba.size, "white"), rgba)
    small = image.convert("RGB").resize(
        (INPUT_SIZE, INPUT_SIZE), Image.Resampling.BILINEAR, reducing_gap=3.0
    )
    return np.asarray(small, np.uint8)


def normalise(pixels: NDArray[np.uint8] | NDArray[np.float32]) -> NDArray[np.float32]:
    """(n, 224, 224, 3) in [0, 255] -> (n, 3, 224, 224) in about [-1, 1].

    The ImageNet weights were trained with (x - 127) / 128, as TensorFlow's Lite models are.
    """
    scaled = (pixels.astype(np.float32) - 127.0) / 128.0
    return np.ascontiguousarray(scaled.transpose(0, 3, 1, 2))
