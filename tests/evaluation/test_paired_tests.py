"""Paired tests, Holm's correction and the number of needed images against other ways to count."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from vqa_state.evaluation.paired_tests import (
    LEVEL,
    MAX_IMAGES,
    POWER,
    PairedTest,
    compare,
    holm,
    images_needed,
    mcnemar,
    power,
)

SIDES = st.tuples(st.integers(0, 40), st.integers(0, 40))
P_VALUES = st.lists(st.floats(0, 1), max_size=8)


def pair_of(only_first, only_second, n_images=None) -> PairedTest:
    return PairedTest(n_images or only_first + only_second, only_first, only_second)


def recognized(only_first, only_second, both=0, neither=0):
    """Two arrays with so many images of each kind."""
    first = [1] * only_first + [0] * only_second + [1] * both + [0] * neither
    second = [0] * only_first + [1] * only_second + [1] * both + [0] * neither
    return np.array(first, dtype=bool), np.array(second, dtype=bool)


# --- the paired test --------------------------------------------------------------------------


@given(SIDES)
def test_p_value_is_scipys(sides):
    only_first, only_second = sides
    expected = binomtest(only_first, sum(sides)).pvalue if sum(sides) else 1.0
    assert pair_of(only_first, only_second).p_value == pytest.approx(expected, rel=1e-12)


@given(SIDES)
def test_p_value_is_symmetric_and_a_probability(sides):
    test, swapped = pair_of(*sides), pair_of(*reversed(sides))
    assert test.p_value == swapped.p_value
    assert 0 < test.p_value <= 1
    assert test.difference == -swapped.difference


@given(SIDES)
def test_one_more_image_for_the_better_one_never_raises_p(sides):
    fewer, more = sorted(sides)
    assert pair_of(more + 1, fewer).p_value <= pair_of(more, fewer).p_value


@given(SIDES, st.integers(0, 5), st.integers(0, 5))
def test_only_differing_images_count(sides, both, neither):
    test = mcnemar(*recognized(*sides, both, neither))
    assert (test.n_only_first, test.n_only_second) == sides
    assert test.n_images == sum(sides) + both + neither
    assert test.p_value == pair_of(*sides).p_value


def test_many_images_are_no_trouble():
    assert pair_of(6000, 5000).p_value == pytest.approx(binomtest(6000, 11000).pvalue)


def test_the_same_images_are_needed():
    with pytest.raises(ValueError, match="need the same images"):
        mcnemar(np.ones(2, dtype=bool), np.ones(1, dtype=bool))
    with pytest.raises(ValueError, match="parts of all 2 images"):
        PairedTest(2, 2, 1)
    with pytest.raises(ValueError, match="parts of all 2 images"):
        PairedTest(2, -1, 1)


# --- Holm -------------------------------------------------------------------------------------


def holm_rejects(p_values, level):
    """The procedure as Holm wrote it: from the smallest up, until one is too large."""
    rejected = [False] * len(p_values)
    for rank, place in enumerate(np.argsort(p_values, kind="stable")):
        if p_values[place] > level / (len(p_values) - rank):
            break
        rejected[place] = True
    return rejected


@given(P_VALUES, st.floats(0.001, 0.999))
def test_corrected_values_decide_as_holms_procedure(p_values, level):
    corrected = holm(p_values)
    if any(math.isclose(p, level, rel_tol=1e-9) for p in corrected):
        return  # the product and the quotient may round to different sides
    assert [p <= level for p in corrected] == holm_rejects(p_values, level)


@given(P_VALUES)
def test_laws_of_holm(p_values):
    corrected = holm(p_values)
    assert all(raw <= p <= 1 for raw, p in zip(p_values, corrected, strict=True))
    order = np.argsort(p_values, kind="stable")
    assert sorted(corrected) == [corrected[place] for place in order]
    backwards = holm(p_values[::-1])
    assert sorted(backwards) == sorted(corrected)


@given(P_VALUES.filter(bool), st.data())
def test_a_smaller_p_value_raises_no_corrected_one(p_values, data):
    place = data.draw(st.integers(0, len(p_values) - 1))
    smaller = list(p_values)
    smaller[place] *= data.draw(st.floats(0, 1))
    pairs = zip(holm(smaller), holm(p_values), strict=True)
    assert all(after <= before for after, before in pairs)


def test_holm_by_hand():
    assert holm([0.04, 0.01, 0.03]) == pytest.approx((0.06, 0.03, 0.06))
    assert holm([0.2]) == (0.2,)
    assert holm([]) == ()
    with pytest.raises(ValueError, match=r"p-values must be in \[0, 1\]"):
        holm([1.5])


# --- power ------------------------------------------------------------------------------------


def power_by_enumeration(n_images, only_first, only_second, level):
    """Every possible outcome, judged by SciPy's test and weighed by its probability."""
    total = 0.0
    for a, b in product(range(n_images + 1), repeat=2):
        if a + b <= n_images and a > b and binomtest(a, a + b).pvalue <= level:
            ways = math.comb(n_images, a) * math.comb(n_images - a, b)
            rest = max(0.0, 1 - only_first - only_second)
            total += ways * only_first**a * only_second**b * rest ** (n_images - a - b)
    return total


