"""JPEG: its segments, what a decoder needs of them, and whether it is all there.

The decoder is given the tables, the frame and the scans, and neither notes nor profiles: Pillow
reads those, too, and raises on odd ones.
Source: ITU-T T.81, annex B; which APP0 and APP14 change colours: jdmarker.c of libjpeg.
"""

import re
import struct
from dataclasses import dataclass, field
from functools import partial
from random import Random
from typing import IO

from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

from vqa_state.images import limits
from vqa_state.images.hashes import pixel_hash
from vqa_state.images.limits import Kind
from vqa_state.images.opened import CutOffError, Opened
from vqa_state.images.orientation import orientation_of
from vqa_state.images.spliced import spliced

__all__ = ["jpeg_ends_early", "open_jpeg"]

_SOI, _EOI, _SOS, _APP0, _APP1, _APP14, _COM = 0xD8, 0xD9, 0xDA, 0xE0, 0xE1, 0xEE, 0xFE
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_PROGRESSIVE = {0xC2, 0xC6, 0xCA, 0xCE}
_ALONE = {0x01, *range(0xD0, 0xD8)}
_NEXT_MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])")
_EXIF, _XMP = b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/\0"
_END = bytes([0xFF, _EOI])
_RESTARTS = {bytes([marker]) for marker in range(0xD0, 0xD8)}
_LAST = 1 << 20
"""Bytes of coded data among which the last restart marker is looked for."""
_N_COEFFICIENTS = 64


@dataclass(slots=True)
class _Segments:
    """A JPEG taken apart.

    Attributes:
        head: what a decoder needs of the file before its first scan.
        scans: from the first scan to the end of the file; None without one.
        exif: content of the EXIF segments, one behind the other.
        xmp: the last packet of XMP.
        frame: marker of the frame header.
        size: width and height.
        components: their identifiers.
        open_bits: bits that each coefficient still lacks, by component.
        in_parts: whether a scan lacks components, so that all are kept until the last scan.
        ended: whether the end marker is there.
    """

    head: list[memoryview] = field(default_factory=list)
    scans: memoryview | None = None
    exif: bytes = b""
    xmp: bytes = b""
    frame: int = 0
    size: tuple[int, int] = (0, 0)
    components: bytes = b""
    open_bits: dict[int, list[int]] = field(default_factory=dict)
    in_parts: bool = False
    ended: bool = False

    @property
    def kind(self) -> Kind:
        """By what decoding it takes."""
        if not self.in_parts and self.frame not in _PROGRESSIVE:
            return Kind.JPEG
        is_cmyk = len(self.components) > 3
        return Kind.PROGRESSIVE_CMYK_JPEG if is_cmyk else Kind.PROGRESSIVE_JPEG

    @property
    def all_scans(self) -> bool:
        """Whether every coefficient has all its bits."""
        return all(not any(bits) for bits in self.open_bits.values())


