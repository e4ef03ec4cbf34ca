"""How the embedded model is measured: by hand-made tables whose numbers are known."""

import numpy as np
import pytest

from vqa_state.answers.table import AnswerTable
from vqa_state.embedded_training import measurement_cache
from vqa_state.embedded_training.gains import summarise_gains, summarise_groups
from vqa_state.embedded_training.intervals import Tally
from vqa_state.embedded_training.measurement_cache import measure_once
from vqa_state.embedded_training.measuring import (
    N_PER_STATE,
    WAYS,
    measure_task,
    whole_tally,
)
from vqa_state.questions.grid import Question

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


def test_every_picture_is_tallied_where_it_was_tested(leaning):
    tally = leaning.tally
    assert sum(tally.tested) == 3 * (N_IMAGES - 2 * N_PER_STATE)
    assert set(tally.recognized) == set(WAYS)
    assert tally.recognized["s_plus"] == tally.tested
    is_positive = [label == 1 for label in tally.labels]
    expected = [n if positive else 0 for n, positive in zip(tally.tested, is_positive, strict=True)]
    assert tally.recognized["s_all"] == expected


def test_the_mean_over_draws_is_that_of_the_tally(leaning):
    assert leaning.tally.balanced("s_all") == leaning.s_all
    assert leaning.tally.balanced("s_plus", "s_all") == leaning.s_plus - leaning.s_all
    assert set(leaning.intervals) == set(WAYS)
    assert all(
        low <= getattr(leaning, way) <= high for way, (low, high) in leaning.intervals.items()
    )


def hard():
    """Sixty questions that say positive; one that is right; the other twenty are always wrong."""
    return np.stack([always_positive()] * 60 + [always_right()] + [-always_right()] * 20, axis=1)


def test_the_random_start_is_measured_beside_ours():
    row = measure_task("hard", "foreign", table(hard()), 60, n_draws=2)
    assert row.s_plus == row.single == 1.0
    assert row.s_plus_random < row.s_plus


def test_too_few_pictures_are_voted_on_without_a_search():
    few = measure_task("few", "photos", table(np.ones((2 * N_PER_STATE, 1), int)), 1)
    assert few.s_plus is few.s_plus_random is few.single is few.n_used is None
    assert few.s_all == 0.5
    assert set(few.intervals) == {"s_all", "all_questions"}
    assert few.tally.tested == [1] * 2 * N_PER_STATE
    assert few.tally.recognized["s_all"] == [1, 0] * N_PER_STATE


def test_a_vote_of_everything_is_tallied_once():
    answers = np.stack([always_right(), always_right(), always_positive()], axis=1)
    tally = whole_tally(table(answers), range(3))
    assert tally.recognized == {"asked": [1] * N_IMAGES}


def right(group="scenes"):
    return measure_task("right", group, table(always_right()[:, None]), 1, n_draws=1)


def test_gains_have_intervals_around_their_mean(leaning):
    gains = summarise_gains([leaning, leaning, right()])
    over_all = gains["over_all"]
    assert over_all["mean"] == pytest.approx((0.5 + 0.5 + 0.0) / 3, abs=1e-4)
    assert over_all["tasks"][0] < over_all["mean"] < over_all["tasks"][1]
    assert (over_all["n_tasks"], over_all["n_pictures"]) == (3, 3 * N_IMAGES)
    assert gains["over_single"]["mean"] == 0


def test_photos_take_no_part_in_the_gains(leaning):
    both = [leaning, leaning]
    assert summarise_gains([*both, right("photos")]) == summarise_gains(both)


def test_groups_are_summed_up_apart(leaning):
    few = measure_task("few", "photos", table(np.ones((2 * N_PER_STATE, 1), int)), 1)
    groups = summarise_groups([leaning, right(), right("photos"), few])
    assert [one["tasks"] for one in groups.values()] == [["leaning"], ["right"], ["right"]]
    assert groups["foreign"]["means"]["s_all"]["mean"] == 0.5
    assert groups["foreign"]["gains"]["over_all"]["mean"] == 0.5
    assert groups["photos"]["means"]["s_plus"]["mean"] == 1.0
    assert groups["photos"]["means"]["s_plus"]["tasks"] is None


def test_a_finished_task_is_not_measured_again(tmp_path, monkeypatch):
    answers = table(always_right()[:, None])
    first = measure_once(tmp_path, "right", "scenes", answers, 1, 1)
    monkeypatch.setattr(measurement_cache, "measure_task", lambda *_: pytest.fail("measured again"))
    assert measure_once(tmp_path, "right", "scenes", answers, 1, 1) == first
    assert isinstance(first.tally, Tally)


@pytest.mark.parametrize("what", ["answers", "grid", "draws", "code"])
def test_a_task_is_measured_again_for_another(what, tmp_path, monkeypatch):
    answers = np.stack([always_right(), always_right()], axis=1)
    measure_once(tmp_path, "right", "scenes", table(answers), 1, 1)
    grid, n_draws = (2 if what == "grid" else 1), (2 if what == "draws" else 1)
    if what == "answers":
        answers[0, 0] *= -1
    if what == "code":
        monkeypatch.setattr(measurement_cache, "_CODE", measurement_cache._CODE[1:])
    measure_once(tmp_path, "right", "scenes", table(answers), grid, n_draws)
    assert len(list(tmp_path.iterdir())) == 2
