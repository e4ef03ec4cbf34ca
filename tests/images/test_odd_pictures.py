"""Pictures as cameras and programs make them: odd tags, big chunks, missing ends, huge sizes."""

import io
import struct
import threading
import time
import zlib
from random import Random

import numpy as np
import pillow_heif
import pytest
from pictures import draw, encode, picture
from PIL import Image, ImageFile

from vqa_state.errors import ImageError
from vqa_state.images import (
    Kind,
    check_side,
    limits,
    pixel_hash,
    read_picture,
    reading,
    rgb_pixels,
    shown,
)
from vqa_state.images.augmentation import Augmentation, AugmentationKind, copies
from vqa_state.images.converting import to_rgb
from vqa_state.images.orientation import orientation_of
from vqa_state.project.importing import add_files
from vqa_state.project.project import Project, StateNames


def array(data):
    return np.asarray(read_picture(data).pixels).astype(int)


def exif(*entries, order=">", kind=3, orientation=6):
    """A TIFF of an orientation and further entries (tag, type, count, four bytes)."""
    value = struct.pack(order + {3: "HH", 4: "L", 9: "l"}[kind], orientation, *[0] * (kind == 3))
    tags = sorted([(0x0112, kind, 1, value), *entries])
    packed = b"".join(struct.pack(order + "HHL", *tag[:3]) + tag[3] for tag in tags)
    head = b"MM\0*" if order == ">" else b"II*\0"
    return b"Exif\0\0" + head + struct.pack(order + "LH", 8, len(tags)) + packed + bytes(400)


