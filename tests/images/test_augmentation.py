"""Shifted copies: the same everywhere, for ever, and as the rule says."""

import hashlib
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pictures import draw
from PIL import Image

from vqa_state.images.augmentation import (
    Augmentation,
    AugmentationKind,
    copies,
    copy_of,
    rgb_shifts,
)
from vqa_state.images.reading import pixel_hash

HASH = "0123456789abcdef" * 4
NOISE = Augmentation(AugmentationKind.GAUSSIAN_NOISE)


def shift_by_the_rule(seed, image_hash, number, channel, amount):
    """The first 64 bits of a SHA-256 as a number in [0, 1], stretched to [-amount, amount]."""
    digest = hashlib.sha256(f"{seed}:{image_hash}:{number}:{channel}".encode()).hexdigest()
    return (int(digest[:16], 16) / 2**64 * 2 - 1) * amount


@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("seed", [0, 1, 2**32 - 1])
def test_shifts_follow_the_rule(seed, number):
    expected = [shift_by_the_rule(seed, HASH, number, channel, 0.1) for channel in range(3)]
    assert list(rgb_shifts(HASH, 0.1, seed, number)) == expected


# Written down once; a change of these makes every stored answer worthless.
GOLDEN = {
    (0, 0): (0.08159569972910852, -0.04632143063262424, 0.08275193350826981),
    (0, 5): (-0.03239921945579182, -0.01457479824768474, -0.07295543380369993),
    (7, 1): (0.09951253456454262, 0.03486586715429927, -0.08896665176978832),
}


@pytest.mark.parametrize(("seed", "number"), GOLDEN)
def test_shifts_never_change(seed, number):
    assert rgb_shifts(HASH, 0.1, seed, number) == pytest.approx(GOLDEN[seed, number], abs=1e-15)


def test_copies_never_change():
    picture = draw(1, (8, 6))
    made = b"".join(copy.tobytes() for copy in copies(picture, HASH, Augmentation(), 0))
    assert (
        hashlib.sha256(made).hexdigest()
        == "da39f15103a8e28227357a32e2ed893d5b8a89853c4060d75080ef08baa09b98"
    )
    made = b"".join(copy.tobytes() for copy in copies(picture, HASH, NOISE, 0))
    assert (
        hashlib.sha256(made).hexdigest()
        == "619645736889eeb3cb40d3eb57e08590d7360ea2cd6a0457f3e17166729d8c5b"
    )


def test_shifts_are_uniform_in_their_range():
    drawn = np.array(
        [rgb_shifts(pixel_hash(draw(n)), 0.1, 0, c) for n in range(200) for c in range(6)]
    )
    assert np.abs(drawn).max() <= 0.1
    counts = np.histogram(drawn, 10, (-0.1, 0.1))[0]
    assert (np.abs(counts - drawn.size / 10) < 5 * np.sqrt(drawn.size / 10)).all()
    assert np.abs(np.corrcoef(drawn.T) - np.eye(3)).max() < 0.15


@given(st.integers(0, 2**32 - 1), st.integers(0, 99), st.floats(0.001, 1.0))
def test_shifts_stay_in_range(seed, number, amount):
    assert all(-amount <= shift <= amount for shift in rgb_shifts(HASH, amount, seed, number))


@pytest.mark.parametrize("amount", [0.1, 1.0])
def test_a_whole_channel_moves_by_one_value_and_is_clipped(amount):
    ramp = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    for number in range(6):
        shifts = rgb_shifts(HASH, amount, 0, number)
        kind = Augmentation(amount=amount)
        moved = np.asarray(copy_of(Image.fromarray(ramp), HASH, kind, 0, number))
        for channel, shift in enumerate(shifts):
            expected = [
                min(255, max(0, int((level + 255 * shift + 0.5) // 1))) for level in range(256)
            ]
            assert moved[0, :, channel].tolist() == expected


def test_a_full_shift_stays_in_range():
    wide = Augmentation(amount=1.0, n_copies=100)
    for copy in copies(draw(1), HASH, wide, 0):
        assert (copy.mode, copy.size) == ("RGB", (32, 24))


@pytest.mark.parametrize("augmentation", [Augmentation(), NOISE])
def test_copies_do_not_depend_on_order(augmentation):
    picture = draw(1)
    forward = [c.tobytes() for c in copies(picture, HASH, augmentation, 3)]
    backward = [copy_of(picture, HASH, augmentation, 3, n).tobytes() for n in range(5, -1, -1)]
    assert forward == backward[::-1]
    fewer = Augmentation(augmentation.kind, n_copies=2)
    assert [c.tobytes() for c in copies(picture, HASH, fewer, 3)] == forward[:2]


@pytest.mark.parametrize("augmentation", [Augmentation(), NOISE])
def test_seeds_copies_and_pictures_differ(augmentation):
    grey = Image.new("RGB", (16, 16), (128, 128, 128))
    every = {
        copy.tobytes()
        for seed in range(3)
        for image_hash in (HASH, HASH[::-1])
        for copy in copies(grey, image_hash, augmentation, seed)
    }
    assert len(every) == 3 * 2 * 6
    assert grey.tobytes() not in every


def test_channels_differ():
    first = rgb_shifts(HASH, 0.1, 0, 0)
    assert len({round(shift, 6) for shift in first}) == 3


def test_the_picture_itself_is_left_alone():
    picture = draw(1)
    before = picture.tobytes()
    list(copies(picture, HASH, Augmentation(), 0))
    list(copies(picture, HASH, NOISE, 0))
    assert picture.tobytes() == before


@pytest.mark.parametrize("amount", [0.02, 0.1])
def test_noise_has_its_deviation(amount):
    grey = Image.new("RGB", (200, 200), (128, 128, 128))
    kind = Augmentation(AugmentationKind.GAUSSIAN_NOISE, amount, 1)
    noise = np.asarray(next(copies(grey, HASH, kind, 0))).astype(float) - 128
    assert abs(noise.mean()) < 0.02 * 255 * amount
    assert noise.std() == pytest.approx(255 * amount, rel=0.02)
    flat = noise.reshape(-1, 3)
    assert np.abs(np.corrcoef(flat.T) - np.eye(3)).max() < 0.03
    assert abs(np.corrcoef(noise[:, :-1].ravel(), noise[:, 1:].ravel())[0, 1]) < 0.03


def test_noise_is_clipped():
    for level in (0, 255):
        flat = Image.new("RGB", (50, 50), (level,) * 3)
        half = np.asarray(next(copies(flat, HASH, NOISE, 0))) == level
        assert half.mean() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("augmentation", [Augmentation(), NOISE])
def test_a_large_picture_is_held_a_few_times_only(augmentation):
    picture = Image.new("RGB", (2000, 1500))
    n_bytes = 2000 * 1500 * 3
    tracemalloc.start()
    try:
        for _ in copies(picture, HASH, augmentation, 0):
            pass
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 12 * n_bytes


@pytest.mark.parametrize("amount", [0.0, -0.1, 1.1, float("nan")])
def test_an_amount_outside_its_range_is_refused(amount):
    with pytest.raises(ValueError, match="above 0 and at most 1"):
        Augmentation(amount=amount)


@pytest.mark.parametrize("n_copies", [0, -1, 101])
def test_a_number_of_copies_outside_its_range_is_refused(n_copies):
    with pytest.raises(ValueError, match="1 to 100"):
        Augmentation(n_copies=n_copies)


def test_the_default_is_the_papers():
    assert Augmentation() == Augmentation(AugmentationKind.RGB_SHIFT, 0.1, 6)
