"""How a picture is to be turned: the one value of its EXIF or XMP that matters, and the turn.

Nothing else of EXIF is read and nothing is written, so no odd tag can refuse a sound picture.
Source: EXIF 2.32, tag 0x0112; TIFF 6.0, section 2. What counts where a file is odd is what Pillow
makes of it: the last of two tags, the first of many values, nothing behind a value that is missing.
"""

import re
import struct
from typing import Final

from PIL import Image

__all__ = ["UPRIGHT", "orientation_of", "turned"]

UPRIGHT: Final = 1
_TAG: Final = 0x0112
_XMP = re.compile(rb'tiff:Orientation(?:="|>)([0-9])')
_ORDERS = {b"MM\0*": ">", b"II*\0": "<", b"MM*\0": ">", b"II\0*": "<"}
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8}
_NUMBERS = {3: "H", 4: "L", 5: "LL", 6: "b", 8: "h", 9: "l", 10: "ll", 11: "f", 12: "d", 13: "L",
            16: "Q"}  # fmt: skip
_TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}


def turned(pixels: Image.Image, orientation: int) -> Image.Image:
    """Upright pixels; the same object if they are already."""
    turn = _TURNS.get(orientation)
    return pixels if turn is None else pixels.transpose(turn)


def orientation_of(exif: bytes, xmp: bytes = b"") -> int:
    r"""1 to 8; XMP counts only where EXIF says nothing.

    Args:
        exif: a TIFF structure, perhaps behind "Exif\0\0"; empty without EXIF.
        xmp: a packet of XML; empty without one.
    """
    value = _of_exif(exif)
    if value is None:
        match = _XMP.search(xmp)
        value = UPRIGHT if match is None else int(match[1])
    return int(value) if value in _TURNS else UPRIGHT


def _of_exif(data: bytes) -> float | None:
    """The value of the tag, whatever it is; None if there is no such tag."""
    while data.startswith(b"Exif\0\0"):
        data = data[6:]
    if not data:
        return None
    order = _ORDERS.get(data[:4])
    if order is None or len(data) < 8:
        return UPRIGHT  # damaged, which is not the same as missing
    (start,) = struct.unpack(order + "L", data[4:8])
    if start + 2 > len(data):
        return None
    (n_tags,) = struct.unpack_from(order + "H", data, start)
    found = None
    for at in range(start + 2, min(start + 2 + 12 * n_tags, len(data) - 11), 12):
        tag, kind, count, place = struct.unpack_from(order + "HHLL", data, at)
        size = count * _SIZES.get(kind, 0)
        value_at = at + 8 if size <= 4 else place
        if value_at + size > len(data):
            break
        if tag == _TAG and size:
            found = _number(data, value_at, kind, order)
    return found


def _number(data: bytes, at: int, kind: int, order: str) -> float:
    """The first number of a value; 0, which turns nothing, for a text."""
    if kind not in _NUMBERS:
        return 0
    first, *rest = struct.unpack_from(order + _NUMBERS[kind], data, at)
    if not rest:
        return float(first)
    return first / rest[0] if rest[0] else 0
