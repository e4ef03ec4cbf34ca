"""A picture as a caller gives it: a path, a file's bytes, a Pillow image or an RGB array.

Everything public that takes a picture takes these four, by the two functions here.
"""

import io
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vqa_state.errors import ImageError
from vqa_state.images.limits import MAX_PIXELS
from vqa_state.images.reading import read_file, read_picture, rgb_pixels

__all__ = ["PictureInput", "picture_bytes", "picture_pixels"]

PictureInput = str | PathLike[str] | bytes | Image.Image | NDArray[np.uint8]
"""A path, the content of a file, a Pillow image of any mode, or uint8 RGB (height, width, 3)."""


def picture_pixels(picture: PictureInput) -> Image.Image:
    """The RGB pixels of a picture, upright: what a model is shown.

    The same pixels come out however a picture is given.

    Args:
        picture: a path, the bytes of a JPEG, PNG, WebP, BMP, HEIC or AVIF file, a Pillow image, or
            an array of uint8 RGB values, shape (height, width, 3).

    Raises:
        ImageError: if it cannot be read, is too large, or is an array of another shape or dtype.
    """
    if isinstance(picture, Image.Image):
        return _of_image(picture)
    if isinstance(picture, np.ndarray):
        return _of_array(picture)
    return read_picture(picture_bytes(picture)).pixels


def picture_bytes(picture: PictureInput) -> bytes:
    """A picture as the content of a file: as it is on disk, or as a PNG without loss.

    Args:
        picture: see `picture_pixels`. The content of a file is not looked at here.

    Raises:
        ImageError: see `picture_pixels`.
    """
    if isinstance(picture, bytes):
        return picture
    if isinstance(picture, str | PathLike):
        return read_file(Path(picture))
    if isinstance(picture, Image.Image | np.ndarray):
        file = io.BytesIO()
        picture_pixels(picture).save(file, "PNG")
        return file.getvalue()
    raise ImageError(
        f"a picture is given as a path, as the bytes of a file, as a Pillow image or as an RGB "
        f"array, got {type(picture).__name__}"
    )


def _of_image(picture: Image.Image) -> Image.Image:
    _check_size(*picture.size)
    return rgb_pixels(picture)


def _of_array(picture: NDArray[np.uint8]) -> Image.Image:
    shape = picture.shape
    if picture.dtype != np.uint8 or len(shape) != 3 or shape[2] != 3 or 0 in shape:
        raise ImageError(
            "an array is a picture if it is uint8 of shape (height, width, 3), red, green and blue "
            f"from 0 to 255, got {picture.dtype} {shape}; convert it first (OpenCV's arrays are "
            "BGR: picture[:, :, ::-1])"
        )
    _check_size(shape[1], shape[0])
    return Image.fromarray(np.ascontiguousarray(picture))


def _check_size(width: int, height: int) -> None:
    """The limit that `read_picture` has for files."""
    if width * height > MAX_PIXELS:
        raise ImageError(
            f"the picture has {width} × {height} pixels; at most {MAX_PIXELS / 1e6:.0f} million "
            "are taken: make it smaller first"
        )