@pytest.mark.parametrize("n_images", [0, 1, 5, 6, 7, 13, 24])
@pytest.mark.parametrize(
    "shares", [(0.0, 0.0), (0.3, 0.0), (1.0, 0.0), (0.5, 0.5), (0.4, 0.1), (0.05, 0.6)]
)
@pytest.mark.parametrize("level", [0.05, 0.05 / 3, 0.2])
def test_power_is_the_share_of_outcomes_that_pass(n_images, shares, level):
    expected = power_by_enumeration(n_images, *shares, level)
    assert power(n_images, *shares, level) == pytest.approx(expected, abs=1e-12)


def test_power_at_many_images_is_that_of_simulated_tests():
    rng = np.random.default_rng(0)
    outcomes = rng.multinomial(400, [0.2, 0.14, 0.66], size=4000)
    p_values = {(a, b): pair_of(a, b).p_value for a, b in set(map(tuple, outcomes[:, :2].tolist()))}
    passed = [a > b and p_values[a, b] <= LEVEL for a, b in outcomes[:, :2].tolist()]
    assert power(400, 0.2, 0.14) == pytest.approx(np.mean(passed), abs=0.03)


# --- needed images ----------------------------------------------------------------------------


@given(st.integers(0, 12), st.integers(0, 12), st.integers(0, 20))
@settings(max_examples=40, deadline=None)
def test_the_number_is_where_the_power_reaches_80_percent(only_first, only_second, rest):
    test = pair_of(only_first, only_second, only_first + only_second + rest)
    needed = images_needed(test)
    if only_first == only_second:
        assert needed is None
        return
    shares = [side / test.n_images for side in sorted((only_first, only_second), reverse=True)]
    assert needed > test.n_images
    assert needed == MAX_IMAGES or power(needed, *shares) >= POWER
    assert needed == test.n_images + 1 or power(needed - 1, *shares) < POWER


@pytest.mark.parametrize("sides", [(3, 0, 20), (4, 1, 20), (2, 0, 20), (5, 2, 7), (4, 0, 4)])
def test_the_number_is_near_the_smallest_of_all(sides):
    test = PairedTest(sides[2], *sides[:2])
    shares = sides[0] / sides[2], sides[1] / sides[2]
    smallest = next(n for n in range(sides[2] + 1, 1000) if power(n, *shares) >= POWER)
    assert smallest <= images_needed(test) <= 1.2 * smallest


def test_the_number_does_not_depend_on_the_order():
    assert images_needed(pair_of(5, 1, 20)) == images_needed(pair_of(1, 5, 20))


def test_a_stricter_level_needs_more():
    numbers = [images_needed(pair_of(4, 1, 20), LEVEL / k) for k in (1, 2, 4, 8)]
    assert numbers == sorted(set(numbers))