def open_jpeg(data: bytes) -> Opened:
    """Read the header. More than `MAX_PIXELS` are decoded at half the width and height."""
    parts = _segments(data)
    image = JpegImageFile(_stream(parts, b""))
    halved = parts.kind is Kind.JPEG and image.width * image.height > limits.MAX_PIXELS
    size = image.size
    decode = partial(_decode, parts, halved)
    width, height = (-(-side // 2) for side in size) if halved else size
    orientation = orientation_of(parts.exif, parts.xmp)
    return Opened(parts.kind, size, (width, height), decode, orientation)


def jpeg_ends_early(data: bytes) -> bool:
    """Whether no end marker comes."""
    return not _segments(data).ended


def _decode(parts: _Segments, halved: bool) -> Image.Image:
    """The pixels; without an end marker it must not matter what would follow."""
    draw = partial(_drawn, parts, halved)
    try:
        return draw(b"")
    except OSError:
        if parts.ended or parts.scans is None:
            raise
    if not parts.all_scans:
        raise CutOffError
    other = pixel_hash(draw(_filler(bytes(parts.scans[-_LAST:])) + _END))
    pixels = draw(_END)
    if pixel_hash(pixels) != other:
        raise CutOffError
    return pixels


def _drawn(parts: _Segments, halved: bool, tail: bytes) -> Image.Image:
    image = JpegImageFile(_stream(parts, tail))
    if halved:
        image.draft(None, (image.width // 2, image.height // 2))
    image.load()
    return image


def _stream(parts: _Segments, tail: bytes) -> IO[bytes]:
    scans = memoryview(b"") if parts.scans is None else parts.scans
    if tail and bytes(scans[-1:]) == b"\xff":  # half of an end marker
        scans = scans[:-1]
    return spliced([*parts.head, scans, tail])


def _filler(scans: bytes) -> bytes:
    """Noise that a decoder takes for the picture if it lacks some: restart markers, too."""
    at = len(scans)
    while (at := scans.rfind(b"\xff", 0, at)) >= 0 and scans[at + 1 : at + 2] not in _RESTARTS:
        pass
    first = scans[at + 1] - 0xD0 + 1 if at >= 0 else 0
    draws = Random(0)
    noise = [bytes(draws.randrange(0xFF) for _ in range(256)) for _ in range(9)]
    marks = [bytes([0xFF, 0xD0 + (first + n) % 8]) for n in range(8)]
    return noise[0] + b"".join(mark + more for mark, more in zip(marks, noise[1:], strict=True))


def _segments(data: bytes) -> _Segments:
    """Walk through all segments; what makes no sense is left to the decoder."""
    parts, view, at = _Segments(), memoryview(data), 2
    parts.head.append(view[:2])
    while (found := _marker(data, at)) is not None:
        marker, at = found
        if marker == _EOI:
            parts.ended = True
            break
        if marker in _ALONE or marker == _SOI:
            continue
        if at + 2 > len(data):
            break
        (length,) = struct.unpack_from(">H", data, at)
        body = view[at + 2 : at + length]
        if marker == _SOS and parts.scans is None:
            parts.scans = view[at - 2 :]
        if parts.scans is None:
            _keep(parts, marker, view[at : at + length], body)
        if marker == _SOS:
            _note_scan(parts, bytes(body))
        at += max(2, length)
    return parts


def _marker(data: bytes, at: int) -> tuple[int, int] | None:
    """The next marker and the place behind it; coded data are passed over."""
    match = _NEXT_MARKER.search(data, at)
    return None if match is None else (match[1][0], match.end())


def _keep(parts: _Segments, marker: int, whole: memoryview, body: memoryview) -> None:
    content = bytes(body[:32])
    if marker == _APP1 and content.startswith(_EXIF):
        parts.exif += bytes(body) if not parts.exif else bytes(body[len(_EXIF) :])
    elif marker == _APP1 and content.startswith(_XMP):
        parts.xmp = bytes(body[len(_XMP) :])
    if _is_needed(marker, content):
        parts.head += [memoryview(bytes([0xFF, marker])), whole]
    if marker in _FRAMES and len(body) >= 6:
        parts.frame = marker
        height, width = struct.unpack_from(">HH", body, 1)
        parts.size, parts.components = (width, height), bytes(body[6::3])
        parts.open_bits = {one: [1] * _N_COEFFICIENTS for one in parts.components}


def _is_needed(marker: int, content: bytes) -> bool:
    """Whether a segment can change a pixel."""
    if marker == _APP0:
        return content.startswith(b"JFIF\0") and len(content) >= 14
    if marker == _APP14:
        return content.startswith(b"Adobe") and len(content) >= 12
    return not (_APP0 <= marker < 0xF0 or marker == _COM)


def _note_scan(parts: _Segments, header: bytes) -> None:
    """Which bits of which coefficients a scan brings."""
    n_components = header[0] if header else 0
    inside, tail = header[1 : 1 + 2 * n_components : 2], header[1 + 2 * n_components :]
    if len(tail) < 3:
        return
    first, last, low = tail[0], tail[1], tail[2] & 15
    if parts.frame not in _PROGRESSIVE:
        first, last, low = 0, _N_COEFFICIENTS - 1, 0
        parts.in_parts |= n_components < len(parts.components)
    for component in inside:
        bits = parts.open_bits.get(component, [])
        bits[first : last + 1] = [low] * len(bits[first : last + 1])
