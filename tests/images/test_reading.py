"""Reading a picture safely: every kind of file, every turn, and what must be refused."""

import io
import resource
import struct
import tracemalloc
import zlib

import numpy as np
import pillow_heif
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pictures import draw, encode, picture
from PIL import Image

from vqa_state.errors import ImageError
from vqa_state.images import reading
from vqa_state.images.near_duplicates import perceptual_hash
from vqa_state.images.reading import Picture, content_hash, pixel_hash, read_picture, thumbnail


def heic(pixels, **options):
    out = io.BytesIO()
    pillow_heif.from_pillow(pixels).save(out, quality=-1, **options)
    return out.getvalue()


def as_array(data):
    return np.asarray(read_picture(data).pixels).astype(int)


@pytest.mark.parametrize(
    ("kind", "suffix", "options"),
    [
        ("PNG", "png", {}),
        ("BMP", "bmp", {}),
        ("WEBP", "webp", {"lossless": True}),
        ("WEBP", "webp", {"quality": 95}),
        ("JPEG", "jpg", {"quality": 95, "subsampling": 0}),
        ("JPEG", "jpg", {"quality": 95, "subsampling": 0, "progressive": True}),
    ],
)
def test_every_kind_is_read(kind, suffix, options):
    read = read_picture(picture(1, kind, **options))
    assert read.suffix == suffix
    assert (read.pixels.mode, read.pixels.size) == ("RGB", (32, 24))
    difference = np.asarray(read.pixels).astype(int) - np.asarray(draw(1))
    assert np.abs(difference).mean() < (15 if options.get("quality") else 1e-9)


def test_heic_is_read():
    read = read_picture(heic(draw(1, (64, 48))))
    assert (read.suffix, read.pixels.mode, read.pixels.size) == ("heic", "RGB", (64, 48))
    difference = np.asarray(read.pixels).astype(int) - np.asarray(draw(1, (64, 48)))
    assert np.abs(difference).mean() < 30


def test_a_phones_jpeg_with_a_second_picture_inside_is_a_jpeg():
    data = encode(draw(1), "MPO", save_all=True, append_images=[draw(2)])
    read = read_picture(data)
    assert read.suffix == "jpg"
    assert np.abs(np.asarray(read.pixels).astype(int) - np.asarray(draw(1))).mean() < 30


TURNS = {  # EXIF tag: where pixel (x, y) of the stored picture is shown
    1: lambda a: a,
    2: lambda a: a[:, ::-1],
    3: lambda a: a[::-1, ::-1],
    4: lambda a: a[::-1],
    5: lambda a: a.transpose(1, 0, 2),
    6: lambda a: np.rot90(a, -1),
    7: lambda a: a[::-1, ::-1].transpose(1, 0, 2),
    8: lambda a: np.rot90(a),
}


@pytest.mark.parametrize("kind", ["PNG", "WEBP"])
@pytest.mark.parametrize("tag", TURNS)
def test_exif_turns(kind, tag):
    exif = Image.Exif()
    exif[0x0112] = tag
    options = {"lossless": True} if kind == "WEBP" else {}
    data = picture(3, kind, exif=exif.tobytes(), **options)
    assert (as_array(data) == TURNS[tag](np.asarray(draw(3)))).all()


@pytest.mark.parametrize("tag", TURNS)
def test_heic_is_turned_once(tag):
    upright = draw(3, (64, 48))
    exif = Image.Exif()
    exif[0x0112] = tag
    shown = as_array(heic(upright, exif=exif.tobytes()))
    expected = TURNS[tag](np.asarray(upright)).astype(int)
    assert shown.shape == expected.shape
    assert np.abs(shown - expected).mean() < 30