def test_a_hopeless_difference_ends_at_the_largest_number():
    assert images_needed(pair_of(500, 499, 1000)) == MAX_IMAGES


# --- sentences --------------------------------------------------------------------------------


def one(only_first, only_second, both=0, neither=0):
    first, second = recognized(only_first, only_second, both, neither)
    (comparison,) = compare({"s+": first, "one question": second}, [("s+", "one question")])
    return comparison


def test_a_difference_that_may_be_luck():
    comparison = one(3, 0, 12, 5)
    assert comparison.level == LEVEL
    # 52 images in all: P(Bin(52, 3/20) >= 6) is the first above 80 %, and 6 of 6 gives p = 0.031.
    assert comparison.n_more == 32
    assert comparison.sentence() == (
        "s+ recognizes 3 more images than one question; with 20 test images that cannot be told "
        "from luck (p = 0.25); if the difference is real, roughly 35 more would show it."
    )


@pytest.mark.parametrize(
    ("sides", "sentence"),
    [
        (
            (8, 0, 12),
            "s+ recognizes 8 more images than one question; with 20 test images that is more "
            "than luck (p = 0.0078).",
        ),
        (
            (0, 12, 8),
            "s+ recognizes 12 fewer images than one question; with 20 test images that is more "
            "than luck (p < 0.001).",
        ),
        (
            (1, 0, 0),
            "s+ recognizes 1 more image than one question; with 1 test image that cannot be told "
            "from luck (p = 1); if the difference is real, roughly 5 more would show it.",
        ),
        (
            (2, 2, 16),
            "s+ recognizes as many of the 20 test images as one question; each recognizes 2 that "
            "the other does not.",
        ),
        ((0, 0, 20), "s+ and one question recognize the same of the 20 test images."),
        ((0, 0, 0), "Without test images, nothing says whether s+ beats one question."),
        (
            (500, 499, 1),
            "s+ recognizes 1 more image than one question; with 1000 test images that cannot be "
            "told from luck (p = 1); if the difference is real, it would take more than 100,000 "
            "to show it.",
        ),
    ],
)
def test_sentences(sides, sentence):
    assert one(*sides).sentence() == sentence


def test_several_comparisons_are_corrected_together():
    first, second = recognized(6, 0, 14)
    _, third = recognized(8, 0, 12)
    arrays = {"s+": first, "one": second, "all": third, "again": first}
    pairs = [("s+", "one"), ("s+", "all"), ("s+", "again")]
    one_, all_, again = compare(arrays, pairs)
    assert [c.test.p_value for c in (one_, all_)] == [2 / 2**6, 2 / 2**8]
    assert all_.p_value == 3 * 2 / 2**8
    assert one_.p_value == 2 * 2 / 2**6
    assert (all_.level, one_.level, again.level) == (LEVEL / 3, LEVEL / 2, LEVEL)
    assert all_.significant
    assert not one_.significant
    assert "(p = 0.062, corrected for 3 comparisons); if the difference is real" in one_.sentence()
    assert again.n_more is None


def test_the_sentence_names_the_images():
    assert "with 20 training images that" in one(3, 0, 17).sentence("training images")


@given(st.lists(st.tuples(st.booleans(), st.booleans(), st.booleans()), max_size=12))
@settings(deadline=None, max_examples=30)
def test_the_number_comes_exactly_with_the_doubt(images):
    columns = np.array(images, dtype=bool).reshape(-1, 3).T
    arrays = dict(zip("abc", columns, strict=True))
    comparisons = compare(arrays, [("a", "b"), ("a", "c"), ("b", "c")])
    assert [c.p_value for c in comparisons] == list(holm([c.test.p_value for c in comparisons]))
    for comparison in comparisons:
        doubtful = comparison.test.difference != 0 and not comparison.significant
        assert (comparison.n_more is not None) == doubtful
        assert ("more would show it" in comparison.sentence()) == doubtful
