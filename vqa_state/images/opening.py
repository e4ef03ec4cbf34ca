"""From bytes to a header that was read: which kind of file it is, by its first bytes."""

from PIL.BmpImagePlugin import BmpImageFile
from PIL.WebPImagePlugin import WebPImageFile

from vqa_state.errors import ImageError
from vqa_state.images.boxes import boxes_end_early, is_avif, open_avif, open_heif
from vqa_state.images.jpeg import jpeg_ends_early, open_jpeg
from vqa_state.images.limits import Kind
from vqa_state.images.opened import Opened, at_once, info_bytes
from vqa_state.images.orientation import orientation_of
from vqa_state.images.png import open_png, png_ends_early
from vqa_state.images.spliced import spliced

__all__ = ["ends_early", "open_picture"]

_READ = "JPEG, PNG, WebP, BMP, HEIC or AVIF"
_UNREAD = {
    b"GIF8": "a GIF",
    b"II*\0": "a TIFF or a raw photo",
    b"MM\0*": "a TIFF or a raw photo",
    b"\0\0\0\x0cjP  ": "a JPEG 2000",
    b"\xff\x4f\xff\x51": "a JPEG 2000",
    b"\0\0\0\x0cJXL ": "a JPEG XL",
    b"\xff\x0a": "a JPEG XL",
    b"%PDF": "a PDF",
    b"8BPS": "a Photoshop file",
}
_RLE = (1, 2)
_MOST_PACKED = 65_535


def open_picture(data: bytes) -> Opened:
    """Read a header; it may raise whatever a decoder does.

    Raises:
        ImageError: if it is of no kind that is read.
    """
    if data.startswith(b"\xff\xd8\xff"):
        return open_jpeg(data)
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return open_png(data)
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return _open_webp(data)
    if data.startswith(b"BM"):
        return _open_bmp(data)
    if data[4:8] == b"ftyp":
        return _open_boxes(data)
    raise _unread(data)


def ends_early(data: bytes) -> bool:
    """Whether a file that cannot be decoded ends before its picture does, by its own account."""
    if data.startswith(b"\xff\xd8\xff"):
        return jpeg_ends_early(data)
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return png_ends_early(data)
    if data[:4] == b"RIFF":
        return int.from_bytes(data[4:8], "little") + 8 > len(data)
    if data.startswith(b"BM"):
        return int.from_bytes(data[2:6], "little") > len(data)
    return data[4:8] == b"ftyp" and boxes_end_early(data)


def _open_webp(data: bytes) -> Opened:
    image = WebPImageFile(spliced([data]))
    orientation = orientation_of(info_bytes(image.info, "exif"), info_bytes(image.info, "xmp"))
    return Opened(Kind.WEBP, image.size, image.size, at_once(image), orientation)


def _open_bmp(data: bytes) -> Opened:
    image = BmpImageFile(spliced([data]))
    if image.info.get("compression") not in _RLE:
        return Opened(Kind.BMP, image.size, image.size, at_once(image))
    if image.width > _MOST_PACKED:  # one code may skip 255 rows, and Pillow fills them
        raise ImageError(
            f"this run-length encoded BMP is {image.width} pixels wide, of which at most "
            f"{_MOST_PACKED} are read; save it as PNG"
        )
    return Opened(Kind.PACKED_BMP, image.size, image.size, at_once(image))


def _open_boxes(data: bytes) -> Opened:
    if is_avif(data):
        return open_avif(data)
    import pillow_heif

    if not pillow_heif.is_supported(data):
        raise _unread(data)
    return open_heif(data)


def _unread(data: bytes) -> ImageError:
    what = next((name for start, name in _UNREAD.items() if data.startswith(start)), None)
    if what is None:
        return ImageError(f"this is not a picture that can be read; use {_READ}")
    return ImageError(f"this is {what}, which is not read; save it as {_READ}")
