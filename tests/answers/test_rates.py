"""The rates and the fitness against a slow, literal transcription of the paper in fractions."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from vqa_state.answers.rates import Counts, count, question_stats, score
from vqa_state.answers.table import MISSING, AnswerTable
from vqa_state.questions.grid import Question
from vqa_state.search.fitness import Fitness
from vqa_state.search.objectives import Objective, ObjectiveWeights

ALPHA, BETA = 100, Fraction(1, 10)


def table_of(verdicts, labels) -> AnswerTable:
    verdicts = np.asarray(verdicts, dtype=np.int8)
    return AnswerTable(
        image_ids=tuple(f"image{i}" for i in range(verdicts.shape[0])),
        questions=tuple(Question(f"Is it {q}?", yes_means=1) for q in range(verdicts.shape[2])),
        verdicts=verdicts,
        p_positive=np.full(verdicts.shape, np.nan, dtype=np.float32),
        labels=np.asarray(labels, dtype=np.int8),
    )


def counts_of(correct, wrong, invalid=0, labels=None) -> Counts:
    """Counts of one image a row."""
    correct, wrong = np.array(correct, dtype=np.int64), np.array(wrong, dtype=np.int64)
    labels = np.ones(len(correct), dtype=np.int8) if labels is None else np.array(labels, np.int8)
    return Counts(correct, wrong, np.broadcast_to(invalid, correct.shape).astype(np.int64), labels)


@st.composite
def tables(draw) -> AnswerTable:
    shape = draw(st.tuples(st.integers(1, 5), st.integers(1, 4), st.integers(1, 5)))
    verdicts = draw(hnp.arrays(np.int8, shape, elements=st.sampled_from([-1, 0, 1])))
    labels = draw(hnp.arrays(np.int8, shape[:1], elements=st.sampled_from([-1, 1])))
    return table_of(verdicts, labels)


def literal(table, subset, *, primed):
    """Paper II-A, one answer at a time: (recognized images, exact R of each image or None)."""
    n_recognized, rates = 0, []
    for image, label in enumerate(table.labels):
        said = [int(v) for copy in table.verdicts[image] for v in copy[list(subset)]]
        correct, wrong = said.count(label), said.count(-label)
        asked = len(said) if primed else correct + wrong
        rates.append(Fraction(correct, asked) if asked else None)
        n_recognized += rates[-1] is not None and rates[-1] > Fraction(1, 2)
    return n_recognized, rates


def literal_fitness(table, subset, objective):
    """Paper II-B, exact."""
    if not subset:
        return Fraction(-1)
    primed = objective in ("s'+", "s'-")
    sign = +1 if objective in ("s+", "s'+") else -1
    n_recognized, rates = literal(table, subset, primed=primed)
    R_ave = sum((rate or 0 for rate in rates), Fraction(0)) / len(rates)
    return (
        ALPHA * Fraction(n_recognized, len(rates))
        + R_ave
        + sign * BETA * Fraction(len(subset), table.n_questions)
    )


def every_subset(n_questions):
    """All 0/1 vectors, (2**n_questions, n_questions)."""
    return np.array(list(np.ndindex(*[2] * n_questions)), dtype=np.uint8)


@given(tables(), st.sampled_from(Objective))
@settings(deadline=None)
def test_fitness_of_every_subset_is_the_papers(table, objective):
    population = every_subset(table.n_questions)
    values = Fitness(count(table), objective)(population)
    subsets = [tuple(np.flatnonzero(individual).tolist()) for individual in population]
    expected = [float(literal_fitness(table, subset, objective)) for subset in subsets]
    np.testing.assert_allclose(values, expected, rtol=0, atol=1e-12)


@given(tables(), st.sampled_from(Objective), st.data())
@settings(deadline=None)
def test_terms_are_exact_and_add_up_to_the_same_bits(table, objective, data):
    subset = tuple(sorted(data.draw(st.sets(st.integers(0, table.n_questions - 1), min_size=1))))
    fitness = Fitness(count(table), objective)
    terms = fitness.terms(subset)
    n_recognized, rates = literal(table, subset, primed=objective.kind.primed)
    assert (terms.n_recognized, terms.n_images) == (n_recognized, table.n_images)
    assert (terms.n_used, terms.n_questions) == (len(subset), table.n_questions)
    exact_mean = sum((rate or 0 for rate in rates), Fraction(0)) / len(rates)
    assert terms.R_ave == pytest.approx(float(exact_mean), abs=1e-12)
    individual = np.isin(np.arange(table.n_questions), subset)[np.newaxis]
    assert terms.value == fitness(individual)[0]


@given(tables(), st.data())
@settings(deadline=None)
def test_report_score_is_unprimed_and_undefined_rates_are_nan(table, data):
    subset = tuple(sorted(data.draw(st.sets(st.integers(0, table.n_questions - 1), min_size=1))))
    result = score(count(table), subset)
    n_recognized, rates = literal(table, subset, primed=False)
    assert (result.n_recognized, result.n_images) == (n_recognized, table.n_images)
    assert result.recognized.sum() == n_recognized
    expected = [math.nan if rate is None else float(rate) for rate in rates]
    np.testing.assert_array_equal(result.r_correct, expected)
    assert result.R_ave == pytest.approx(np.nan_to_num(expected).mean(), abs=1e-12)
    assert result.R_invalid == np.mean(table.verdicts[:, :, list(subset)] == 0)
    assert result.n_used == len(subset)


@pytest.mark.parametrize(
    ("correct", "wrong", "invalid", "objective", "recognized"),
    [
        (3, 3, 0, "s+", False),  # a tie
        (4, 2, 0, "s+", True),
        (1, 0, 5, "s+", True),  # Invalid answers do not vote
        (1, 0, 5, "s'+", False),  # but stand in the primed denominator
        (3, 0, 3, "s'-", False),  # a primed tie
        (4, 1, 1, "s'-", True),
        (0, 0, 6, "s-", False),  # no answer at all
    ],
)
def test_recognized_is_a_strict_majority(correct, wrong, invalid, objective, recognized):
    counts = counts_of([[correct]], [[wrong]], invalid)
    assert Fitness(counts, Objective(objective)).terms((0,)).n_recognized == recognized


def test_recognized_stays_exact_beyond_float32():
    """One answer in fifty million decides, which a sum in float32 cannot see."""
    half = 25_000_000
    counts = counts_of([[half + 1], [half]], [[half], [half + 1]])
    assert Fitness(counts, Objective.S_PLUS).terms((0,)).n_recognized == 1


def test_an_image_without_valid_answers_counts_as_zero_in_the_average_only():
    result = score(counts_of([[6], [0]], [[0], [0]], [[0], [6]]), (0,))
    assert (result.n_recognized, result.R_ave, result.R_invalid) == (1, 0.5, 0.5)
    np.testing.assert_array_equal(result.r_correct, [1.0, math.nan])


def test_the_empty_subset_is_no_solution():
    counts = counts_of([[6, 0]], [[0, 6]])
    assert Fitness(counts, Objective.S_PLUS)(np.zeros((2, 2), dtype=np.uint8)).tolist() == [-1, -1]
    assert Fitness(counts, Objective.S_MINUS).terms(()).value == -1
    empty = score(counts, ())
    assert (empty.n_recognized, empty.R_ave, empty.n_used) == (0, 0.0, 0)
    assert math.isnan(empty.R_invalid)


@pytest.mark.parametrize("objective", Objective)
def test_every_subset_beats_the_empty_one(objective):
    counts = counts_of([[0, 0]], [[6, 6]])
    weights = ObjectiveWeights(alpha=0, beta=0.999)
    values = Fitness(counts, objective, weights)(every_subset(2))
    assert values[0] == -1
    assert (values[1:] > -1).all()


def synthetic(rng, n_images, n_questions) -> Counts:
    correct = rng.integers(0, 7, (n_images, n_questions))
    wrong = rng.integers(0, 7 - correct)
    labels = np.where(np.arange(n_images) % 2, 1, -1)
    return counts_of(correct, wrong, 6 - correct - wrong, labels)


@pytest.mark.parametrize("n_images", [1, 2, 7, 20, 80, 200])
@pytest.mark.parametrize("objective", Objective)
def test_a_subset_has_the_same_fitness_bits_anywhere(n_images, objective):
    rng = np.random.default_rng(n_images)
    fitness = Fitness(synthetic(rng, n_images, 33), objective)
    population = rng.integers(0, 2, (301, 33), dtype=np.uint8)
    values = fitness(population)
    order = rng.permutation(len(population))
    assert (fitness(population[order]) == values[order]).all()
    assert (fitness(population[::3]) == values[::3]).all()
    assert (fitness(np.asfortranarray(population)) == values).all()
    assert (fitness(population.astype(bool)) == values).all()
    assert all(fitness(population[i : i + 1])[0] == values[i] for i in range(20))


@pytest.mark.parametrize("objective", Objective)
def test_the_order_of_images_changes_no_bit(objective):
    rng = np.random.default_rng(5)
    counts = synthetic(rng, 37, 12)
    order = rng.permutation(37)
    kinds = (counts.correct, counts.wrong, counts.invalid, counts.labels)
    shuffled = Counts(*(kind[order] for kind in kinds))
    population = rng.integers(0, 2, (200, 12), dtype=np.uint8)
    values = Fitness(counts, objective)(population)
    assert (Fitness(shuffled, objective)(population) == values).all()


def test_question_stats_by_hand():
    stats = question_stats(
        counts_of(
            correct=[[6, 0, 3], [2, 0, 6]],
            wrong=[[0, 0, 3], [4, 0, 0]],
            invalid=[[0, 6, 0], [0, 6, 0]],
            labels=[1, -1],
        )
    )
    np.testing.assert_array_equal(stats.accuracy, [8 / 12, math.nan, 9 / 12])
    np.testing.assert_array_equal(stats.invalid_share, [0, 1, 0])
    np.testing.assert_array_equal(stats.accuracy_positive, [1, math.nan, 0.5])
    np.testing.assert_array_equal(stats.accuracy_negative, [1 / 3, math.nan, 1])


def test_missing_answers_are_refused_with_the_way_out():
    table = table_of([[[1], [MISSING]], [[1], [0]]], [1, -1])
    with pytest.raises(ValueError, match=r"1 of 2 images have missing answers.*take\(complete\)"):
        count(table)
    assert count(table.take(table.complete)).n_images == 1


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (([[1]], [[1]], [[1, 1]], [1]), "one shape"),
        (([[-1]], [[1]], [[0]], [1]), "negative"),
        (([[1], [2]], [[0], [0]], [[0], [0]], [1, 1]), "same copies"),
        (([[0]], [[0]], [[0]], [1]), "at least 1"),
        (([[1]], [[0]], [[0]], [0]), r"\+1 or -1"),
        (([[1]], [[0]], [[0]], [1, 1]), "1 times"),
    ],
)
def test_counts_are_validated(arrays, message):
    with pytest.raises(ValueError, match=message):
        Counts(*(np.array(array) for array in arrays))


@pytest.mark.parametrize("subset", [(2,), (-1,), (0, 0), (True, False), (0.5,)])
def test_a_subset_is_distinct_positions(subset):
    counts = counts_of([[6, 0]], [[0, 6]])
    with pytest.raises(ValueError, match="distinct positions of its questions, 0 to 1"):
        score(counts, subset)
    with pytest.raises(ValueError, match="distinct positions"):
        Fitness(counts, Objective.S_PLUS).terms(subset)


@pytest.mark.parametrize(
    "weights",
    [
        {"alpha": -1},
        {"alpha": 1_000_001},
        {"alpha": math.inf},
        {"alpha": math.nan},
        {"beta": -0.1},
        {"beta": 1},
    ],
)
def test_weights_are_validated(weights):
    with pytest.raises(ValueError, match="must be"):
        ObjectiveWeights(**weights)
