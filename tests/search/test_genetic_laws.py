"""The genetic search: optimal on small tables, repeatable, and what it refuses."""

import random
import threading

import numpy as np
import pytest
from genetic_tables import QUICK, last, table
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vqa_state.answers.rates import Counts
from vqa_state.errors import NothingToSearchError
from vqa_state.search import genetic
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import SearchSettings, first_population, search
from vqa_state.search.objectives import Objective, ObjectiveWeights


def best_by_enumeration(counts, objective):
    """(fitness, subset) of the best of all subsets, ties broken as documented."""
    population = np.array(list(np.ndindex(*[2] * counts.n_questions)), dtype=np.uint8)
    values = Fitness(counts, objective)(population)
    ranked = sorted(
        zip(values, population.tolist(), strict=True), key=lambda v: (-v[0], sum(v[1]), v[1])
    )
    return ranked[0][0], tuple(np.flatnonzero(ranked[0][1]).tolist())


@given(st.integers(0, 2**32), st.integers(1, 5), st.integers(2, 6), st.sampled_from(Objective))
@settings(max_examples=30, deadline=None)
def test_small_tables_are_solved(seed, n_questions, n_images, objective):
    """At most 32 subsets and 500 individuals: chance misses one once in millions of runs."""
    counts = table(n_images, n_questions, seed)
    found = last(search(counts, objective, settings=SearchSettings(500, 5), seed=seed))
    assert (found.best_fitness, found.subset) == best_by_enumeration(counts, objective)


@given(st.integers(0, 2**32), st.integers(6, 9), st.sampled_from(Objective))
@settings(max_examples=20, deadline=None)
def test_no_search_exceeds_the_optimum(seed, n_questions, objective):
    counts = table(8, n_questions, seed)
    found = last(search(counts, objective, settings=SearchSettings(20, 5), seed=seed))
    assert found.best_fitness <= best_by_enumeration(counts, objective)[0]


def test_ties_go_to_fewer_questions_then_to_the_smallest_vector():
    same = np.full((2, 4), 3)
    labels = np.array([1, -1], dtype=np.int8)
    counts = Counts(same, same, np.zeros_like(same), labels)
    flat = ObjectiveWeights(beta=0)
    reports = search(counts, Objective.S_PLUS, weights=flat, settings=QUICK, seed=0)
    assert last(reports).subset == (3,)  # 0001 is smaller than 0010


@given(st.lists(st.integers(1, 2**20 - 1), min_size=1, max_size=30), st.data())
@settings(deadline=None)
def test_the_fittest_by_the_documented_order(vectors, data):
    """Vectors of 20 questions, read as binary numbers: the smaller number comes first."""
    population = np.array([[int(bit) for bit in f"{v:020b}"] for v in vectors], dtype=np.uint8)
    values = data.draw(
        st.lists(st.sampled_from([0.0, 1.0]), min_size=len(vectors), max_size=len(vectors))
    )
    rank = [(-x, v.bit_count(), v) for x, v in zip(values, vectors, strict=True)]
    assert genetic.fittest(population, np.array(values)) == rank.index(min(rank))


@given(st.integers(0, 2**32), st.sampled_from(Objective))
@example(653, Objective.S_PRIME_MINUS)
@settings(max_examples=20, deadline=None)
def test_reports_are_consistent_and_the_best_never_falls(seed, objective):
    counts = table(n_questions=12)
    reports = list(search(counts, objective, settings=QUICK, seed=seed))
    assert [r.generation for r in reports] == list(range(QUICK.generations + 1))
    assert {r.total for r in reports} == {QUICK.generations}
    best = [r.best_fitness for r in reports]
    assert best == sorted(best)
    for report in reports:
        # The mean of equal floats may be some last bits above each of them.
        assert report.mean_fitness <= report.best_fitness + 1e-9
        assert report.terms == Fitness(counts, objective).terms(report.subset)
        assert report.terms.value == report.best_fitness


# --- repeatability ----------------------------------------------------------------------------


def test_a_seed_repeats_and_another_differs():
    counts = table(n_questions=30)
    first = list(search(counts, Objective.S_PLUS, settings=QUICK, seed=7))
    assert list(search(counts, Objective.S_PLUS, settings=QUICK, seed=7)) == first
    assert list(search(counts, Objective.S_PLUS, settings=QUICK, seed=8)) != first


def test_objectives_draw_from_streams_of_their_own(monkeypatch):
    """Without the objective in the seed, all four would start from one population."""
    starts = []
    monkeypatch.setattr(genetic, "_evolve", lambda *args: starts.append(args[2].random(8).tolist()))
    for objective in Objective:
        search(table(), objective, seed=0)
    assert len({tuple(start) for start in starts}) == len(Objective)


def test_the_order_of_images_does_not_matter():
    counts, order = table(n_images=20), np.random.default_rng(0).permutation(20)
    kinds = (counts.correct, counts.wrong, counts.invalid, counts.labels)
    shuffled = Counts(*(kind[order] for kind in kinds))
    reports = list(search(counts, Objective.S_PLUS, settings=QUICK, seed=1))
    assert list(search(shuffled, Objective.S_PLUS, settings=QUICK, seed=1)) == reports


