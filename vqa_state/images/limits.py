"""How large a picture may be, and that only one large picture is decoded at a time.

A limit on pixels alone is none on memory: decoders need 4 to 26 bytes a pixel. Below stand peaks
measured with the pinned decoders, turning included; docs/decisions/0016-pictures.md tells how.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum

from vqa_state.errors import ImageError

__all__ = [
    "LARGE",
    "MAX_BYTES",
    "MAX_MEMORY",
    "MAX_PIXELS",
    "MIN_SIDE",
    "Kind",
    "check_bytes",
    "check_pixels",
    "taking_turns",
]

MAX_BYTES = 100_000_000
MAX_PIXELS = 64_000_000
"""Of what is kept after decoding; a JPEG with more is decoded at half its size."""
MIN_SIDE = 16
"""Pixels of the shorter side of an image of a project; on less no state can be seen."""
MAX_MEMORY = 700_000_000
"""Bytes that reading one picture may add at its peak."""
LARGE = 100_000_000
"""Bytes; pictures that need more take turns."""

_turn = threading.RLock()


@dataclass(frozen=True, slots=True)
class _Costs:
    """What is read of one kind of file.

    Attributes:
        name: as a sentence says it.
        suffix: of the file in a project.
        max_pixels: of its header.
        bytes_per_pixel: at the peak of decoding and turning.
    """

    name: str
    suffix: str
    max_pixels: int
    bytes_per_pixel: int


class Kind(Enum):
    """What can be read, told apart where decoding takes another amount of memory."""

    JPEG = _Costs("a JPEG", "jpg", 4 * MAX_PIXELS, 8)
    PROGRESSIVE_JPEG = _Costs("a progressive JPEG", "jpg", MAX_PIXELS, 10)
    PROGRESSIVE_CMYK_JPEG = _Costs("a progressive JPEG in CMYK", "jpg", 48_000_000, 12)
    PNG = _Costs("a PNG", "png", MAX_PIXELS, 8)
    WEBP = _Costs("a WebP", "webp", 36_000_000, 17)
    BMP = _Costs("a BMP", "bmp", MAX_PIXELS, 8)
    PACKED_BMP = _Costs("a run-length encoded BMP", "bmp", 16_000_000, 12)
    HEIF = _Costs("a HEIC", "heic", 50_000_000, 13)
    DEEP_HEIF = _Costs("a HEIC of more than 8 bits", "heic", 25_000_000, 24)
    AVIF = _Costs("an AVIF", "avif", 25_000_000, 26)


def check_bytes(size: int) -> None:
    """Refuse a file that is too large.

    Raises:
        ImageError: if it has more than `MAX_BYTES`.
    """
    if size > MAX_BYTES:
        raise ImageError(
            f"the file has more than {MAX_BYTES / 1e6:.0f} MB, the most that is read: save it "
            "smaller and add it again"
        )


def check_pixels(kind: Kind, width: int, height: int) -> None:
    """Refuse a picture that is too large to be decoded in `MAX_MEMORY`.

    Raises:
        ImageError: if it has more pixels than are read of its kind.
    """
    most = most_pixels(kind)
    if width * height <= most:
        return
    smaller = "save it smaller"
    if most < MAX_PIXELS:
        smaller += " or as a plain JPEG"
    raise ImageError(
        f"the picture has {width} × {height} pixels; of {kind.value.name} at most "
        f"{most / 1e6:.0f} million are read: {smaller} and add it again"
    )


def most_pixels(kind: Kind) -> int:
    """Pixels that a header of this kind may promise."""
    if kind is Kind.JPEG:
        return 4 * MAX_PIXELS
    return int(min(kind.value.max_pixels, MAX_PIXELS))


@contextmanager
def taking_turns(kind: Kind, n_pixels: int) -> Iterator[None]:
    """Wait until no other large picture is decoded, if this one is large.

    Args:
        kind: of file.
        n_pixels: that will be decoded.
    """
    if n_pixels * kind.value.bytes_per_pixel <= LARGE:
        yield
        return
    with _turn:
        yield
