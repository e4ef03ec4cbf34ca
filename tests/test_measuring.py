"""How the embedded model is measured: by hand-made tables whose numbers are known."""

import json
from pathlib import Path

import numpy as np
import pytest

from vqa_state.answers import AnswerTable
from vqa_state.embedded.card import BEGIN, END, tables, with_tables
from vqa_state.embedded.gains import summarise_gains
from vqa_state.embedded.measuring import N_PER_STATE, balanced, measure_task
from vqa_state.questions import Question

ROOT = Path(__file__).parent.parent
N_IMAGES = 40


def table(verdicts):
    """One copy; `verdicts` is (n_images, n_questions), the states stand in turn."""
    verdicts = np.asarray(verdicts, np.int8)[:, None, :]
    labels = np.where(np.arange(len(verdicts)) % 2 == 0, 1, -1).astype(np.int8)
    questions = tuple(Question(f"Is it {n}?", 1) for n in range(verdicts.shape[2]))
    names = tuple(f"{row:03d}" for row in range(len(verdicts)))
    return AnswerTable(names, questions, verdicts, np.full(verdicts.shape, 0.5, np.float32), labels)


def always_right():
    return np.where(np.arange(N_IMAGES) % 2 == 0, 1, -1)


def always_positive():
    return np.ones(N_IMAGES, int)


@pytest.fixture(scope="module")
def leaning():
    """A grid of two questions that always say positive, and one cue that is always right."""
    answers = np.stack([always_positive(), always_positive(), always_right()], axis=1)
    return measure_task("leaning", "foreign", table(answers), 2, n_draws=3)


def test_the_search_finds_the_cue_that_is_right(leaning):
    assert (leaning.s_plus, leaning.single) == (1.0, 1.0)
    assert (leaning.s_all, leaning.s_plus_grid) == (0.5, 0.5)
    assert leaning.all_questions == 0.5  # two against one
    assert (leaning.n_grid, leaning.n_questions) == (2, 3)


def test_a_lean_is_seen(leaning):
    assert leaning.called_positive == 1.0
    honest = measure_task("x", "scenes", table(always_right()[:, None]), 1, n_draws=1)
    assert honest.called_positive == 0.5


def test_gains_are_of_tested_pictures(leaning):
    # Only the negative ones are gained, each in every draw that tested it.
    assert sorted(set(leaning.gain_over_all)) == [0.0, 1.0]
    assert set(leaning.gain_over_single) == {0.0}


def test_too_few_pictures_are_voted_on_without_a_search():
    few = measure_task("few", "photos", table(np.ones((2 * N_PER_STATE, 1), int)), 1)
    assert few.s_plus is None
    assert few.s_all == 0.5
    assert few.gain_over_all == []


def test_balanced_weighs_states_alike():
    labels = np.array([1, 1, 1, -1], np.int8)
    assert balanced(np.array([True, True, True, False]), labels) == 0.5


def test_gains_have_intervals_around_their_mean(leaning):
    other = measure_task("right", "scenes", table(always_right()[:, None]), 1, n_draws=1)
    gains = summarise_gains([leaning, other])
    over_tasks = gains["over_all"]["tasks"]
    assert over_tasks["mean"] == pytest.approx((0.5 + 0.0) / 2)
    assert over_tasks["low"] < over_tasks["mean"] < over_tasks["high"]
    assert gains["over_single"]["tasks"]["mean"] == 0


def test_photos_take_no_part_in_the_gains(leaning):
    photos = measure_task("p", "photos", table(always_right()[:, None]), 1, n_draws=1)
    both = [leaning, leaning]
    assert summarise_gains([*both, photos]) == summarise_gains(both)


def test_the_card_needs_its_marks():
    with pytest.raises(ValueError, match="must hold"):
        with_tables("no marks", {})


def test_the_card_keeps_what_stands_around_the_numbers():
    numbers = json.loads((ROOT / "docs" / "embedded_model.json").read_text("utf-8"))
    card = with_tables(f"before {BEGIN} old {END} after", numbers)
    assert card == f"before {BEGIN}\n{tables(numbers)}\n{END} after"
