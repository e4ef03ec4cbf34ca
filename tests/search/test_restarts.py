"""The default engine: local search against every neighbour, and one seed, one run."""

from itertools import combinations, islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from search_tables import draw_counts

from vqa_state.search.engines.restarts import restart_search
from vqa_state.search.exact import enumerate_subsets
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import SearchSettings, search
from vqa_state.search.local_search import LocalSearch
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights

QUICK = SearchSettings(population=40, generations=6)
WEIGHTS = [PAPER_WEIGHTS, ObjectiveWeights(alpha=0, beta=0.5), ObjectiveWeights(beta=0)]


def last(reports):
    *_, report = reports
    return report


@given(st.integers(0, 2**32), st.sampled_from(Objective), st.sampled_from(WEIGHTS))
@settings(max_examples=30)
def test_no_change_of_one_or_two_questions_beats_a_local_optimum(seed, objective, weights):
    counts = draw_counts(seed, 6, 9)
    start = np.random.default_rng(seed).integers(0, 2, 9, dtype=np.uint8)
    found = LocalSearch(counts, objective, weights).optimum(start)
    fitness = Fitness(counts, objective, weights)
    neighbours = []
    for pair in [*combinations(range(9), 1), *combinations(range(9), 2)]:
        neighbour = found.individual.copy()
        neighbour[list(pair)] ^= 1
        neighbours.append(neighbour)
    value = fitness(found.individual[np.newaxis])[0]
    assert value == pytest.approx(found.value, abs=1e-4)
    assert value >= fitness(start[np.newaxis])[0]
    assert fitness(np.array(neighbours)).max() <= value + 3e-5  # it searches in float32


def test_hundreds_of_questions_work():
    counts = draw_counts(0, 20, 300, 6)
    found = last(restart_search(counts, Objective.S_MINUS, settings=QUICK, n_restarts=4, seed=0))
    single = found.subset and Fitness(counts, Objective.S_MINUS)
    flips = np.repeat([np.isin(np.arange(300), found.subset)], 300, axis=0) ^ np.eye(
        300, dtype=bool
    )
    assert single(flips).max() <= found.best_fitness + 3e-5


@given(st.integers(0, 2**32), st.integers(1, 12), st.sampled_from(Objective))
@settings(max_examples=20)
def test_small_tables_are_solved(seed, n_questions, objective):
    counts = draw_counts(seed, 6, n_questions)
    exact = last(enumerate_subsets(counts, objective))
    found = last(restart_search(counts, objective, settings=QUICK, n_restarts=40, seed=seed))
    assert found.best_fitness == pytest.approx(exact.terms.value, abs=1e-5)


def test_it_goes_on_from_the_genetic_search():
    counts = draw_counts(1, 20, 40, 6)
    evolved = list(search(counts, Objective.S_PLUS, settings=QUICK, seed=3))
    reports = list(restart_search(counts, Objective.S_PLUS, settings=QUICK, n_restarts=10, seed=3))
    assert [r.subset for r in reports[:7]] == [r.subset for r in evolved]
    assert [r.generation for r in reports] == list(range(10))
    assert {r.total for r in reports} == {9}
    best = [r.best_fitness for r in reports]
    assert best == sorted(best)
    evaluations = [r.n_evaluations for r in reports]
    assert evaluations == sorted(evaluations)
    fitness = Fitness(counts, Objective.S_PLUS)
    assert all(r.terms == fitness.terms(r.subset) for r in reports)
    assert best[-1] > best[6]  # the local searches found more, or this test shows nothing


def test_a_seed_repeats_and_another_differs():
    counts = draw_counts(2, 20, 40, 6)

    def run(seed):
        return list(
            restart_search(counts, Objective.S_PLUS, settings=QUICK, n_restarts=12, seed=seed)
        )

    assert run(5) == run(5)
    assert run(5) != run(6)


def test_wrong_numbers_are_refused_at_once():
    counts = draw_counts(0)
    with pytest.raises(ValueError, match="n_restarts must be 0 or more, got -1"):
        restart_search(counts, Objective.S_PLUS, n_restarts=-1, seed=0)
    with pytest.raises(ValueError, match="seed must be 0 or more"):
        restart_search(counts, Objective.S_PLUS, seed=-1)


def test_a_local_search_ends_where_a_gain_drowns_in_rounding():
    """Beside a huge value a step of no gain looks like one; the weights' own limit is below."""
    counts, huge = draw_counts(0, 6, 40), ObjectiveWeights(alpha=1_000_000)
    object.__setattr__(huge, "alpha", 2e12)
    steps = LocalSearch(counts, Objective.S_PRIME_MINUS, huge).steps(np.zeros(40, dtype=np.uint8))
    assert len(list(islice(steps, 500))) < 500


def test_a_large_table_gets_the_work_of_so_many_restarts():
    """All objectives report equally often, and a report never takes more than some steps."""
    counts = draw_counts(4, 200, 120, 6)
    runs = {
        objective: list(restart_search(counts, objective, settings=QUICK, n_restarts=10, seed=0))
        for objective in (Objective.S_PLUS, Objective.S_PRIME_MINUS)
    }
    assert len({len(reports) for reports in runs.values()}) == 1
    for objective, reports in runs.items():
        assert [r.generation for r in reports] == list(range(len(reports)))
        assert {r.total for r in reports} == {len(reports) - 1}
        best = [r.best_fitness for r in reports]
        assert best == sorted(best)
        assert best[-1] > best[QUICK.generations]
        evaluations = np.diff([r.n_evaluations for r in reports[QUICK.generations :]])
        assert evaluations.max() <= 4 * (120 + 2016)
        again = restart_search(counts, objective, settings=QUICK, n_restarts=10, seed=0)
        assert reports == list(again)