@pytest.mark.filterwarnings("ignore:.*EXIF")
def test_damaged_exif_does_not_matter():
    data = picture(1, "JPEG", exif=b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x63")
    assert read_picture(data).pixels.size == (32, 24)


def test_palette():
    colours = Image.fromarray(np.repeat([[[255, 0, 0], [0, 0, 255]]], 2, 0).astype(np.uint8))
    data = encode(colours.quantize(2))
    assert (as_array(data) == np.asarray(colours)).all()


def test_what_is_transparent_becomes_white():
    rgba = np.zeros((1, 3, 4), np.uint8)
    rgba[0, :, 0] = 200
    rgba[0, :, 3] = 0, 255, 51
    assert as_array(encode(Image.fromarray(rgba))).tolist() == [
        [[255, 255, 255], [200, 0, 0], [244, 204, 204]]
    ]
    grey = encode(Image.fromarray(np.array([[[7, 0], [7, 255]]], np.uint8)))
    assert as_array(grey).tolist() == [[[255] * 3, [7] * 3]]
    palette = Image.new("P", (2, 1))
    palette.putpalette([9, 9, 9, 1, 2, 3])
    palette.putpixel((1, 0), 1)
    assert as_array(encode(palette, transparency=0)).tolist() == [[[255] * 3, [1, 2, 3]]]


def test_16_bit_grey_is_scaled():
    values = np.array([[0, 256, 257, 128 * 257, 65534, 65535]], np.uint16)
    assert as_array(encode(Image.fromarray(values)))[0, :, 0].tolist() == [0, 0, 1, 128, 254, 255]


def test_grey_and_two_colours():
    grey = Image.fromarray(np.array([[0, 100, 255]], np.uint8))
    assert as_array(encode(grey))[0].tolist() == [[0] * 3, [100] * 3, [255] * 3]
    assert as_array(encode(grey.convert("1", dither=Image.Dither.NONE)))[0, :, 1].tolist() == [
        0,
        0,
        255,
    ]


def test_cmyk():
    red = Image.new("CMYK", (16, 16), (0, 255, 255, 0))
    r, g, b = as_array(encode(red, "JPEG", quality=95))[8, 8]
    assert r > 240
    assert max(g, b) < 15


def test_an_animated_webp_is_its_first_frame():
    data = encode(draw(1), "WEBP", save_all=True, append_images=[draw(2)], lossless=True)
    assert (as_array(data) == np.asarray(draw(1))).all()


SVG = b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg"><rect/></svg>'


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"hello", b"this is no picture.jpg" * 100, SVG, b"%PDF-1.7 ", b"\xff\xd8", b"RIFF"),
        *(picture(1, kind) for kind in ("GIF", "TIFF", "PPM")),
    ],
    ids=["empty", "text", "longer", "svg", "pdf", "jpeg-start", "riff", "gif", "tiff", "ppm"],
)
def test_what_is_no_picture_is_refused(data):
    with pytest.raises(ImageError, match=r"use JPEG, PNG, WebP, BMP or HEIC|damaged"):
        read_picture(data)