ODD = {
    "resolution as text": (0x011A, 2, 4, b"72\0\0"),
    "GPS that is no place": (0x8825, 5, 1, b"\0\0\0\x50"),
    "resolution by nothing": (0x011A, 5, 1, b"\0\0\x01\0"),
    "unknown type": (0x9999, 99, 1, b"abcd"),
    "value behind the end": (0x9286, 2, 90_000, b"\0\0\0\x50"),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("entry", ODD.values(), ids=ODD)
@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
def test_an_odd_tag_refuses_nothing_and_the_picture_is_turned(entry, kind):
    options = {"lossless": True} if kind == "WEBP" else {}
    upright = array(picture(1, kind, **options))
    turned = array(picture(1, kind, exif=exif(entry), **options))
    assert (turned == np.rot90(upright, -1)).all()


def test_a_gps_text_stored_as_a_number():
    gps = (0x8825, 4, 1, struct.pack(">L", 60))
    data = exif(gps)
    at = 6 + 60
    ifd = struct.pack(">HHHL4s", 1, 0x0001, 5, 1, b"\0\0\0\x70")
    data = data[:at] + ifd + data[at + len(ifd) :]
    assert (array(picture(1, "JPEG", exif=data)) == np.rot90(array(picture(1, "JPEG")), -1)).all()


def pillows(data, xmp):
    image = Image.new("L", (1, 1))
    image.info = {"exif": data} | ({"xmp": xmp} if xmp else {})
    value = image.getexif().get(0x0112, 1)
    return value if value in range(2, 9) else 1


@pytest.mark.filterwarnings("ignore")
def test_the_orientation_is_the_one_that_pillow_reads():
    draws, n_compared = Random(3), 0
    for _ in range(4000):
        order, kind = draws.choice("<>"), draws.choice([3, 4, 9])
        data = bytearray(exif(order=order, kind=kind, orientation=draws.randint(0, 9)))
        for _ in range(draws.choice([0, 1, 1, 2])):
            data[draws.randrange(6, 40)] = draws.choice([0, 1, 2, 3, 4, 5, 7, 8, 12, 255])
        xmp = b'<x tiff:Orientation="3"/>' if draws.random() < 0.5 else b""
        try:
            expected = pillows(bytes(data), xmp)
        except Exception:  # noqa: BLE001, S112  # Pillow refuses it, or crashes
            continue
        n_compared += 1
        assert orientation_of(bytes(data), xmp) == expected, data.hex()
    assert n_compared > 2000


def test_xmp_turns_where_exif_says_nothing():
    xmp = b'<rdf:Description tiff:Orientation="6"/>'
    upright = array(picture(1, "JPEG"))
    assert (array(picture(1, "JPEG", xmp=xmp)) == np.rot90(upright, -1)).all()
    both = picture(1, "JPEG", xmp=xmp, exif=exif(orientation=3))
    assert (array(both) == upright[::-1, ::-1]).all()


def chunk(name, body, wrong=0):
    checksum = zlib.crc32(name + body) ^ wrong
    return struct.pack(">L", len(body)) + name + body + struct.pack(">L", checksum)


BIG = zlib.compress(bytes(80_000_000))
CHUNKS = {
    "text": chunk(b"tEXt", b"a\0" + b"x" * 3_000_000),
    "packed text": chunk(b"zTXt", b"a\0\0" + BIG),
    "international text": chunk(b"iTXt", b"a\0\1\0\0\0" + BIG),
    "colour profile": chunk(b"iCCP", b"a\0\0" + BIG),
    "wrong checksum": chunk(b"tEXt", b"a\0b", wrong=1),
    "short": chunk(b"pHYs", b"") + chunk(b"gAMA", b"") + chunk(b"acTL", b"") + chunk(b"fcTL", b""),
    "profile of nothing": chunk(b"iCCP", b""),
    "unknown": chunk(b"abCd", b"x" * 100_000),
    "EXIF that is none": chunk(b"eXIf", b"x"),
    "transparency of no use": chunk(b"tRNS", b"1"),
}


@pytest.mark.parametrize("extra", CHUNKS.values(), ids=CHUNKS)
def test_ancillary_chunks_of_any_size_are_passed_over(extra):
    data = picture(1)
    assert (array(data[:33] + extra + data[33:]) == np.asarray(draw(1))).all()
    assert (array(data[:-12] + extra + data[-12:]) == np.asarray(draw(1))).all()


def test_exif_in_a_text_of_png_turns():
    notes = b"\nexif\n10\n" + exif().hex().encode()
    data = picture(1)
    odd = (
        data[:33] + chunk(b"zTXt", b"Raw profile type exif\0\0" + zlib.compress(notes)) + data[33:]
    )
    assert (array(odd) == np.rot90(np.asarray(draw(1)), -1)).all()


JPEGS = {
    "plain": {},
    "progressive": {"progressive": True},
    "restarts": {"restart_marker_blocks": 1},
    "grey": {},
}


@pytest.mark.parametrize("name", JPEGS)
def test_a_jpeg_that_lacks_its_end_is_read_and_one_that_lacks_more_is_cut_off(name):
    pixels = draw(1, (96, 64)).convert("L" if name == "grey" else "RGB")
    data = encode(pixels, "JPEG", **JPEGS[name])
    whole = array(data)
    assert (array(data[:-2]) == whole).all()
    assert (array(data[:-1]) == whole).all()
    for kept in range(2, len(data) - 40, 29):
        with pytest.raises(ImageError, match=r"cut off|is not a picture"):
            read_picture(data[:kept])


@pytest.mark.parametrize("kind", ["PNG", "WEBP", "BMP", "AVIF", "HEIF"])
def test_a_file_that_is_cut_off_is_called_so(kind):
    data = heif(draw(1, (64, 48))) if kind == "HEIF" else encode(draw(1, (64, 48)), kind)
    for kept in range(40, len(data) - 40, max(7, len(data) // 40)):
        with pytest.raises(ImageError, match="cut off"):
            read_picture(data[:kept])


def heif(pixels, **options):
    out = io.BytesIO()
    pillow_heif.from_pillow(pixels).save(out, quality=-1, **options)
    return out.getvalue()


@pytest.mark.parametrize("tag", range(1, 9))
def test_avif_is_read_and_turned_once(tag):
    tags = Image.Exif()
    tags[0x0112] = tag
    upright = draw(2, (64, 48))
    read = read_picture(encode(upright, "AVIF", quality=100, exif=tags.tobytes()))
    plain = read_picture(encode(upright, "AVIF", quality=100))
    assert read.suffix == "avif"
    expected = pixel_hash(rgb_pixels(with_orientation(plain.pixels, tag)))
    assert pixel_hash(read.pixels) == expected


def with_orientation(pixels, tag):
    given = pixels.copy()
    given.getexif()[0x0112] = tag
    return given


@pytest.mark.filterwarnings("ignore:Corrupt EXIF")  # of the writer
def test_odd_exif_in_avif_and_heic():
    placeholder = b"Exif\0\0MM\0*" + bytes(300)
    odd = exif(*ODD.values())[: len(placeholder)].ljust(len(placeholder), b"\0")
    upright = draw(2, (64, 48))
    for data, plain in (
        (encode(upright, "AVIF", exif=placeholder), encode(upright, "AVIF")),
        (heif(upright, exif=placeholder), heif(upright)),
    ):
        assert data.count(placeholder[6:]) == 1
        changed = data.replace(placeholder[6:], odd[6:])
        assert (array(changed) == array(plain)).all()  # there EXIF turns nothing


def test_without_avif_the_true_reason_is_said(monkeypatch):
    monkeypatch.setattr("PIL.features.check", lambda name: False)
    with pytest.raises(ImageError, match="the Pillow installed here cannot read"):
        read_picture(encode(draw(1), "AVIF"))


@pytest.mark.parametrize(
    ("kind", "name"), [("GIF", "a GIF"), ("TIFF", "a TIFF"), ("JPEG2000", "a JPEG 2000")]
)
def test_what_is_not_read_is_named(kind, name):
    with pytest.raises(ImageError, match=f"this is {name}.*save it as JPEG, PNG"):
        read_picture(encode(draw(1), kind))


@pytest.mark.parametrize("error", [AssertionError, ZeroDivisionError, UnicodeError, RecursionError])
def test_no_exception_of_a_decoder_gets_out(monkeypatch, error, tmp_path):
    def fail(self):
        raise error("odd")

    monkeypatch.setattr(ImageFile.ImageFile, "load", fail)
    data = picture(1)
    with pytest.raises(ImageError, match=rf"damaged.*{error.__name__}"):
        read_picture(data)
    project = Project.create(tmp_path, "door", StateNames("open", "closed"))
    report = add_files(project, [("bad.png", data)])
    monkeypatch.undo()
    assert len(report.refused) == 1
    assert len(add_files(project, [("1.png", data), ("2.png", picture(2))]).added) == 2


def test_an_interrupt_gets_out(monkeypatch):
    def stop(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(ImageFile.ImageFile, "load", stop)
    with pytest.raises(KeyboardInterrupt):
        read_picture(picture(1))


def test_an_odd_header_leaves_check_side_silent():
    check_side(b"BM" + bytes(100))
    with pytest.raises(ImageError, match="8 × 24"):
        check_side(encode(draw(1, (8, 24)), "JPEG"))


@pytest.mark.parametrize("size", [(80, 60), (81, 61), (120, 200)])
def test_a_large_jpeg_is_decoded_at_half_its_size(monkeypatch, size):
    data = encode(draw(1, size), "JPEG", quality=95)
    whole = read_picture(data).pixels
    assert whole.size == size
    monkeypatch.setattr(limits, "MAX_PIXELS", size[0] * size[1] - 1)
    half = read_picture(data).pixels
    assert half.size == tuple(-(-side // 2) for side in size)
    expected = np.asarray(whole.resize(half.size, Image.Resampling.BOX)).astype(int)
    assert np.abs(np.asarray(half) - expected).mean() < 12
    monkeypatch.setattr(limits, "MAX_PIXELS", size[0] * size[1] // 4 - 1)
    with pytest.raises(ImageError, match="of a JPEG at most"):
        read_picture(data)


def test_a_progressive_jpeg_is_never_halved(monkeypatch):
    data = encode(draw(1, (80, 60)), "JPEG", progressive=True)
    monkeypatch.setattr(limits, "MAX_PIXELS", 80 * 60 - 1)
    with pytest.raises(ImageError, match="of a progressive JPEG at most"):
        read_picture(data)


def test_every_kind_names_its_own_limit():
    for kind in Kind:
        most = limits.most_pixels(kind)
        limits.check_pixels(kind, most, 1)
        with pytest.raises(ImageError, match=rf"of {kind.value.name} at most {most // 10**6} mill"):
            limits.check_pixels(kind, most + 1, 1)
        decoded = most / 4 if kind is Kind.JPEG else most
        assert decoded * kind.value.bytes_per_pixel <= limits.MAX_MEMORY


def test_a_webp_of_34_bytes_is_refused_by_its_header():
    width = height = 8000
    bits = (width - 1) | (height - 1) << 14
    body = b"\x2f" + struct.pack("<L", bits) + bytes(8)
    data = b"RIFF" + struct.pack("<L", 12 + len(body) + 1) + b"WEBPVP8L"
    data += struct.pack("<L", len(body)) + body + b"\0"
    with pytest.raises(ImageError, match="8000 × 8000 pixels; of a WebP at most 36 million"):
        read_picture(data)


def test_large_pictures_take_turns_and_small_ones_do_not(monkeypatch):
    large, small = encode(draw(1, (64, 64))), encode(draw(2, (16, 16)))
    monkeypatch.setattr(limits, "LARGE", 64 * 64 * Kind.PNG.value.bytes_per_pixel - 1)
    done = []
    with reading(large):
        threads = [
            threading.Thread(target=lambda data=data: done.append(read_picture(data).pixels.size))
            for data in (large, small)
        ]
        for thread in threads:
            thread.start()
        threads[1].join(30)
        time.sleep(0.05)
        assert done == [(16, 16)]
    threads[0].join(30)
    assert done == [(16, 16), (64, 64)]


MODES = ["RGBA", "LA", "L", "1", "CMYK", "I;16", "P"]


@pytest.mark.parametrize("mode", MODES)
def test_strips_give_what_the_whole_gives(monkeypatch, mode):
    pixels = draw(1, (50, 40)).convert("RGBA")
    pixels.putalpha(draw(2, (50, 40)).convert("L"))
    if mode == "I;16":
        pixels = Image.fromarray(np.asarray(pixels.convert("L")).astype(np.uint16) * 200)
    else:
        pixels = pixels if mode == "RGBA" else pixels.convert("RGB").convert(mode)
    whole = to_rgb(pixels)
    monkeypatch.setattr("vqa_state.images.converting._STRIP_PIXELS", 117)
    assert to_rgb(pixels).tobytes() == whole.tobytes()
    assert pixel_hash(whole) == pixel_hash(whole.copy())


def test_the_hash_and_the_copies_do_not_depend_on_strips(monkeypatch):
    pixels = draw(1, (51, 41))
    noise = Augmentation(AugmentationKind.GAUSSIAN_NOISE, 0.2, 2)
    before = pixel_hash(pixels), [c.tobytes() for c in copies(pixels, "a" * 64, noise, 1)]
    monkeypatch.setattr("vqa_state.images.converting._STRIP_PIXELS", 117)
    assert (pixel_hash(pixels), [c.tobytes() for c in copies(pixels, "a" * 64, noise, 1)]) == before


def test_upright_rgb_pixels_are_not_copied():
    pixels = draw(1)
    assert rgb_pixels(pixels) is pixels


def test_a_picture_for_the_browser_is_a_webp_of_its_own_shape():
    opened = Image.open(io.BytesIO(shown(draw(1, (4096, 1024)))))
    assert (opened.format, opened.size) == ("WEBP", (2048, 512))
    assert Image.open(io.BytesIO(shown(draw(1)))).size == (32, 24)
