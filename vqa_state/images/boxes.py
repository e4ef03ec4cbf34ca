"""HEIC and AVIF: the boxes of their file, and their decoders.

EXIF in them turns nothing: the picture's own properties do, which the decoders follow.
Source: ISO/IEC 14496-12, sections 4.2 (boxes) and 8.11.6 (items); 23008-12, section 6.5.10 (turns).
"""

import struct
from collections.abc import Iterator
from functools import partial
from typing import Any

from PIL import Image, features

from vqa_state.errors import ImageError
from vqa_state.images.limits import Kind
from vqa_state.images.opened import Opened, at_once, info_bytes
from vqa_state.images.orientation import orientation_of
from vqa_state.images.spliced import spliced

__all__ = ["boxes_end_early", "is_avif", "open_avif", "open_heif"]

_AVIF_BRANDS = {b"avif", b"avis"}
_NOTES = {b"Exif", b"mime"}


def is_avif(data: bytes) -> bool:
    """Whether the file's first box names AVIF among its brands."""
    size = int.from_bytes(data[:4], "big")
    brands = data[8 : min(size, 4096)]
    return any(brands[at : at + 4] in _AVIF_BRANDS for at in range(0, len(brands), 4))


def open_heif(data: bytes) -> Opened:
    """Read the header with libheif, which turns the pixels itself."""
    import pillow_heif

    heif = pillow_heif.open_heif(data)
    deep = int(heif.info.get("bit_depth", 8)) > 8
    kind = Kind.DEEP_HEIF if deep else Kind.HEIF
    return Opened(kind, heif.size, heif.size, partial(_decoded, heif))


def _decoded(heif: Any) -> Image.Image:
    data = heif.data
    return Image.frombytes(heif.mode, heif.size, data, "raw", heif.mode, heif.stride)


def open_avif(data: bytes) -> Opened:
    """Read the header with libavif.

    Raises:
        ImageError: if this Pillow was built without it.
    """
    if not features.check("avif"):
        raise ImageError(
            "this is an AVIF, which the Pillow installed here cannot read: install Pillow with "
            "AVIF, or save it as JPEG, PNG, WebP, BMP or HEIC"
        )
    from PIL.AvifImagePlugin import AvifImageFile

    image = AvifImageFile(spliced(_without_notes(data)))
    orientation = orientation_of(info_bytes(image.info, "exif"))
    return Opened(Kind.AVIF, image.size, image.size, at_once(image), orientation)


def _boxes(data: bytes, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Name, start of the content and end of every box; the last one may end behind the file."""
    while start + 8 <= end:
        size, name = struct.unpack_from(">L4s", data, start)
        head = 8
        if size == 1 and start + 16 <= end:
            (size,) = struct.unpack_from(">Q", data, start + 8)
            head = 16
        stop = start + size if size else end
        if stop < start + head:
            return
        yield name, start + head, stop
        start = stop


def boxes_end_early(data: bytes) -> bool:
    """Whether the last box ends behind the file, or the box with the pixels did not come."""
    boxes = list(_boxes(data, 0, len(data)))
    left = len(data) - boxes[-1][2] if boxes else 0
    return left < 0 or 0 < left < 8 or (left == 0 and all(name != b"mdat" for name, _, _ in boxes))


def _without_notes(data: bytes) -> list[memoryview]:
    """The file with its EXIF and XMP called something else, for Pillow raises on odd EXIF."""
    view, parts, done = memoryview(data), [], 0
    for at in _note_types(data):
        parts += [view[done:at], memoryview(b"skip")]
        done = at + 4
    return [*parts, view[done:]]


def _note_types(data: bytes) -> Iterator[int]:
    """Places of the four bytes that call an item EXIF or XMP."""
    for name, start, stop in _boxes(data, 0, len(data)):
        if name != b"meta":
            continue
        for inner, at, end in _boxes(data, start + 4, min(stop, len(data))):
            if inner != b"iinf" or at >= len(data):
                continue
            first = at + (6 if data[at] == 0 else 8)
            for entry, place, _ in _boxes(data, first, min(end, len(data))):
                type_at = place + (8 if data[place : place + 1] == b"\x02" else 10)
                if entry == b"infe" and data[type_at : type_at + 4] in _NOTES:
                    yield type_at
