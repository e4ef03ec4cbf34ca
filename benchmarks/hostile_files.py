"""Odd files and what must become of them, for `benchmarks.hostile`.

The oracle is the same picture without the oddity, or Pillow's own whole-picture conversion.
"""

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random

import numpy as np
import pillow_heif
from PIL import Image
from PIL.PngImagePlugin import PngInfo

__all__ = ["FAMILIES", "Case", "Expected"]

READ = {"JPEG", "MPO", "PNG", "WEBP", "BMP", "AVIF"}
_TURNS = (
    None, None, Image.Transpose.FLIP_LEFT_RIGHT, Image.Transpose.ROTATE_180,
    Image.Transpose.FLIP_TOP_BOTTOM, Image.Transpose.TRANSPOSE, Image.Transpose.ROTATE_270,
    Image.Transpose.TRANSVERSE, Image.Transpose.ROTATE_90,
)  # fmt: skip
_TAGS = (0x010F, 0x0110, 0x011A, 0x011B, 0x0128, 0x0132, 0x0213, 0x8298, 0x8769, 0x8825, 0x9286,
         0xA005, 0xC4A5)  # fmt: skip
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8}
_CHUNKS = (b"tEXt", b"zTXt", b"iTXt", b"iCCP", b"gAMA", b"cHRM", b"pHYs", b"sRGB", b"tIME",
           b"bKGD", b"hIST", b"sBIT", b"sPLT", b"eXIf", b"acTL", b"fcTL", b"fdAT", b"cICP",
           b"caBX", b"npTc")  # fmt: skip
_EXIF = b"Exif\0\0"


@dataclass(frozen=True, slots=True)
class Expected:
    """What must become of a file.

    Attributes:
        pixels: that it must be read as; None where it need not be read.
        reason: words that the refusal must hold, if it is not read.
    """

    pixels: Image.Image | None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Case:
    """A file, and what must become of it."""

    what: str
    data: bytes
    expected: Expected


def noise(draws: Random, mode: str = "RGB", least: int = 1) -> Image.Image:
    """A small picture of random pixels."""
    width, height = draws.randint(least, 48), draws.randint(least, 48)
    values = np.frombuffer(draws.randbytes(width * height * 4), np.uint8)
    picture = Image.fromarray(values.reshape(height, width, 4))
    if mode == "I;16":
        return Image.fromarray(np.asarray(picture)[..., 0].astype(np.uint16) * 257)
    return picture if mode == "RGBA" else picture.convert("RGB").convert(mode)


def saved(picture: Image.Image, kind: str, **options: object) -> bytes:
    """A file as Pillow or libheif writes it."""
    out = io.BytesIO()
    if kind == "HEIF":
        pillow_heif.from_pillow(picture).save(out, quality=60, **options)
    else:
        picture.save(out, kind, **options)
    return out.getvalue()


def plain(data: bytes) -> Image.Image:
    """The oracle: pixels by Pillow alone, as a whole, not turned, on white."""
    if data[4:8] == b"ftyp" and b"avif" not in data[8:32]:
        opened: Image.Image = pillow_heif.open_heif(data).to_pillow()
    else:
        opened = Image.open(io.BytesIO(data))
    opened.load()
    if opened.mode.startswith("I"):
        grey = np.asarray(opened).astype(np.uint32) // 257
        return Image.fromarray(grey.astype(np.uint8)).convert("RGB")
    if not opened.has_transparency_data:
        return opened.convert("RGB")
    layered = opened.convert("RGBA")
    return Image.alpha_composite(Image.new("RGBA", layered.size, "white"), layered).convert("RGB")


