"""Memory that the largest pictures take, each in a process of its own, for `benchmarks.hostile`.

`python -m benchmarks.hostile_peaks make NAME FILE` writes a picture, `… read NAME FILE` reads it
and prints the bytes that were added at the peak (VmHWM, so on Linux only).
"""

import io
import re
import struct
import subprocess
import sys
import tempfile
import threading
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pillow_heif
from PIL import Image

from vqa_state.images import Kind, pixel_hash, read_picture, reading
from vqa_state.images.augmentation import Augmentation, AugmentationKind, late_copies
from vqa_state.images.limits import most_pixels
from vqa_state.models.embedded.pixels import to_square
from vqa_state.project.project import Project, StateNames

__all__ = ["PEAKS", "main", "measure_peak"]

_TURNED = 6
_ROWS = 16  # of a block of a JPEG with halved colours


def _exif() -> bytes:
    exif = Image.Exif()
    exif[0x0112] = _TURNED
    return exif.tobytes()


def _saved(picture: Image.Image, kind: str, **options: object) -> bytes:
    out = io.BytesIO()
    picture.save(out, kind, **options)
    return out.getvalue()


def _side(kind: Kind) -> int:
    return int(most_pixels(kind) ** 0.5)


def jpeg(width: int, height: int, *, detail: int = 0) -> bytes:
    """A baseline JPEG of any height, made of one row of blocks again and again; it is turned.

    Noise of quality `detail` makes a large file.
    """
    strip = Image.new("RGB", (width, _ROWS), "grey")
    if detail:
        values = np.random.default_rng(0).integers(0, 256, (_ROWS, width, 3), np.uint8)
        strip = Image.fromarray(values)
    options = {"quality": detail or 80, "exif": _exif(), "restart_marker_rows": 1}
    data = bytearray(_saved(strip, "JPEG", **options))
    frame = data.index(b"\xff\xc0")
    data[frame + 5 : frame + 7] = struct.pack(">H", height)
    scan = data.index(b"\xff\xda")
    start = scan + 2 + int.from_bytes(data[scan + 2 : scan + 4], "big")
    row, n_rows = bytes(data[start:-2]), -(-height // _ROWS)
    marks = [bytes([0xFF, 0xD0 + n]) for n in range(8)]
    eight = b"".join(row + mark for mark in marks)
    rest = b"".join(row + mark for mark in marks[: n_rows % 8])
    return bytes(data[:start]) + eight * (n_rows // 8) + rest + b"\xff\xd9"


def progressive(mode: str, kind: Kind) -> bytes:
    """The largest progressive JPEG, colours in full."""
    picture = Image.new(mode, (_side(kind),) * 2)
    return _saved(picture, "JPEG", progressive=True, subsampling=0, quality=50, exif=_exif())


def png(colour: int, depth: int, bytes_per_pixel: int, *, text: int = 0) -> bytes:
    """The largest PNG, all zero; it is turned."""
    side = _side(Kind.PNG)
    packer, row = zlib.compressobj(1), bytes(1 + side * bytes_per_pixel)
    rows = [packer.compress(row) for _ in range(side)]
    parts = [
        (b"IHDR", struct.pack(">LLBBBBB", side, side, depth, colour, 0, 0, 0)),
        (b"eXIf", _exif()[6:]),
        (b"tEXt", b"note\0" + b"x" * text),
        (b"IDAT", b"".join(rows) + packer.flush()),
        (b"IEND", b""),
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">L", len(body)) + name + body + struct.pack(">L", zlib.crc32(name + body))
        for name, body in parts
    )


def webp(mode: str, *, lossless: bool) -> bytes:
    """The largest WebP; it is turned."""
    picture = Image.new(mode, (_side(Kind.WEBP),) * 2, "red")
    if mode == "RGBA":
        picture.putalpha(100)
    return _saved(picture, "WEBP", lossless=lossless, method=0, quality=10, exif=_exif())


def packed_bmp() -> bytes:
    """The largest run-length encoded BMP: rows that end at once."""
    width, height = 65_535, most_pixels(Kind.PACKED_BMP) // 65_535
    head = struct.pack("<LllHHLLllLL", 40, width, height, 1, 8, 1, 0, 0, 0, 256, 0)
    palette = b"".join(bytes([n, 0, n, 0]) for n in range(256))
    body = b"\1\5\0\2\0\xff" * 3 + b"\0\1"
    offset = 14 + len(head) + len(palette)
    return b"BM" + struct.pack("<LLL", offset + len(body), 0, offset) + head + palette + body


def bmp() -> bytes:
    """The largest BMP of a byte a pixel."""
    return _saved(Image.new("L", (_side(Kind.BMP),) * 2).convert("P"), "BMP")


def heif(mode: str, kind: Kind, chroma: int) -> bytes:
    """The largest HEIC."""
    side, out = _side(kind), io.BytesIO()
    if kind is Kind.DEEP_HEIF:
        pillow_heif.options.SAVE_HDR_TO_12_BIT = True
        data = bytes(side * side * 2 * len(mode))
        made = pillow_heif.from_bytes(f"{mode};16", (side, side), data)
    else:
        made = pillow_heif.from_pillow(Image.new(mode, (side, side)))
    made.save(out, quality=10, chroma=chroma, exif=_exif())
    return out.getvalue()


def avif(mode: str, subsampling: str) -> bytes:
    """The largest AVIF; it is turned."""
    picture = Image.new(mode, (_side(Kind.AVIF),) * 2)
    return _saved(picture, "AVIF", speed=10, subsampling=subsampling, exif=_exif())


def _read(data: bytes) -> None:
    """Read it and hash it; nothing more of it is needed than its pixels."""
    with reading(data) as picture:
        pixel_hash(picture.pixels)


def _four_at_once(data: bytes) -> None:
    threads = [threading.Thread(target=_read, args=[data]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _add(data: bytes) -> None:
    """Add it to a project."""
    with tempfile.TemporaryDirectory() as folder:
        project = Project.create(Path(folder), "door", StateNames("open", "closed"))
        project.add(data, "large")


def _copy(kind: AugmentationKind) -> Callable[[bytes], None]:
    def work(data: bytes) -> None:
        """Read it, and look at its copies one by one, as a model does."""
        with reading(data) as picture:
            augmentation = Augmentation(kind, 0.1, 2)
            hashed = pixel_hash(picture.pixels)
            list(map(to_square, late_copies(picture.pixels, hashed, augmentation, 0)))

    return work


Make = Callable[[], bytes]
Work = Callable[[bytes], None]
PEAKS: dict[str, tuple[Make, Work]] = {
    "WebP of 36 million pixels": (lambda: webp("RGBA", lossless=True), _read),
    "PNG RGBA of 64 million": (lambda: png(6, 8, 4), _read),
    "JPEG of 200 million": (lambda: jpeg(16_320, 12_240), _read),
    "PNG RGBA, added to a project": (lambda: png(6, 8, 4), _add),
    "PNG of 16-bit grey": (lambda: png(0, 16, 2), _read),
    "four PNG at once": (lambda: png(6, 8, 4), _four_at_once),
    "JPEG of 256 million": (lambda: jpeg(16_000, 16_000), _read),
    "JPEG of 64 million": (lambda: jpeg(8000, 8000), _read),
    "JPEG of 200 million, 100 MB, added": (lambda: jpeg(16_320, 12_240, detail=40), _add),
    "JPEG of 64 million, its shifted copies": (
        lambda: jpeg(8000, 8000),
        _copy(AugmentationKind.RGB_SHIFT),
    ),
    "JPEG of 64 million, its noisy copies": (
        lambda: jpeg(8000, 8000),
        _copy(AugmentationKind.GAUSSIAN_NOISE),
    ),
    "JPEG of 64 million without its end": (lambda: jpeg(8000, 8000)[:-2], _read),
    "progressive JPEG": (lambda: progressive("RGB", Kind.PROGRESSIVE_JPEG), _read),
    "progressive JPEG in CMYK": (lambda: progressive("CMYK", Kind.PROGRESSIVE_CMYK_JPEG), _read),
    "PNG with 90 MB of text": (lambda: png(6, 8, 4, text=90_000_000), _read),
    "WebP, lossy": (lambda: webp("RGB", lossless=False), _read),
    "AVIF": (lambda: avif("RGBA", "4:4:4"), _read),
    "BMP": (bmp, _read),
    "BMP, run-length encoded": (packed_bmp, _read),
    "HEIC": (lambda: heif("RGB", Kind.HEIF, 420), _read),
    "HEIC with transparency": (lambda: heif("RGBA", Kind.HEIF, 444), _read),
    "HEIC of 12 bits with transparency": (lambda: heif("RGBA", Kind.DEEP_HEIF, 444), _read),
}


def measure_peak(name: str) -> float:
    """Bytes that reading a picture of `PEAKS` adds at its peak."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "picture")
        _run("make", name, path)
        return float(_run("read", name, path))


def _run(what: str, name: str, path: str) -> str:
    command = [sys.executable, "-m", "benchmarks.hostile_peaks", what, name, path]
    root = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        raise SystemExit(f"{name}: {what} ended with {done.returncode}: {done.stderr[-500:]}")
    return done.stdout.strip()


def _memory(field: str) -> int:
    """Bytes that this process holds now (VmRSS) or held at most (VmHWM)."""
    found = re.search(rf"{field}:\s+(\d+) kB", Path("/proc/self/status").read_text("utf-8"))
    assert found is not None
    return 1024 * int(found[1])


def _warm_up() -> None:
    """Load what reading loads, so that only pixels are measured."""
    small = Image.new("RGB", (64, 64))
    with tempfile.TemporaryDirectory() as folder:
        project = Project.create(Path(folder), "door", StateNames("open", "closed"))
        for kind in ("JPEG", "PNG", "WEBP", "BMP", "AVIF"):
            project.add(_saved(small, kind), kind)
        out = io.BytesIO()
        pillow_heif.from_pillow(small).save(out)
        pixels = read_picture(out.getvalue()).pixels
        list(
            late_copies(
                pixels, pixel_hash(pixels), Augmentation(AugmentationKind.GAUSSIAN_NOISE), 0
            )
        )


def main(arguments: Sequence[str]) -> None:
    """Make a picture, or read it and print what that added."""
    what, name, path = arguments
    make, work = PEAKS[name]
    if what == "make":
        Path(path).write_bytes(make())
        return
    data = Path(path).read_bytes()
    _warm_up()
    before = _memory("VmRSS")
    work(data)
    print(_memory("VmHWM") - before)


if __name__ == "__main__":
    main(sys.argv[1:])
