"""Reading a picture safely: type, size and pixels are checked before anything is decoded."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from vqa_state.errors import ImageError
from vqa_state.images import limits
from vqa_state.images.converting import to_rgb
from vqa_state.images.opened import CutOffError, Opened, info_bytes
from vqa_state.images.opening import ends_early, open_picture
from vqa_state.images.orientation import UPRIGHT, orientation_of, turned

__all__ = ["Picture", "check_side", "read_file", "read_picture", "reading", "rgb_pixels"]

_CUT_OFF = (
    "the picture is cut off: its file ends before the picture does; copy it again from its source"
)


@dataclass(frozen=True, slots=True)
class Picture:
    """A decoded file: RGB pixels after the EXIF turn, and the kind of file that they came from."""

    pixels: Image.Image
    suffix: str

    def __post_init__(self) -> None:
        if self.pixels.mode != "RGB":
            raise ValueError(f"a picture has RGB pixels, got mode {self.pixels.mode!r}")


def read_picture(data: bytes) -> Picture:
    """Decode a JPEG, PNG, WebP, BMP, HEIC or AVIF file to RGB, turned as its EXIF says.

    A JPEG of more than `MAX_PIXELS` is decoded at half its width and height, rounded up. At most
    `MAX_MEMORY` bytes are added; large pictures wait for each other.

    Raises:
        ImageError: if it is too large (checked from the header, before decoding), of another
            kind, cut off or damaged.
    """
    with reading(data) as picture:
        return picture


@contextmanager
def reading(data: bytes) -> Iterator[Picture]:
    """As `read_picture`; a large picture holds the turn until it is let go.

    Raises:
        ImageError: as `read_picture`.
    """
    limits.check_bytes(len(data))
    opened = _opened(data)
    limits.check_pixels(opened.kind, *opened.size)
    with limits.taking_turns(opened.kind, opened.decoded_size[0] * opened.decoded_size[1]):
        yield Picture(_decoded(opened, data), opened.kind.value.suffix)


def check_side(data: bytes) -> None:
    """Look at a picture's header; what cannot be read at all is left to `read_picture`.

    Raises:
        ImageError: if a side has fewer than `MIN_SIDE` pixels.
    """
    try:
        width, height = _opened(data).size
    except ImageError:
        return
    if min(width, height) < limits.MIN_SIDE:
        raise ImageError(
            f"the picture has {width} × {height} pixels; an image of a project needs at least "
            f"{limits.MIN_SIDE} on each side: add it in its full size"
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
            return file.read(limits.MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ImageError(f"cannot read {path} ({error}); check the path") from error


def rgb_pixels(given: Image.Image) -> Image.Image:
    """RGB pixels after the EXIF turn: what is hashed, copied and shown to a model.

    RGB pixels that are upright are given back as they are, not copied.

    Raises:
        ImageError: if the picture was not decoded yet, and cannot be.
    """
    with _decoders_faults(b""):
        given.load()
        return turned(to_rgb(given), _orientation(given))


def _orientation(given: Image.Image) -> int:
    exif, xmp = info_bytes(given.info, "exif"), info_bytes(given.info, "xmp")
    if exif or xmp:
        return orientation_of(exif, xmp)
    value = given.getexif().get(0x0112, UPRIGHT)  # of a TIFF, or as the caller set it
    return value if isinstance(value, int) else UPRIGHT


def _opened(data: bytes) -> Opened:
    with _decoders_faults(data):
        return open_picture(data)


def _decoded(opened: Opened, data: bytes) -> Image.Image:
    with _decoders_faults(data):
        decoded = opened.decode()
        pixels = to_rgb(decoded)
        if pixels is not decoded:
            decoded.close()  # `opened` still has it, and turning takes as much again
    return turned(pixels, opened.orientation)


@contextmanager
def _decoders_faults(data: bytes) -> Iterator[None]:
    """The outer edge towards other people's decoders: each of their errors is an `ImageError`.

    They raise what their authors thought of: OSError, SyntaxError, ValueError, KeyError, EOFError,
    struct.error, zlib.error, AssertionError, RuntimeError, UnicodeDecodeError, ZeroDivisionError
    and others, and where warnings are errors, those. One file of many shall not end the work.
    """
    try:
        yield
    except ImageError:
        raise
    except Exception as error:
        says_so = isinstance(error, CutOffError) or "end of file" in str(error)  # libheif
        if says_so or ends_early(data):
            raise ImageError(_CUT_OFF) from error
        raise ImageError(
            f"the picture is damaged, or made in a way that is not read ({type(error).__name__}: "
            f"{str(error)[:100]}); save it again from its source"
        ) from error
