"""What tells pictures apart and what shows them small, made without a full-size copy."""

import hashlib
import io
import struct

from PIL import Image

from vqa_state.images.converting import strips

__all__ = ["content_hash", "pixel_hash", "shown", "thumbnail"]

_THUMBNAIL_SIDE = 256
_SHOWN_SIDE = 2048


def content_hash(data: bytes) -> str:
    """SHA-256 of the bytes as given: the id of an image."""
    return hashlib.sha256(data).hexdigest()


def pixel_hash(pixels: Image.Image) -> str:
    """SHA-256 of size and RGB pixels. A webcam frame has this hash although it has no file.

    Source: our rule for the copies in paper II-A: the same picture gives the same copies.
    """
    digest = hashlib.sha256(struct.pack(">II", *pixels.size))
    for box in strips(pixels.size):
        digest.update(pixels.crop(box).tobytes())
    return digest.hexdigest()


def thumbnail(pixels: Image.Image) -> bytes:
    """A WebP of at most 256 × 256 pixels."""
    return _webp(pixels, _THUMBNAIL_SIDE)


def shown(pixels: Image.Image) -> bytes:
    """A WebP of at most 2048 × 2048 pixels, for a browser that cannot show the file itself."""
    return _webp(pixels, _SHOWN_SIDE)


def _webp(pixels: Image.Image, most: int) -> bytes:
    scale = min(1.0, most / max(pixels.size))
    width, height = (max(1, round(side * scale)) for side in pixels.size)
    small = pixels.resize((width, height), Image.Resampling.BICUBIC, reducing_gap=2.0)
    out = io.BytesIO()
    small.save(out, "WEBP", quality=80)
    return out.getvalue()
