"""The smallest sureness for a verdict, and what it costs in coverage: by counting, and by laws."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import binomtest

from vqa_state.coverage import choose_point, coverage_curve

ANSWERS = st.sampled_from([-1, 0, 1])


@st.composite
def out_of_bag(draw):
    n = draw(st.integers(1, 12))
    sure = st.sampled_from([0.0, 0.25, 0.5, 1 / 3, 0.7, 1.0, math.nan]) | st.floats(0, 1)
    sureness = draw(arrays(np.float64, n, elements=sure))
    sureness[0] = 0.5  # at least one known
    states = draw(arrays(np.int8, n, elements=ANSWERS))
    sureness[states == 0] *= 0  # a tie is never sure
    return sureness, states, draw(arrays(np.int8, n, elements=st.sampled_from([-1, 1])))


@given(out_of_bag())
@settings(deadline=None, max_examples=40)
def test_points_count_what_their_threshold_would_do(seen):
    sureness, states, labels = seen
    curve = coverage_curve(*seen)
    for point in curve:
        got = [
            state == label
            for sure, state, label in zip(sureness, states, labels, strict=True)
            if state != 0 and sure >= point.min_sureness
        ]
        assert (point.n_covered, point.n_correct) == (len(got), sum(got))
        assert point.n_images == np.count_nonzero(~np.isnan(sureness))
        if got:
            exact = binomtest(sum(got), len(got)).proportion_ci(0.95, "exact")
            assert (point.interval.low, point.interval.high) == (exact.low, exact.high)
            assert point.accuracy == sum(got) / len(got)
        else:
            assert math.isnan(point.accuracy)


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
    sureness, states, _ = seen
    point = choose_point(coverage_curve(*seen), coverage)
    known = sureness[~np.isnan(sureness)]
    sides = states[~np.isnan(sureness)]

    def covers(threshold):
        return np.count_nonzero((known >= threshold) & (sides != 0)) / known.size

    if covers(0) < coverage:
        assert point.min_sureness == 0
    else:
        assert point.coverage >= coverage
        stricter = [s for s in known[sides != 0] if s > point.min_sureness + 2e-6]
        assert all(covers(s) < coverage or covers(s) == point.coverage for s in stricter)


@given(out_of_bag())
@settings(deadline=None, max_examples=40)
def test_full_coverage_abstains_from_nothing_that_leans(seen):
    point = choose_point(coverage_curve(*seen), 1.0)
    assert point.min_sureness == 0
    assert point.n_covered == np.count_nonzero(seen[1][~np.isnan(seen[0])])


def test_a_share_of_coverage_is_taken_as_a_decimal():
    """As floats, 0.9 * 10 and its like may ask for one image too many."""
    n = 10
    sureness = np.arange(1, n + 1) / n
    curve = coverage_curve(sureness, np.ones(n, np.int8), np.ones(n, np.int8))
    assert [choose_point(curve, k / n).n_covered for k in range(1, n + 1)] == list(range(1, n + 1))


def test_a_curve_needs_images():
    nothing = np.array([math.nan])
    one = np.ones(1, np.int8)
    with pytest.raises(ValueError, match="at least one"):
        coverage_curve(nothing, one, one)
    with pytest.raises(ValueError, match=r"all in \[0, 1\]"):
        coverage_curve(np.array([1.5]), one, one)
    with pytest.raises(ValueError, match="one value an image"):
        coverage_curve(np.ones(2), one, one)
    curve = coverage_curve(np.ones(1), one, one)
    for coverage in (0.0, 1.1, math.nan):
        with pytest.raises(ValueError, match="coverage must be"):
            choose_point(curve, coverage)
