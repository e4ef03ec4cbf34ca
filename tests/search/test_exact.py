"""All subsets: against the literal definition in fractions, and against the fitness function."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from search_tables import brute_force, draw_counts, repeat_questions

from vqa_state.answers.rates import Counts
from vqa_state.errors import NothingToSearchError
from vqa_state.search import background_task
from vqa_state.search.exact import can_enumerate, enumerate_subsets
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import fittest
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights
from vqa_state.search.question_classes import question_classes

WEIGHTS = [
    PAPER_WEIGHTS,
    ObjectiveWeights(beta=0),
    ObjectiveWeights(alpha=0, beta=0.5),
    ObjectiveWeights(alpha=1, beta=0.75),
]


def last(reports):
    *_, report = reports
    return report


def best_of_all(counts, objective, weights):
    """By the fitness function that the genetic search maximizes, and its order of ties."""
    every = np.array(list(np.ndindex(*[2] * counts.n_questions)), dtype=np.uint8)
    winner = every[fittest(every, Fitness(counts, objective, weights)(every))]
    return tuple(np.flatnonzero(winner).tolist())


@given(
    st.integers(0, 2**32),
    st.integers(1, 6),
    st.integers(2, 6),
    st.sampled_from(Objective),
    st.sampled_from(WEIGHTS),
)
@settings(max_examples=60)
def test_the_literal_optimum(seed, n_questions, n_images, objective, weights):
    """In fractions nothing is rounded; subsets equal in them may differ in floats' last bit."""
    counts = draw_counts(seed, n_images, n_questions)
    E, _, most = brute_force(counts, objective, weights)
    found = last(enumerate_subsets(counts, objective, weights=weights))
    assert found.finished
    assert found.terms.value == pytest.approx(float(E), abs=1e-9)
    assert found.n_most == most


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
@pytest.mark.parametrize("p_invalid", [0.0, 0.3, 0.9])
def test_the_same_subset_as_one_array_of_all(objective, weights, p_invalid):
    for seed in range(12):
        counts = draw_counts(seed, 2 + seed % 7, 1 + seed, p_invalid=p_invalid)
        found = last(enumerate_subsets(counts, objective, weights=weights))
        assert found.subset == best_of_all(counts, objective, weights)
        assert found.terms == Fitness(counts, objective, weights).terms(found.subset)


@pytest.mark.parametrize("objective", Objective)
def test_equal_questions_are_interchangeable(objective):
    """Nine questions, three of each: the last of each are taken, as the order of ties wants."""
    for seed in range(20):
        counts = repeat_questions(draw_counts(seed, n_questions=3), 3)
        assert question_classes(counts, objective).n_subsets <= 4**3
        assert last(enumerate_subsets(counts, objective)).subset == best_of_all(
            counts, objective, PAPER_WEIGHTS
        )


def test_many_equal_questions_can_be_compared():
    counts = repeat_questions(draw_counts(1, n_questions=4), 30)
    assert can_enumerate(counts, Objective.S_PLUS)
    assert last(enumerate_subsets(counts, Objective.S_PLUS)).total <= 31**4


def test_only_ties():
    same = np.full((2, 5), 3)
    counts = Counts(same, same, np.zeros_like(same), np.array([1, -1], dtype=np.int8))
    found = last(enumerate_subsets(counts, Objective.S_PLUS, weights=ObjectiveWeights(beta=0)))
    assert found.subset == (4,)


def test_24_questions():
    """Against the best of a sample that holds single questions and all pairs."""
    counts, objective = draw_counts(3, 20, 24, 6), Objective.S_PRIME_PLUS
    found = last(enumerate_subsets(counts, objective))
    assert found.finished
    rng = np.random.default_rng(0)
    sample = (rng.random((20_000, 24)) < rng.random((20_000, 1))).astype(np.uint8)
    i, j = np.triu_indices(24)
    sample[np.arange(i.size)] = 0
    sample[np.arange(i.size), i] = sample[np.arange(i.size), j] = 1
    assert found.terms.value >= Fitness(counts, objective)(sample).max()


def test_more_are_refused_before_any_work():
    counts = draw_counts(0, 20, 30, 6)
    assert not can_enumerate(counts, Objective.S_PLUS)
    with pytest.raises(ValueError, match="different subsets, more than"):
        next(enumerate_subsets(counts, Objective.S_PLUS))


def test_large_counts_do_not_overflow():
    """Sums beyond 16 bits, and beyond what float32 counts exactly."""
    small = draw_counts(5, 4, 6)
    for factor in (2**13, 2**24):
        kinds = (small.correct, small.wrong, small.invalid)
        large = Counts(*(kind * factor for kind in kinds), small.labels)
        for objective in Objective:
            assert (
                last(enumerate_subsets(large, objective)).subset
                == last(enumerate_subsets(small, objective)).subset
            )


def test_a_stop_is_heard_and_reported(monkeypatch):
    """It is asked at every right half: while counting, then while comparing."""
    monkeypatch.setattr(background_task, "_POLL_SECONDS", 0)
    counts = draw_counts(2, n_questions=12)
    for most in (3, 2**6 + 3):
        asked = []
        reports = list(
            enumerate_subsets(
                counts, Objective.S_PLUS, stop=lambda a=asked, m=most: a.append(0) or len(a) > m
            )
        )
        assert not reports[-1].finished
        assert len(asked) == most + 1


def test_one_state_is_nothing_to_search():
    counts = draw_counts(0)
    positive = Counts(
        counts.correct, counts.wrong, counts.invalid, np.ones(counts.n_images, dtype=np.int8)
    )
    with pytest.raises(NothingToSearchError, match="label some of the negative state"):
        next(enumerate_subsets(positive, Objective.S_PLUS))