FILES = {
    "png": picture(1),
    "jpeg": picture(1, "JPEG"),
    "bmp": picture(1, "BMP"),
    "webp": picture(1, "WEBP"),
    "heic": heic(draw(1, (64, 48))),
    "exif": picture(1, "JPEG", exif=(lambda e: (e.__setitem__(0x0112, 6), e)[1])(Image.Exif())),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_file_cut_in_half_is_refused(kind):
    with pytest.raises(ImageError, match=r"damaged|cannot be read"):
        read_picture(FILES[kind][: len(FILES[kind]) // 2])


def only_image_errors(data):
    try:
        assert read_picture(data).pixels.mode == "RGB"
    except ImageError:
        return


@given(st.binary(max_size=400))
def test_random_bytes_raise_nothing_but_image_errors(data):
    only_image_errors(data)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", FILES)
@settings(max_examples=60)
@given(changes=st.lists(st.tuples(st.integers(0, 2**16), st.binary(max_size=6)), max_size=6))
def test_mutated_files_raise_nothing_but_image_errors(kind, changes):
    data = bytearray(FILES[kind])
    for place, new in changes:
        at = place % len(data)
        data[at : at + len(new)] = new
    only_image_errors(bytes(data))


def huge_png(width, height):
    """A file of few kilobytes whose header promises width × height pixels, all there and black."""

    def chunk(kind, body):
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    packer = zlib.compressobj(9)
    row = bytes(1 + (width + 7) // 8)
    rows = b"".join(packer.compress(row * 100) for _ in range(height // 100)) + packer.flush()
    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize("side", [8100, 9000, 13000, 20000])
def test_a_small_file_with_many_pixels_is_refused_before_it_is_decoded(side):
    data = huge_png(side, side)
    assert len(data) < 60_000
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # kB
    tracemalloc.start()
    try:
        with pytest.raises(ImageError, match=r"64 million.*save it smaller"):
            read_picture(data)
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000


def test_the_huge_picture_is_a_real_one():
    assert read_picture(huge_png(800, 800)).pixels.size == (800, 800)


def test_the_limit_of_pixels_itself_is_allowed(monkeypatch):
    monkeypatch.setattr(reading, "MAX_PIXELS", 32 * 24)
    assert read_picture(picture(1)).pixels.size == (32, 24)
    monkeypatch.setattr(reading, "MAX_PIXELS", 32 * 24 - 1)
    for data in (picture(1), heic(draw(1))):
        with pytest.raises(ImageError, match="32 × 24 pixels"):
            read_picture(data)


def test_too_many_bytes_are_refused(monkeypatch):
    data = picture(1)
    monkeypatch.setattr(reading, "MAX_BYTES", len(data))
    read_picture(data)
    monkeypatch.setattr(reading, "MAX_BYTES", len(data) - 1)
    with pytest.raises(ImageError, match=r"more than 0 MB.*save it smaller"):
        read_picture(data)


def test_the_same_pixels_from_different_files_have_one_hash():
    files = [
        picture(1),
        picture(1, compress_level=0),
        picture(1, "BMP"),
        picture(1, "WEBP", lossless=True),
    ]
    assert len({content_hash(data) for data in files}) == 4
    assert len({pixel_hash(read_picture(data).pixels) for data in files}) == 1
    assert pixel_hash(draw(1)) == pixel_hash(read_picture(files[0]).pixels)


def test_size_belongs_to_the_hash():
    assert pixel_hash(Image.new("RGB", (2, 8))) != pixel_hash(Image.new("RGB", (4, 4)))
    assert pixel_hash(draw(1)) != pixel_hash(draw(2))


def test_content_hash_is_sha256():
    assert content_hash(b"abc").startswith("ba7816bf8f01cfea414140de5dae2223")


def distance(one, other):
    return (int(one, 16) ^ int(other, 16)).bit_count()


def test_pictures_that_look_alike_have_close_perceptual_hashes():
    big = draw(1, (320, 240))
    small = big.resize((160, 120))
    brighter = big.point(lambda value: min(255, value + 8))
    assert distance(perceptual_hash(big), perceptual_hash(small)) <= 4
    assert distance(perceptual_hash(big), perceptual_hash(brighter)) <= 4
    assert distance(perceptual_hash(big), perceptual_hash(draw(2, (320, 240)))) > 12
    assert len(perceptual_hash(Image.new("RGB", (9, 9)))) == 16


@pytest.mark.parametrize(
    ("size", "small"),
    [
        ((1024, 512), (256, 128)),
        ((512, 2048), (64, 256)),
        ((30, 20), (30, 20)),
        ((5000, 1), (256, 1)),
    ],
)
def test_a_thumbnail_is_small_and_keeps_its_shape(size, small):
    pixels = draw(1, size)
    shown = Image.open(io.BytesIO(thumbnail(pixels)))
    assert (shown.format, shown.size) == ("WEBP", small)
    assert pixels.size == size


def test_a_picture_is_rgb():
    with pytest.raises(ValueError, match="got mode 'L'"):
        Picture(Image.new("L", (1, 1)), "png")