def odd_exif(draws: Random) -> Case:
    """Random tags of random types around an orientation, in every kind that carries EXIF."""
    kind = draws.choice(["JPEG", "JPEG", "PNG", "WEBP", "JPEG", "PNG", "WEBP", "HEIF", "AVIF"])
    orientation = draws.randint(0, 9)
    exif = _exif(draws, orientation)
    picture = noise(draws, least=16 if kind in ("HEIF", "AVIF") else 1)
    options = {"lossless": True} if kind == "WEBP" else {}
    data, without = _with_exif(picture, kind, exif, **options)
    pixels = plain(without)
    if kind not in ("HEIF", "AVIF"):  # theirs turns nothing
        turn = _TURNS[orientation] if orientation < len(_TURNS) else None
        pixels = pixels if turn is None else pixels.transpose(turn)
    return Case(f"{kind}, EXIF {exif.hex()}", data, Expected(pixels))


def _with_exif(
    picture: Image.Image, kind: str, exif: bytes, **options: object
) -> tuple[bytes, bytes]:
    """A file with these bytes as its EXIF whatever its writer thinks of them, and without."""
    without = saved(picture, kind, **options)
    if kind == "PNG":
        at = 33  # behind the header
        return without[:at] + _chunk(b"eXIf", exif[len(_EXIF) :]) + without[at:], without
    empty = _EXIF + b"MM\0*\0\0\0\x08\0\0" + bytes(len(exif) - 16)
    return saved(picture, kind, exif=empty, **options).replace(
        empty if kind in ("JPEG", "HEIF") else empty[len(_EXIF) :],
        exif if kind in ("JPEG", "HEIF") else exif[len(_EXIF) :],
    ), without


