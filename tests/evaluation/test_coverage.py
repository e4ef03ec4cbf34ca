"""The smallest sureness for a verdict, and what it costs in coverage: by counting, and by laws."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import beta, binomtest

from vqa_state.evaluation.coverage import MAX_POINTS, choose_point, coverage_curve

ANSWERS = st.sampled_from([-1, 0, 1])


@st.composite
def out_of_bag(draw):
    """Single votes of some bags: sureness, states, labels, groups."""
    n_images = draw(st.integers(1, 6))
    shape = draw(st.integers(1, 4)), n_images
    sure = st.sampled_from([0.0, 0.25, 0.5, 1 / 3, 0.7, 1.0, math.nan]) | st.floats(0, 1)
    sureness = draw(arrays(np.float64, shape, elements=sure))
    sureness[0, 0] = 0.5  # at least one known
    states = draw(arrays(np.int8, shape, elements=ANSWERS))
    sureness[states == 0] *= 0  # a tie is never sure
    labels = draw(arrays(np.int8, n_images, elements=st.sampled_from([-1, 1])))
    return sureness, states, labels, draw(arrays(np.int64, n_images, elements=st.integers(0, 9)))


def listed(seen):
    """Every vote that there is, one by one: sureness, state, label, group."""
    sureness, states, labels, groups = seen
    return [
        (float(sureness[bag, image]), int(states[bag, image]), int(labels[image]), groups[image])
        for bag, image in np.ndindex(sureness.shape)
        if not math.isnan(sureness[bag, image])
    ]


@given(out_of_bag())
@settings(deadline=None, max_examples=40)
def test_points_count_what_their_threshold_would_do(seen):
    for point in coverage_curve(*seen):
        got = [vote for vote in listed(seen) if vote[1] != 0 and vote[0] >= point.min_sureness]
        right = sum(state == label for _, state, label, _ in got)
        assert (point.n_covered, point.n_correct) == (len(got), right)
        assert point.n_votes == len(listed(seen))
        assert point.n_images == np.count_nonzero(~np.isnan(seen[0]).all(axis=0))
        assert point.coverage == len(got) / point.n_votes
        if not got:
            assert math.isnan(point.accuracy)
            continue
        assert point.accuracy == right / len(got)
        of_group = [sum(vote[3] == group for vote in got) for group in {vote[3] for vote in got}]
        n_independent = len(got) ** 2 / sum(n * n for n in of_group)
        assert len(of_group) >= n_independent - 1e-9 >= 1 - 2e-9
        known = right / len(got) * n_independent
        low = beta.ppf(0.025, known, n_independent - known + 1) if right else 0
        high = beta.ppf(0.975, known + 1, n_independent - known) if right < len(got) else 1
        assert (point.interval.low, point.interval.high) == pytest.approx((low, high), abs=1e-9)


@given(out_of_bag())
@settings(deadline=None, max_examples=20)
def test_one_vote_an_image_has_the_exact_interval(seen):
    sureness, states, labels, _ = seen
    for point in coverage_curve(sureness[:1], states[:1], labels):
        if point.n_covered:
            exact = binomtest(point.n_correct, point.n_covered).proportion_ci(0.95, "exact")
            wanted = pytest.approx((exact.low, exact.high), abs=1e-9)
            assert (point.interval.low, point.interval.high) == wanted


def test_votes_that_repeat_make_no_interval_narrower():
    """Thirty bags that say the same are worth one; look-alikes are worth one image."""
    labels = np.array([1, 1, -1, -1, 1], np.int8)
    sureness, states = np.full((1, 5), 0.5), np.array([[1, 1, -1, 1, 1]], np.int8)
    (once, *_) = coverage_curve(sureness, states, labels)
    (often, *_) = coverage_curve(np.repeat(sureness, 30, 0), np.repeat(states, 30, 0), labels)
    assert often.n_covered == 30 * once.n_covered
    assert often.interval == once.interval
    (alike, *_) = coverage_curve(sureness, states, labels, np.array([0, 0, 1, 2, 3]))
    assert alike.interval.low < once.interval.low < once.interval.high < alike.interval.high


@given(out_of_bag())
@settings(deadline=None, max_examples=40)
def test_a_higher_threshold_covers_fewer(seen):
    curve = coverage_curve(*seen)
    assert curve[0].min_sureness == 0
    thresholds = [point.min_sureness for point in curve]
    assert thresholds == sorted(set(thresholds))
    covered = [point.n_covered for point in curve]
    assert covered == sorted(set(covered), reverse=True)


@given(out_of_bag(), st.floats(0.01, 1))
@settings(deadline=None, max_examples=40)
def test_the_strictest_threshold_that_covers_enough(seen, coverage):
    point = choose_point(coverage_curve(*seen), coverage)
    leaning = [sure for sure, state, *_ in listed(seen) if state != 0]

    def covers(threshold):
        return sum(sure >= threshold for sure in leaning) / len(listed(seen))

    if covers(0) < coverage:
        assert point.min_sureness == 0
    else:
        assert point.coverage >= coverage
        stricter = [sure for sure in leaning if sure > point.min_sureness + 2e-6]
        assert all(covers(s) < coverage or covers(s) == point.coverage for s in stricter)


@given(out_of_bag())
@settings(deadline=None, max_examples=40)
def test_full_coverage_abstains_from_nothing_that_leans(seen):
    point = choose_point(coverage_curve(*seen), 1.0)
    assert point.min_sureness == 0
    assert point.n_covered == sum(state != 0 for _, state, *_ in listed(seen))


def test_a_new_vote_is_covered_as_often_as_was_asked():
    """Votes on an image spread around its own mean; a new image has its own mean, and one vote.

    Means of eleven votes would promise a sureness that a single vote reaches too rarely.
    """
    rng = np.random.default_rng(5)

    def votes(n_bags, n_images):
        of_image = rng.normal(0.5, 0.15, n_images)
        return np.clip(of_image + rng.normal(0, 0.15, (n_bags, n_images)), 0, 1)

    sureness = votes(30, 3000)
    sureness[rng.random(sureness.shape) > 0.37] = np.nan
    ones = np.ones(3000, np.int8)
    curve = coverage_curve(sureness, np.ones(sureness.shape, np.int8), ones)
    for wanted in (0.9, 0.7, 0.5):
        least = choose_point(curve, wanted).min_sureness
        assert (votes(1, 20_000) >= least).mean() == pytest.approx(wanted, abs=0.02)


def test_many_votes_make_few_points_that_meet_a_coverage_closely():
    rng, labels = np.random.default_rng(3), np.ones(100, np.int8)
    sureness = (rng.permutation(3000) / 3000).reshape(30, 100)
    curve = coverage_curve(sureness, np.ones(sureness.shape, np.int8), labels)
    n_votes, n_steps = sureness.size, MAX_POINTS - 1
    evenly = {-(-step * n_votes // n_steps) for step in range(1, n_steps + 1)}
    assert {point.n_covered for point in curve} == evenly
    assert len(curve) <= MAX_POINTS
    for wanted in np.linspace(0.05, 1, 39):
        assert wanted <= choose_point(curve, float(wanted)).coverage <= wanted + 0.006


def test_a_share_of_coverage_is_taken_as_a_decimal():
    """As floats, 0.9 * 10 and its like may ask for one vote too many."""
    for n in (1, 2, 5, 10, 20, 40):
        sureness = np.arange(1, n + 1) / n
        ones = np.ones(n, np.int8)
        curve = coverage_curve(sureness[None], ones[None], ones)
        covered = [choose_point(curve, k / n).n_covered for k in range(1, n + 1)]
        assert covered == list(range(1, n + 1))


def test_a_curve_needs_votes():
    nothing = np.array([[math.nan]])
    one, states = np.ones(1, np.int8), np.ones((1, 1), np.int8)
    with pytest.raises(ValueError, match="at least one"):
        coverage_curve(nothing, states, one)
    with pytest.raises(ValueError, match=r"in \[0, 1\]"):
        coverage_curve(np.array([[1.5]]), states, one)
    for sureness in (np.ones((1, 2)), np.ones(1)):
        with pytest.raises(ValueError, match="one label and group an image"):
            coverage_curve(sureness, states, one)
    curve = coverage_curve(np.ones((1, 1)), states, one)
    for coverage in (0.0, 1.1, math.nan):
        with pytest.raises(ValueError, match="coverage must be"):
            choose_point(curve, coverage)


def test_a_point_says_what_it_counts():
    states = np.array([[1, 1, 0], [1, -1, 1]], np.int8)
    sureness = np.array([[0.5, 0.6, 0.0], [math.nan, 0.4, 0.9]])
    first, *_ = coverage_curve(sureness, states, np.ones(3, np.int8))
    said = first.sentence()
    assert said.startswith(
        "4 of 5 out-of-bag votes on 3 images give a verdict, 3 of them the right"
    )
    assert "(75%, 95 % interval" in said
