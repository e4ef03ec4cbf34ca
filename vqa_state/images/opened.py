"""A file whose header was read, before any pixel is decoded."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PIL import Image

from vqa_state.images.limits import Kind
from vqa_state.images.orientation import UPRIGHT

__all__ = ["CutOffError", "Opened", "at_once", "info_bytes"]


class CutOffError(Exception):
    """The file ends before its picture does."""


@dataclass(frozen=True, slots=True)
class Opened:
    """What a header says.

    Attributes:
        kind: of file.
        size: width and height in the header, before turning.
        decoded_size: width and height of what `decode` gives.
        decode: gives the pixels, not yet turned; it may raise whatever a decoder does.
        orientation: 1 to 8, how the pixels are to be turned.
    """

    kind: Kind
    size: tuple[int, int]
    decoded_size: tuple[int, int]
    decode: Callable[[], Image.Image]
    orientation: int = UPRIGHT


def at_once(image: Image.Image) -> Callable[[], Image.Image]:
    """Decodes the pixels of a file that Pillow opened."""

    def decode() -> Image.Image:
        image.load()
        return image

    return decode


def info_bytes(info: dict[Any, Any], key: str) -> bytes:
    """An entry of Pillow's `info` that shall be bytes."""
    value = info.get(key)
    return value if isinstance(value, bytes) else b""