def test_searches_in_threads_do_not_mix():
    counts, found = table(n_questions=30), {}
    alone = [list(search(counts, Objective.S_MINUS, settings=QUICK, seed=s)) for s in range(4)]

    def run(seed):
        found[seed] = list(search(counts, Objective.S_MINUS, settings=QUICK, seed=seed))

    threads = [threading.Thread(target=run, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[seed] for seed in range(4)] == alone


def test_two_interleaved_searches_do_not_mix():
    counts = table()
    alone = list(search(counts, Objective.S_PLUS, settings=QUICK, seed=0))
    pair = [search(counts, Objective.S_PLUS, settings=QUICK, seed=0) for _ in range(2)]
    assert [both[0] for both in zip(*pair, strict=True)] == alone


def test_the_global_random_states_stay_untouched():
    before = random.getstate(), np.random.get_state()[1].tolist()
    last(search(table(), Objective.S_PLUS, settings=QUICK, seed=0))
    assert (random.getstate(), np.random.get_state()[1].tolist()) == before


# --- edges ------------------------------------------------------------------------------------


@pytest.mark.parametrize("n_questions", [1, 2])
@pytest.mark.parametrize("objective", Objective)
def test_one_and_two_questions_work(n_questions, objective):
    counts = table(n_questions=n_questions)
    found = last(search(counts, objective, settings=QUICK, seed=0))
    assert (found.best_fitness, found.subset) == best_by_enumeration(counts, objective)


def test_thousands_of_questions_work():
    sizes = SearchSettings(population=50, generations=3)
    found = last(search(table(20, 5000), Objective.S_MINUS, settings=sizes, seed=0))
    assert 0 < found.terms.n_used < 5000


def test_the_caller_stops_by_not_going_on():
    reports = search(table(), Objective.S_PLUS, settings=SearchSettings(1000, 100_000), seed=0)
    assert [next(reports).generation for _ in range(3)] == [0, 1, 2]


@pytest.mark.parametrize(
    ("shape", "labels", "message"),
    [
        ((0, 3), [], "no training image has a label and all its answers"),
        ((2, 0), [1, -1], "no questions"),
        ((2, 3), [1, 1], "all 2 training images show the positive state; label some of the neg"),
        ((2, 3), [-1, -1], "show the negative state; label some of the positive state"),
    ],
)
def test_nothing_to_search_is_said_at_once(shape, labels, message):
    """When `search` is called, not when the first report is asked for."""
    ones, zeros = np.ones(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    counts = Counts(ones, zeros, zeros, np.array(labels, dtype=np.int8))
    with pytest.raises(NothingToSearchError, match=message):
        search(counts, Objective.S_PLUS, seed=0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"population": 1},
        {"population": 10**9},
        {"generations": -1},
        {"generations": 10**9},
        {"tournament": 0},
        {"crossover": 1.1},
        {"mutation": -0.1},
        {"bit_flip": float("nan")},
    ],
)
def test_settings_are_validated(wrong):
    ((name, value),) = wrong.items()
    with pytest.raises(ValueError, match=f"{name} must be .* to .*, got {value}"):
        SearchSettings(**wrong)


def test_sizes_are_whole_numbers():
    with pytest.raises(ValueError, match=r"population must be a whole number, got 100\.0"):
        SearchSettings(population=100.0)


def test_a_population_too_large_for_memory_is_refused():
    with pytest.raises(ValueError, match="lower the population"):
        search(table(2, 2000), Objective.S_PLUS, settings=SearchSettings(100_000), seed=0)


def test_a_negative_seed_is_refused():
    with pytest.raises(ValueError, match="seed must be 0 or more, got -1"):
        search(table(), Objective.S_PLUS, seed=-1)


class TestFirstPopulation:
    @given(st.integers(1, 60), st.integers(1, 40), st.integers(0, 2**32))
    def test_an_eighth_of_it_may_be_single_questions(self, n_individuals, n_questions, seed):
        population = first_population(n_individuals, n_questions, np.random.default_rng(seed))
        assert population.shape == (n_individuals, n_questions)
        assert set(np.unique(population)) <= {0, 1}
        n_single = min(n_questions, n_individuals // 8)
        single = population[:n_single]
        assert (single.sum(axis=1) == 1).all()
        assert (single.sum(axis=0) <= 1).all()

    def test_one_good_question_among_many_bad_ones_is_found(self):
        """All others call everything positive, so no larger subset recognizes more than half."""
        n_images, n_questions = 20, 80
        labels = np.where(np.arange(n_images) % 2 == 0, 1, -1).astype(np.int8)
        correct = np.where(labels[:, None] == 1, 6, 0) * np.ones((1, n_questions), np.int64)
        correct[:, 37] = 6
        counts = Counts(correct, 6 - correct, np.zeros_like(correct), labels)
        *_, last = search(counts, Objective.S_PLUS, seed=0)
        assert last.subset == (37,)
        assert last.terms.n_recognized == n_images
