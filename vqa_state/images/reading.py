"""Reading a picture safely: type, size and pixels are checked before anything is decoded."""

import hashlib
import io
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps, UnidentifiedImageError

from vqa_state.errors import ImageError

__all__ = [
    "MAX_BYTES",
    "MAX_PIXELS",
    "MIN_SIDE",
    "Picture",
    "check_side",
    "content_hash",
    "pixel_hash",
    "read_file",
    "read_picture",
    "rgb_pixels",
    "thumbnail",
]

MAX_BYTES = 30_000_000
MAX_PIXELS = 64_000_000
MIN_SIDE = 16
"""Pixels of the shorter side of an image of a project; on less no state can be seen."""
_SUFFIXES = {
    "JPEG": "jpg",
    "MPO": "jpg",
    "PNG": "png",
    "WEBP": "webp",
    "BMP": "bmp",
    "HEIF": "heic",
}
_THUMBNAIL_SIDE = 256

# What Pillow raises on damaged files, seen in its own issue tracker: not only OSError.
_DAMAGE = (
    OSError, SyntaxError, ValueError, EOFError, KeyError, IndexError, TypeError, OverflowError,
    RuntimeError, MemoryError, struct.error, zlib.error,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Picture:
    """A decoded file: RGB pixels after the EXIF turn, and the kind of file that they came from."""

    pixels: Image.Image
    suffix: str

    def __post_init__(self) -> None:
        if self.pixels.mode != "RGB":
            raise ValueError(f"a picture has RGB pixels, got mode {self.pixels.mode!r}")


def content_hash(data: bytes) -> str:
    """SHA-256 of the bytes as given: the id of an image."""
    return hashlib.sha256(data).hexdigest()


def pixel_hash(pixels: Image.Image) -> str:
    """SHA-256 of size and RGB pixels. A webcam frame has this hash although it has no file.

    Source: our rule for the copies in paper II-A: the same picture gives the same copies.
    """
    digest = hashlib.sha256(struct.pack(">II", *pixels.size))
    digest.update(pixels.tobytes())
    return digest.hexdigest()


def read_picture(data: bytes) -> Picture:
    """Decode a JPEG, PNG, WebP, BMP or HEIC file to RGB, turned as its EXIF says.

    Raises:
        ImageError: if it is too large (checked from the header, before decoding), of another
            kind, or damaged.
    """
    if len(data) > MAX_BYTES:
        raise ImageError(
            f"the file has more than {MAX_BYTES / 1e6:.0f} MB, the most that is read: save it "
            "smaller and add it again"
        )
    try:
        opened = _open(data)
        _check_size(*opened.size)
        suffix = _SUFFIXES[opened.format or ""]
        return Picture(rgb_pixels(opened), suffix)
    except UnidentifiedImageError as error:
        raise ImageError(
            "this is not a picture that can be read; use JPEG, PNG, WebP, BMP or HEIC"
        ) from error
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise ImageError(
            f"the picture has far more than {MAX_PIXELS / 1e6:.0f} million pixels, the most that "
            "is read: save it smaller and add it again"
        ) from error
    except _DAMAGE as error:
        raise ImageError(
            f"the picture is damaged ({type(error).__name__}); save it again from its source"
        ) from error


def check_side(data: bytes) -> None:
    """Look at a picture's header; what cannot be read at all is left to `read_picture`.

    Raises:
        ImageError: if a side has fewer than `MIN_SIDE` pixels.
    """
    try:
        width, height = _open(data).size
    except (ImageError, Image.DecompressionBombError, Image.DecompressionBombWarning, *_DAMAGE):
        return
    if min(width, height) < MIN_SIDE:
        raise ImageError(
            f"the picture has {width} × {height} pixels; an image of a project needs at least "
            f"{MIN_SIDE} on each side: add it in its full size"
        )


def read_file(path: Path) -> bytes:
    """The bytes of a picture's file, one more than is allowed at most: no device is read for ever.

    Raises:
        ImageError: if it is no file or cannot be read.
    """
    try:
        if not path.is_file():
            raise ImageError(f"{path} is no file; check the path")
        with path.open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ImageError(f"cannot read {path} ({error}); check the path") from error


def rgb_pixels(opened: Image.Image) -> Image.Image:
    """RGB pixels after the EXIF turn: what is hashed, copied and shown to a model."""
    return _to_rgb(ImageOps.exif_transpose(opened))


def thumbnail(pixels: Image.Image) -> bytes:
    """A WebP of at most 256 × 256 pixels."""
    small = pixels.copy()
    small.thumbnail((_THUMBNAIL_SIDE, _THUMBNAIL_SIDE))
    out = io.BytesIO()
    small.save(out, "WEBP", quality=80)
    return out.getvalue()


def _open(data: bytes) -> Image.Image:
    """Read the header only; Pillow and libheif decode on first use of the pixels."""
    try:
        return Image.open(io.BytesIO(data), formats=("JPEG", "PNG", "WEBP", "BMP"))
    except UnidentifiedImageError:
        import pillow_heif

        if not pillow_heif.is_supported(data):
            raise
        heif = pillow_heif.open_heif(data)
        _check_size(*heif.size)
        opened: Image.Image = heif.to_pillow()  # turned already, and its EXIF says so
        opened.format = "HEIF"
        return opened


def _check_size(width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise ImageError(
            f"the picture has {width} × {height} pixels; at most {MAX_PIXELS / 1e6:.0f} million "
            "are read: save it smaller and add it again"
        )


def _to_rgb(opened: Image.Image) -> Image.Image:
    """RGB; what is transparent becomes white, 16-bit grey is scaled rather than cut off."""
    if opened.mode.startswith("I") or opened.mode == "F":
        opened = Image.fromarray(
            (np.asarray(opened, np.float64) / 257).clip(0, 255).astype("uint8")
        )
    if not opened.has_transparency_data:
        return opened.convert("RGB")
    layered = opened.convert("RGBA")
    background = Image.new("RGBA", layered.size, "white")
    return Image.alpha_composite(background, layered).convert("RGB")
