"""What every objective and every engine has to keep; a new kind is tested by being registered."""

from itertools import islice

import numpy as np
import pytest
from genetic_tables import QUICK, last, table

from vqa_state.answers.rates import Counts
from vqa_state.errors import NothingToSearchError
from vqa_state.search.engines import Engine
from vqa_state.search.exact import enumerate_subsets
from vqa_state.search.fitness import EMPTY_SUBSET_FITNESS, Fitness
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.search.proof import prove

WEIGHTS = (ObjectiveWeights(), ObjectiveWeights(0, 0.999), ObjectiveWeights(1000, 0))


@pytest.fixture(params=Objective, ids=str)
def objective(request):
    return request.param


@pytest.fixture(params=Engine, ids=str)
def engine(request):
    return request.param


# --- objectives -------------------------------------------------------------------------------


def test_a_name_and_a_hint(objective):
    assert Objective(objective.kind.name) is objective
    assert objective.kind.hint
    assert objective.name.isidentifier()


@pytest.mark.parametrize("weights", WEIGHTS)
def test_no_subset_is_worse_than_the_empty_one(objective, weights):
    population = np.array(list(np.ndindex(*[2] * 6)), dtype=np.uint8)
    values = Fitness(table(8, 6), objective, weights)(population)
    assert values[0] == EMPTY_SUBSET_FITNESS
    assert values[1:].min() > EMPTY_SUBSET_FITNESS


def test_correct_answers_are_among_those_asked(objective):
    counts = table()
    assert (objective.kind.asked(counts) >= counts.correct).all()


def test_a_proof_finds_the_best_of_all_subsets(objective):
    counts = table(8, 9)
    population = np.array(list(np.ndindex(*[2] * 9)), dtype=np.uint8)
    best = Fitness(counts, objective)(population).max()
    assert last(enumerate_subsets(counts, objective)).terms.value == best
    proved = last(prove(counts, objective, (0,)))
    assert proved.terms.value == proved.bound == best


# --- engines ----------------------------------------------------------------------------------


SMALL = table(6, 5)


def run(engine, objective=Objective.S_PLUS, counts=SMALL, n_reports=None, seed=4):
    reports = engine.kind.search(counts, objective, settings=QUICK, seed=seed)
    return list(islice(reports, n_reports))


def test_reports_count_up_and_the_best_never_falls(engine, objective):
    reports = run(engine, objective)
    total = reports[0].total
    assert total >= QUICK.generations
    assert [(r.generation, r.total) for r in reports] == [(n, total) for n in range(total + 1)]
    best = [report.best_fitness for report in reports]
    assert best == sorted(best)
    fitness = Fitness(SMALL, objective)
    assert all(report.terms == fitness.terms(report.subset) for report in reports)


def test_a_seed_repeats_and_another_differs(engine):
    assert run(engine) == run(engine)
    assert run(engine, n_reports=5) != run(engine, n_reports=5, seed=5)


def test_objectives_start_apart(engine):
    """Of a table without Invalid answers, s+ and s'+ are the same but for what they draw."""
    sure = Counts(SMALL.correct, 6 - SMALL.correct, 0 * SMALL.correct, SMALL.labels)
    objectives = (Objective.S_PLUS, Objective.S_PRIME_PLUS)
    firsts = {run(engine, o, sure, n_reports=1)[0].mean_fitness for o in objectives}
    assert len(firsts) == 2


def test_small_tables_are_solved(engine):
    best = last(enumerate_subsets(SMALL, Objective.S_PLUS))
    assert run(engine)[-1].best_fitness == best.terms.value


def test_ties_go_to_fewer_questions_then_to_the_smallest_vector(engine):
    same, labels = np.full((2, 4), 3), np.array([1, -1], dtype=np.int8)
    counts = Counts(same, same, np.zeros_like(same), labels)
    flat = ObjectiveWeights(beta=0)
    found = engine.kind.search(counts, Objective.S_PLUS, weights=flat, settings=QUICK, seed=0)
    assert last(found).subset == (3,)


def test_one_question_can_be_searched(engine):
    assert run(engine, counts=table(6, 1), n_reports=QUICK.generations)[-1].subset == (0,)


def test_what_cannot_be_searched_is_refused_at_once(engine):
    none = np.zeros((2, 0), dtype=np.int64)
    empty = Counts(none, none, none, np.array([1, -1], dtype=np.int8))
    with pytest.raises(NothingToSearchError, match="there are no questions"):
        engine.kind.search(empty, Objective.S_PLUS, seed=0)
    with pytest.raises(ValueError, match="seed must be 0 or more"):
        engine.kind.search(table(), Objective.S_PLUS, seed=-1)
    huge = SearchSettings(population=100_000)
    with pytest.raises(ValueError, match="lower the population"):
        engine.kind.search(table(2, 1001), Objective.S_PLUS, settings=huge, seed=0)
