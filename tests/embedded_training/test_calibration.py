"""Probabilities: what a temperature mends, and what the error measures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state.embedded_training.calibration import calibration_error, fit_temperature, reliability


def drawn(temperature, n=40_000):
    """Logit differences of a model that is too sure by `temperature`, and the truth."""
    rng = np.random.default_rng(0)
    honest = rng.normal(0, 2, n)
    return honest * temperature, rng.random(n) < 1 / (1 + np.exp(-honest))


@pytest.mark.parametrize("temperature", [0.5, 1.0, 3.0])
def test_the_temperature_is_found(temperature):
    differences, truth = drawn(temperature)
    assert fit_temperature(differences, truth) == pytest.approx(temperature, rel=0.05)


def test_the_error_of_honest_probabilities_is_small_and_of_others_large():
    differences, truth = drawn(3.0)
    too_sure = 1 / (1 + np.exp(-differences))
    mended = 1 / (1 + np.exp(-differences / fit_temperature(differences, truth)))
    assert calibration_error(reliability(mended, truth)) < 0.01
    assert calibration_error(reliability(too_sure, truth)) > 0.05


def test_nothing_to_fit_is_said():
    with pytest.raises(ValueError, match="at least one"):
        fit_temperature(np.array([]), np.array([], bool))


@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=50))
def test_every_answer_is_in_one_bin(answers):
    p, truth = (np.array(column) for column in zip(*answers, strict=True))
    bins = reliability(p.astype(float), truth.astype(bool))
    assert sum(each.n for each in bins) == len(answers)
    assert 0 <= calibration_error(bins) <= 1