def _exif(draws: Random, orientation: int) -> bytes:
    order = draws.choice("<>")
    tags = sorted({*draws.sample(_TAGS, draws.randint(0, 6)), draws.randrange(0x10000), 0x0112})
    entries, values, place = b"", b"", 8 + 2 + 12 * len(tags) + 4
    for tag in tags:
        kind = draws.choice(list(_SIZES) if tag != 0x0112 else [3])
        count = 1 if tag == 0x0112 else draws.choice([0, 1, 1, 2, 3, draws.randint(0, 40)])
        value = struct.pack(order + "H", orientation) if tag == 0x0112 else _value(draws, kind)
        value = (value * (count * _SIZES[kind] // len(value) + 1))[: count * _SIZES[kind]]
        entries += struct.pack(order + "HHL", tag, kind, count)
        if len(value) <= 4:
            entries += value.ljust(4, b"\0")
        else:
            entries += struct.pack(order + "L", place + len(values))
            values += value
    after = draws.choice([0, 8, place, draws.randrange(1 << 32)])  # where a second one would be
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "LH", 8, len(tags))
    return _EXIF + head + entries + struct.pack(order + "L", after) + values


def _value(draws: Random, kind: int) -> bytes:
    choices = (b"\0", b"\xff", b"2024:01:01 10:00:00\0", draws.randbytes(16), b"1/2", b"\0\0\0\x01")
    return draws.choice(choices) + bytes([kind])


def odd_chunks(draws: Random) -> Case:
    """Ancillary PNG chunks of any name, size and content, some with a wrong checksum."""
    mode = draws.choice(["RGB", "RGBA", "L", "LA", "P", "1", "I;16"])
    data = saved(noise(draws, mode), "PNG")
    head, tail = data[:33], data[33:]
    before = b"".join(_odd_chunk(draws) for _ in range(draws.randint(0, 4)))
    after = b"".join(_odd_chunk(draws) for _ in range(draws.randint(0, 4)))
    odd = head + before + tail[:-12] + after + tail[-12:]
    return Case(f"PNG, chunks {(before + after)[:400].hex()}", odd, Expected(plain(data)))


def _odd_chunk(draws: Random) -> bytes:
    name = draws.choice(_CHUNKS)
    if draws.random() < 0.2:
        letters = "abcdefghijklmnopqrstuvwxyz"
        name = "".join([*draws.choices(letters, k=2), "A", draws.choice(letters)]).encode()
    size = draws.choice([0, 1, 3, 8, 26, draws.randrange(500)])
    bodies: tuple[Callable[[], bytes], ...] = (
        lambda: draws.randbytes(size),
        lambda: b"key\0\0" + zlib.compress(bytes(draws.choice([10, 3_000_000]))),
        lambda: b"key\0\1\0\0\0" + zlib.compress(b"x" * draws.choice([10, 3_000_000])),
        lambda: b"key\0" + b"x" * draws.choice([10, 2_000_000]),
    )
    body = draws.choice(bodies if draws.random() < 0.3 else bodies[:1])()
    if body[:2] in (b"II", b"MM"):
        body = b"\0" + body  # else it might say how to turn
    chunk = _chunk(name, body)
    return chunk[:-1] + bytes([chunk[-1] ^ 1]) if draws.random() < 0.2 else chunk


def _chunk(name: bytes, body: bytes) -> bytes:
    checksum = zlib.crc32(name + body)
    return struct.pack(">L", len(body)) + name + body + struct.pack(">L", checksum)


def cut_off(draws: Random) -> Case:
    """A file that ends early: read only if nothing of its pixels is lost, else called cut off."""
    kind = draws.choice(["JPEG", "JPEG", "JPEG", "PNG", "WEBP", "BMP", "HEIF", "AVIF"])
    options: dict[str, object] = {}
    if kind == "JPEG":
        options["progressive"] = draws.random() < 0.4
        options["restart_marker_blocks"] = draws.choice([0, 0, 1, 4])
        options["quality"] = draws.choice([30, 75, 95])
    data = saved(noise(draws, least=16), kind, **options)
    pixels = plain(data)
    if kind == "JPEG" and draws.random() < 0.3:  # only the end marker, or half of it
        lost = draws.choice([1, 2])
        return Case(f"JPEG without its last {lost}", data[:-lost], Expected(pixels))
    kept = draws.randint(12, len(data) - (3 if kind == "JPEG" else 1))
    return Case(f"{kind}, {kept} of {len(data)} bytes", data[:kept], Expected(pixels, "cut off"))


def every_kind(draws: Random) -> Case:
    """Whatever Pillow writes: what we read has Pillow's pixels, the rest is refused as unread."""
    Image.init()
    kind = draws.choice(sorted({*Image.SAVE, "HEIF"} - {"PDF"} | READ))
    mode = draws.choice(["RGB", "RGBA", "L", "LA", "P", "1", "CMYK", "I;16"])
    try:
        data = saved(noise(draws, mode, least=16), kind, **_options(draws, kind))
    except (OSError, ValueError, KeyError, SystemError):  # a mode that it does not write
        return every_kind(draws)
    if kind in READ or kind == "HEIF":
        return Case(f"{kind}, {mode}", data, Expected(plain(data)))
    return Case(f"{kind}, {mode}", data, Expected(None, "JPEG, PNG, WebP, BMP, HEIC or AVIF"))


def _options(draws: Random, kind: str) -> dict[str, object]:
    if kind == "JPEG":
        return {"progressive": draws.random() < 0.5, "quality": draws.randint(1, 100),
                "comment": draws.randbytes(9), "icc_profile": draws.randbytes(70_000)}  # fmt: skip
    if kind == "WEBP":
        return {"lossless": draws.random() < 0.5, "icc_profile": draws.randbytes(99)}
    if kind == "PNG":
        notes = PngInfo()
        notes.add_text("note", "x" * 99, zip=draws.random() < 0.5)
        return {"pnginfo": notes, "icc_profile": draws.randbytes(9)}
    return {}


Family = Callable[[Random], Case]
FAMILIES: dict[str, Family] = {
    "odd EXIF": odd_exif,
    "odd PNG chunks": odd_chunks,
    "cut off": cut_off,
    "kinds that Pillow writes": every_kind,
}


def endless(family: Family, seed: int) -> Iterator[Case]:
    """Cases of one family, the same for the same seed."""
    draws = Random(seed)
    while True:
        yield family(draws)
