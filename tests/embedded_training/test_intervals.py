"""Intervals of what was measured of the embedded model, against scipy and drawing one by one."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from vqa_state.embedded_training.intervals import (
    Tally,
    balanced_interval,
    mean_interval,
    resampled,
    spread,
)


def tally(positive, negative, n_draws=1):
    """Pictures recognized in so many of `n_draws` draws, by the way "a"; way "b" never does."""
    labels = [1] * len(positive) + [-1] * len(negative)
    recognized = [*positive, *negative]
    tested = [n_draws] * len(labels)
    return Tally(labels, tested, {"a": recognized, "b": [0] * len(labels)})


def wilson(k, n):
    interval = stats.binomtest(k, n).proportion_ci(method="wilson")
    return interval.low, interval.high


@given(st.lists(st.booleans(), min_size=1), st.lists(st.booleans(), min_size=1))
def test_a_row_puts_two_wilson_intervals_together(positive, negative):
    low, high = balanced_interval(tally([*map(int, positive)], [*map(int, negative)]), "a")
    shares = [sum(state) / len(state) for state in (positive, negative)]
    ends = [wilson(sum(state), len(state)) for state in (positive, negative)]
    below = math.hypot(*(share - end[0] for share, end in zip(shares, ends, strict=True)))
    above = math.hypot(*(end[1] - share for share, end in zip(shares, ends, strict=True)))
    assert low == pytest.approx(sum(shares) / 2 - below / 2, abs=1e-4)
    assert high == pytest.approx(sum(shares) / 2 + above / 2, abs=1e-4)


def test_three_pictures_prove_little_however_often_they_are_drawn():
    once = balanced_interval(tally([1] * 3, [1] * 25), "a")
    often = balanced_interval(tally([20] * 3, [20] * 25, n_draws=20), "a")
    assert once == often
    assert once[0] < 0.75
    assert once[1] == 1.0


def test_fourteen_pictures_of_a_state_make_a_wide_interval():
    low, high = balanced_interval(tally([1] * 7 + [0] * 7, [1] * 34), "a")
    assert high - low > 0.2


def test_called_positive_is_half_without_a_lean_and_one_where_all_are():
    assert tally([1, 1, 1], [1]).called_positive("a") == 0.5
    assert tally([2, 2], [0, 0, 0], n_draws=2).called_positive("a") == 1
    assert tally([2, 0], [2, 2, 2], n_draws=2).called_positive("a") == 0.25


def test_balanced_counts_draws_and_weighs_states_alike():
    assert tally([2, 1, 0], [2], n_draws=2).balanced("a") == 0.75
    assert tally([2, 1, 0], [2], n_draws=2).balanced("a", "b") == 0.75
    assert tally([2, 1, 0], [2], n_draws=2).balanced("a", "a") == 0


def test_untested_pictures_do_not_count():
    one = Tally([1, 1, -1], [0, 2, 2], {"a": [0, 2, 1]})
    assert one.balanced("a") == 0.75
    assert len(one.of_states("a")[0][0]) == 1


@pytest.mark.parametrize(
    ("tested", "recognized"), [([1], [1, 1]), ([1, 1], [2, 0]), ([1, 1, 1], [1, 1, 1])]
)
def test_tallies_that_cannot_be_are_refused(tested, recognized):
    with pytest.raises(ValueError, match="tested"):
        Tally([1, -1], tested, {"a": recognized})


def test_means_have_students_interval():
    values = [0.5, 0.7, 0.6, 0.9]
    expected = stats.t.interval(0.95, 3, np.mean(values), stats.sem(values))
    assert mean_interval(values) == pytest.approx(expected, abs=1e-4)


def test_two_tasks_say_nothing_about_tasks():
    assert mean_interval([0.7, 0.9]) is None


def test_resampling_is_drawing_pictures_of_each_task_and_state():
    tallies = [tally([3, 1, 0, 3], [2, 2, 3], 3), tally([0, 3], [3, 3, 1, 0, 2], 3)]
    drawn = resampled(tallies, "a")
    rng = np.random.default_rng(1)
    naive = []
    for _ in range(3000):
        values = []
        for one in tallies:
            for gained, tested in one.of_states("a"):
                rows = rng.integers(len(gained), size=len(gained))
                values.append(gained[rows].sum() / tested[rows].sum())
        naive.append(np.mean(values))
    assert drawn.mean() == pytest.approx(np.mean([one.balanced("a") for one in tallies]), abs=0.01)
    assert drawn.std() == pytest.approx(np.std(naive), rel=0.08)


def test_differences_are_paired():
    same = Tally([1, 1, -1, -1], [1] * 4, {"a": [1, 0, 1, 0], "b": [1, 0, 1, 0]})
    assert set(resampled([same], "a", "b")) == {0.0}
    assert spread(resampled([same], "a")) == [0.0, 1.0]


def test_the_same_numbers_come_again():
    one = tally([1, 0, 1], [1, 1, 0])
    assert (resampled([one], "a") == resampled([one], "a")).all()
