"""A picture is the same picture in whatever form it is given."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pictures import draw, encode
from PIL import Image

from vqa_state.errors import ImageError
from vqa_state.images import picture_input
from vqa_state.images.picture_input import picture_bytes, picture_pixels
from vqa_state.images.reading import read_picture


def test_all_forms_give_the_same_pixels(tmp_path):
    drawn = draw(1)
    path = tmp_path / "photo.png"
    path.write_bytes(encode(drawn))
    forms = [path, str(path), path.read_bytes(), drawn, np.asarray(drawn)]
    assert {picture_pixels(form).tobytes() for form in forms} == {drawn.tobytes()}
    assert {read_picture(picture_bytes(form)).pixels.tobytes() for form in forms} == {
        drawn.tobytes()
    }


@settings(max_examples=20)
@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 99))
def test_an_array_goes_through_a_file_without_loss(height, width, seed):
    array = np.random.default_rng(seed).integers(0, 256, (height, width, 3), np.uint8)
    assert (np.asarray(picture_pixels(array)) == array).all()
    assert (np.asarray(picture_pixels(picture_bytes(array))) == array).all()


def test_an_array_turned_to_rgb_by_a_view_is_taken():
    bgr = np.asarray(draw(2))
    assert (np.asarray(picture_pixels(bgr[:, :, ::-1])) == bgr[:, :, ::-1]).all()


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((4, 5), np.uint8),
        np.zeros((4, 5, 4), np.uint8),
        np.zeros((3, 4, 5), np.uint8),
        np.zeros((4, 5, 3), np.float32),
        np.zeros((4, 5, 3), np.int64),
        np.zeros((0, 5, 3), np.uint8),
        np.zeros((1, 4, 5, 3), np.uint8),
    ],
    ids=lambda array: f"{array.dtype}{array.shape}",
)
def test_another_array_is_refused_with_what_it_is(array):
    with pytest.raises(ImageError, match=r"uint8 of shape \(height, width, 3\)") as caught:
        picture_pixels(array)
    assert f"{array.dtype} {array.shape}" in str(caught.value)
    with pytest.raises(ImageError):
        picture_bytes(array)


@pytest.mark.parametrize("what", [None, 7, ["photo.jpg"], bytearray(b"x")])
def test_what_is_no_picture_is_refused_by_its_type(what):
    with pytest.raises(ImageError, match=f"got {type(what).__name__}"):
        picture_pixels(what)


def test_pillow_images_of_other_modes_become_rgb():
    assert picture_pixels(draw(1).convert("L")).mode == "RGB"
    clear = Image.new("RGBA", (3, 2), (255, 0, 0, 0))
    assert picture_pixels(clear).getpixel((0, 0)) == (255, 255, 255)


def test_a_pillow_image_that_is_cut_off_is_damaged(tmp_path):
    path = tmp_path / "cut.png"
    path.write_bytes(encode(draw(1, (400, 300)))[:-300])
    with Image.open(path) as opened, pytest.raises(ImageError, match="damaged"):
        picture_pixels(opened)


def test_the_limit_of_files_holds_for_arrays_and_pillow_images(monkeypatch):
    monkeypatch.setattr(picture_input, "MAX_PIXELS", 700)
    with pytest.raises(ImageError, match="32 × 24 pixels"):
        picture_pixels(draw(1))
    with pytest.raises(ImageError, match="32 × 24 pixels"):
        picture_pixels(np.asarray(draw(1)))
