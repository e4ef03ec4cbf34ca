"""PNG: only the chunks that make pixels reach the decoder, whatever size the others have.

Source: PNG specification, third edition, sections 5.3 (chunk layout) and 11.3 (ancillary chunks).
"""

import struct
import zlib
from dataclasses import dataclass, field

from PIL.PngImagePlugin import PngImageFile

from vqa_state.images.limits import Kind
from vqa_state.images.opened import Opened, at_once
from vqa_state.images.orientation import orientation_of
from vqa_state.images.spliced import spliced

__all__ = ["open_png", "png_ends_early"]

_START = 8
_AROUND = 12  # length, name and checksum
_XMP, _RAW_EXIF = b"XML:com.adobe.xmp", b"Raw profile type exif"
_MOST_TEXT = 1 << 20
_GREY, _RGB, _PALETTE = 0, 2, 3


@dataclass(slots=True)
class _Chunks:
    """A PNG taken apart: what a decoder needs, what says how to turn, and whether it ends."""

    kept: list[memoryview] = field(default_factory=list)
    exif: bytes = b""
    raw_exif: bytes = b""
    xmp: bytes = b""
    ended: bool = False


def open_png(data: bytes) -> Opened:
    """Read the header."""
    chunks = _chunks(data)
    image = PngImageFile(spliced(chunks.kept))
    orientation = orientation_of(chunks.exif or chunks.raw_exif, chunks.xmp)
    return Opened(Kind.PNG, image.size, image.size, at_once(image), orientation)


def png_ends_early(data: bytes) -> bool:
    """Whether no end chunk comes."""
    return not _chunks(data).ended


def _chunks(data: bytes) -> _Chunks:
    view, at, found = memoryview(data), _START, _Chunks()
    found.kept.append(view[:_START])
    colour = data[25] if len(data) > 25 else 0
    while at + 8 <= len(data):
        length, name = struct.unpack_from(">L4s", data, at)
        if not name.isalpha():
            break  # the decoder shall say what it makes of the rest
        whole = view[at : at + _AROUND + length]
        body = whole[8 : 8 + length]
        if name[:1].isupper() or (name == b"tRNS" and _is_sound(colour, length)):
            found.kept.append(whole)
        _note(found, name, body)
        at += _AROUND + length
        if name == b"IEND":
            found.ended = True
            return found
    found.kept.append(view[at:])
    return found


def _is_sound(colour: int, length: int) -> bool:
    """Whether a decoder can use transparency of this length; otherwise it counts as none."""
    return {_GREY: length == 2, _RGB: length == 6, _PALETTE: 1 <= length <= 256}.get(colour, False)


def _note(found: _Chunks, name: bytes, body: memoryview) -> None:
    """Keep what may say how to turn."""
    if name == b"eXIf":
        found.exif = bytes(body)
    elif name in (b"tEXt", b"zTXt", b"iTXt"):
        key = bytes(body[:80]).partition(b"\0")[0]
        if key == _XMP:
            found.xmp = _text(name, body[len(key) + 1 :])
        elif key == _RAW_EXIF:
            found.raw_exif = _from_hex(_text(name, body[len(key) + 1 :]))


def _text(name: bytes, rest: memoryview) -> bytes:
    """The first megabyte of a text behind its keyword."""
    if name == b"tEXt":
        return bytes(rest[:_MOST_TEXT])
    packed = name == b"zTXt" or bytes(rest[:1]) == b"\x01"
    content: bytes | memoryview = rest[1:]
    if name == b"iTXt":  # method, language, translated keyword
        head = bytes(rest[2:2002])
        skipped = head.partition(b"\0")[2].partition(b"\0")[2]
        content = rest[2 + len(head) - len(skipped) :]
    if not packed:
        return bytes(content[:_MOST_TEXT])
    try:
        return zlib.decompressobj().decompress(content, _MOST_TEXT)
    except zlib.error:
        return b""


def _from_hex(text: bytes) -> bytes:
    """ImageMagick's way: three lines that count, then lines of hexadecimal digits."""
    try:
        return bytes.fromhex(b"".join(text.split(b"\n")[3:]).decode("ascii"))
    except ValueError:
        return b""
