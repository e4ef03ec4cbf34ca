"""The table of results: what it chooses, what it may not look at, and its intervals."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from vqa_state.answers.rates import Counts, count, score
from vqa_state.answers.table import MISSING, AnswerTable
from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.held_out import Baseline, best_question, evaluate
from vqa_state.evaluation.intervals import clopper_pearson
from vqa_state.evaluation.paired_tests import mcnemar
from vqa_state.questions.grid import Form, Question
from vqa_state.search.objectives import Objective

CHOSEN = {
    Objective.S_PLUS: (0, 1, 4),
    Objective.S_PRIME_PLUS: (1,),
    Objective.S_MINUS: (5,),
    Objective.S_PRIME_MINUS: (2, 3),
}


def table_of(seed=0, n_images=12, forms=(Form.IS, Form.DOES) * 3, n_copies=6) -> AnswerTable:
    rng = np.random.default_rng(seed)
    labels = np.where(np.arange(n_images) % 2, 1, -1).astype(np.int8)
    shape = (n_images, n_copies, len(forms))
    verdicts = rng.choice([1, 1, 1, -1, 0], shape) * labels[:, None, None]
    return AnswerTable(
        image_ids=tuple(f"image{i}" for i in range(n_images)),
        questions=tuple(Question(f"Is it {i}?", 1, form) for i, form in enumerate(forms)),
        verdicts=verdicts.astype(np.int8),
        p_positive=np.full(shape, np.nan, dtype=np.float32),
        labels=labels,
    )


def with_verdicts(table, verdicts) -> AnswerTable:
    return replace(table, verdicts=np.asarray(verdicts, dtype=np.int8))


def rows(*args, seed=0):
    return {row.name: row for row in evaluate(*args, seed=seed).rows}


def test_rows_stand_in_the_papers_order_with_the_right_subsets():
    train = table_of()
    table = rows(train, None, CHOSEN)
    assert list(table) == [*Objective, *Baseline]
    assert {name: row.subset for name, row in table.items()} == {
        "s+": (0, 1, 4),
        "s'+": (1,),
        "s-": (5,),
        "s'-": (2, 3),
        "s_does": (1, 3, 5),
        "s_is": (0, 2, 4),
        "s_all": (0, 1, 2, 3, 4, 5),
        "best question": (best_question(count(train)),),
    }


@pytest.mark.parametrize(
    ("form", "absent"),
    [
        (Form.IS, {Baseline.S_DOES}),
        (Form.DOES, {Baseline.S_IS}),
        (Form.CUSTOM, {Baseline.S_IS, Baseline.S_DOES}),
    ],
)
def test_a_form_without_questions_has_no_row(form, absent):
    table = rows(table_of(forms=(form,) * 6), None, CHOSEN)
    assert {*Objective, *Baseline} - set(table) == absent


def test_an_objective_that_was_not_searched_has_no_row():
    table = rows(table_of(), None, {Objective.S_MINUS: (5, 0)})
    assert next(iter(table)) == Objective.S_MINUS
    assert table[Objective.S_MINUS].subset == (0, 5)
    assert Objective.S_PLUS not in table


@given(st.integers(0, 2**32), st.integers(1, 4), st.integers(1, 8))
@settings(max_examples=20, deadline=None)
def test_scores_are_those_of_the_subset_on_each_split(seed, n_copies, n_images):
    train, test = table_of(seed, 10, n_copies=n_copies), table_of(seed + 1, n_images)
    for row in evaluate(train, test, CHOSEN, seed=0).rows:
        for got, split in ((row.train, train), (row.test, test)):
            expected = score(count(split), row.subset)
            assert got.n_recognized == expected.n_recognized
            assert (got.R_ave, got.R_invalid) == (expected.R_ave, expected.R_invalid)


# --- the test images never influence a choice -------------------------------------------------


@given(st.integers(0, 2**32))
@settings(max_examples=20, deadline=None)
def test_test_answers_change_no_choice_and_no_training_score(seed):
    train, test = table_of(seed), table_of(seed + 1)
    rng = np.random.default_rng(seed)
    other = with_verdicts(test, rng.choice([-1, 0, 1], test.verdicts.shape))
    seen = [rows(train, held_out, CHOSEN) for held_out in (test, other, None)]
    for name, row in seen[0].items():
        for again in (seen[1][name], seen[2][name]):
            assert again.subset == row.subset
            assert again.train_missed == row.train_missed
            assert (again.train.n_recognized, again.train.R_ave) == (
                row.train.n_recognized,
                row.train.R_ave,
            )


@pytest.mark.parametrize(
    ("correct", "invalid", "best"),
    [
        ([[4, 6], [4, 3]], [[0, 0], [0, 0]], 0),  # more images, though a lower rate
        ([[4, 6], [4, 4]], [[0, 0], [0, 0]], 1),  # as many images, higher rate
        ([[3, 6], [3, 6]], [[3, 0], [3, 0]], 1),  # as high a rate, fewer invalid
        ([[6, 6], [6, 6]], [[0, 0], [0, 0]], 0),  # all equal: the first
    ],
)
def test_best_question(correct, invalid, best):
    correct, invalid = np.array(correct), np.array(invalid)
    counts = Counts(correct, 6 - correct - invalid, invalid, np.array([1, -1], dtype=np.int8))
    assert best_question(counts) == best


# --- missing answers and missing images -------------------------------------------------------


def test_images_with_missing_answers_are_left_out_and_counted():
    train, test = table_of(0), table_of(1)
    for table, image, question in ((train, 3, 0), (train, 5, 2), (test, 0, 1)):
        table.verdicts[image, 2, question] = MISSING
    result = evaluate(train, test, CHOSEN, seed=0)
    assert (result.n_left_out_train, result.n_left_out_test) == (2, 1)
    assert {row.train.n_images for row in result.rows} == {10}
    assert {row.test.n_images for row in result.rows} == {11}
    missed = {m.image_id for row in result.rows for m in row.train_missed}
    assert not missed & {"image3", "image5"}


@pytest.mark.parametrize("kind", ["none", "empty", "incomplete"])
def test_without_test_images_there_is_no_test_score(kind):
    test = None if kind == "none" else table_of(n_images=0 if kind == "empty" else 2)
    if kind == "incomplete":
        test.verdicts[:, 0, 0] = MISSING
    result = evaluate(table_of(), test, CHOSEN, seed=0)
    assert all(row.test is None and row.intervals is None for row in result.rows)
    assert all(row.test_missed == () for row in result.rows)
    assert result.n_left_out_test == (2 if kind == "incomplete" else 0)


def test_nothing_to_evaluate_is_an_error():
    train = table_of()
    train.verdicts[:, 0, 0] = MISSING
    with pytest.raises(NothingToSearchError, match="0 training images have all their answers"):
        evaluate(train, None, CHOSEN, seed=0)
    with pytest.raises(NothingToSearchError, match="to 0 questions"):
        evaluate(table_of(forms=()), None, {}, seed=0)


def test_train_and_test_must_ask_the_same():
    with pytest.raises(ValueError, match="same questions"):
        evaluate(table_of(), table_of(forms=(Form.IS,) * 6), CHOSEN, seed=0)


# --- what is shown beside the scores ----------------------------------------------------------


def test_missed_images_show_their_votes():
    verdicts = np.zeros((4, 6, 1))
    verdicts[0] = -1  # label -1: recognized
    verdicts[1, :2] = -1  # label +1: two against, four invalid
    verdicts[2, :3], verdicts[2, 3:] = 1, -1  # a tie
    train = with_verdicts(table_of(n_images=4, forms=(Form.IS,)), verdicts)
    missed = rows(train, train, {})[Baseline.S_ALL].test_missed
    votes = [(m.image_id, m.label, m.n_for, m.n_against, m.n_invalid) for m in missed]
    assert votes == [("image1", 1, 0, 2, 4), ("image2", -1, 3, 3, 0), ("image3", 1, 0, 0, 6)]
    assert [m.no_answer for m in missed] == [False, False, True]


@pytest.mark.parametrize(("recognized", "low", "high"), [(20, 0.832, 1), (0, 0, 0.168)])
def test_exact_interval_of_the_recognized_share(recognized, low, high):
    """20 of 20 only shows that the true rate is at least 83 %."""
    test = table_of(n_images=20)
    right = 1 if recognized else -1
    test = with_verdicts(test, right * np.broadcast_to(test.labels[:, None, None], (20, 6, 6)))
    interval = rows(table_of(), test, {})[Baseline.S_ALL].intervals.R_img
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=5e-4)


def test_exact_interval_by_its_definition():
    """Clopper-Pearson: at each end, the observed count is a 2.5 % event."""
    row = rows(table_of(), table_of(3, n_copies=1), CHOSEN)[Objective.S_MINUS]
    k, n = row.test.n_recognized, row.test.n_images
    assert 0 < k < n
    assert stats.binom.sf(k - 1, n, row.intervals.R_img.low) == pytest.approx(0.025)
    assert stats.binom.cdf(k, n, row.intervals.R_img.high) == pytest.approx(0.025)


def test_without_images_there_is_no_interval():
    nowhere = clopper_pearson(0, 0)
    assert math.isnan(nowhere.low)
    assert math.isnan(nowhere.high)
    with pytest.raises(ValueError):
        clopper_pearson(1, 0)


@pytest.mark.parametrize("name", [*Objective, *Baseline])
def test_bootstrap_agrees_with_scipys(name):
    test = table_of(5, n_images=40)
    row = rows(table_of(), test, CHOSEN)[name]
    invalid = (test.verdicts[:, :, list(row.subset)] == 0).mean(axis=(1, 2))
    pairs = (
        (row.intervals.R_ave, np.nan_to_num(row.test.r_correct)),
        (row.intervals.R_invalid, invalid),
    )
    for ours, values in pairs:
        theirs = stats.bootstrap(
            (values,), np.mean, n_resamples=20_000, method="percentile", rng=1
        ).confidence_interval
        width = theirs.high - theirs.low
        assert (ours.low, ours.high) == pytest.approx(theirs, abs=0.08 * width)
        assert ours.low <= values.mean() <= ours.high


def test_the_bootstrap_repeats_by_seed():
    train, test = table_of(), table_of(1)
    first, again, other = (rows(train, test, CHOSEN, seed=s) for s in (1, 1, 2))
    assert all(first[name].intervals == again[name].intervals for name in first)
    assert first[Baseline.S_ALL].intervals.R_ave != other[Baseline.S_ALL].intervals.R_ave


def test_an_undefined_rate_has_an_undefined_interval():
    row = rows(table_of(), table_of(1), {Objective.S_PLUS: ()})[Objective.S_PLUS]
    assert math.isnan(row.test.R_invalid)
    assert math.isnan(row.intervals.R_invalid.low)
    assert row.intervals.R_img.low == 0


# --- paired comparison ------------------------------------------------------------------------


def recognizing(*recognized):
    correct = np.array(recognized)[:, None]
    labels = np.ones(len(recognized), dtype=np.int8)
    return score(Counts(correct, 1 - correct, 0 * correct, labels), (0,))


def test_paired_test_counts_what_the_scores_recognize():
    result = mcnemar(recognizing(1, 0, 1, 1).recognized, recognizing(0, 1, 0, 0).recognized)
    assert (result.n_images, result.n_only_first, result.n_only_second) == (4, 3, 1)
    assert result.p_value == pytest.approx(10 / 16)


def test_paired_test_needs_the_same_images():
    with pytest.raises(ValueError, match="need the same images"):
        mcnemar(recognizing(1).recognized, recognizing(1, 1).recognized)


# --- an identity that the paper's tables obey -------------------------------------------------


@given(st.integers(0, 2**32), st.integers(1, 5), st.integers(1, 6))
@settings(max_examples=50, deadline=None)
def test_invalid_share_of_all_is_the_mean_of_does_and_is(seed, n_each, n_images):
    train = table_of(seed, n_images, forms=(Form.IS,) * n_each + (Form.DOES,) * n_each)
    table = rows(train, None, {})
    shares = [table[name].train.R_invalid for name in (Baseline.S_DOES, Baseline.S_IS)]
    assert table[Baseline.S_ALL].train.R_invalid == pytest.approx(np.mean(shares), abs=1e-12)


def test_the_papers_tables_obey_it_within_their_rounding():
    path = Path(__file__).parent.parent / "golden" / "paper_tables.csv"
    with path.open(encoding="utf-8", newline="") as file:
        cells = {
            (r["experiment"], r["subset"]): float(r["R_invalid"]) for r in csv.DictReader(file)
        }
    experiments = {experiment for experiment, _ in cells}
    assert len(experiments) == 11
    for experiment in experiments:
        mean = (cells[experiment, "s_does"] + cells[experiment, "s_is"]) / 2
        assert cells[experiment, "s_all"] == pytest.approx(mean, abs=0.001 + 1e-9)
