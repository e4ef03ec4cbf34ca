"""The engine `paper`: DEAP's own `eaSimple`, and nothing of it left behind."""

import random

import numpy as np
import pytest
from deap import algorithms, base, creator, tools
from genetic_tables import QUICK, last, table

from vqa_state.search.engines.paper import deap_search
from vqa_state.search.fitness import Fitness
from vqa_state.search.objectives import Objective


class Maximized(base.Fitness):
    weights = (1.0,)


class Individual(list):
    def __init__(self, genes):
        super().__init__(genes)
        self.fitness = Maximized()


def textbook(counts, objective, seed):
    """DEAP as its tutorial shows it, with the global `random` in the state that a seed means."""
    fitness, toolbox = Fitness(counts, objective), base.Toolbox()
    toolbox.register("bit", random.randint, 0, 1)
    toolbox.register("individual", tools.initRepeat, Individual, toolbox.bit, n=counts.n_questions)
    toolbox.register("population", tools.initRepeat, list, toolbox.individual)
    toolbox.register("evaluate", lambda genes: (fitness(np.array([genes], np.uint8))[0],))
    toolbox.register("mate", tools.cxTwoPoint)
    toolbox.register("mutate", tools.mutFlipBit, indpb=QUICK.bit_flip)
    toolbox.register("select", tools.selTournament, tournsize=QUICK.tournament)
    statistics = tools.Statistics(lambda individual: individual.fitness.values[0])
    statistics.register("mean", np.mean)
    hall, outer = tools.HallOfFame(1), random.getstate()
    random.setstate(random.Random(f"{objective.value} {seed}").getstate())
    try:
        _, log = algorithms.eaSimple(
            toolbox.population(n=QUICK.population),
            toolbox,
            QUICK.crossover,
            QUICK.mutation,
            QUICK.generations,
            statistics,
            hall,
            verbose=False,
        )
    finally:
        random.setstate(outer)
    return log.select("mean"), log.select("nevals"), hall[0].fitness.values[0]


@pytest.mark.parametrize("objective", Objective)
def test_it_is_easimple_draw_for_draw(objective):
    counts = table()
    reports = list(deap_search(counts, objective, settings=QUICK, seed=3))
    means, n_evaluations, best = textbook(counts, objective, 3)
    assert [report.mean_fitness for report in reports] == means
    assert [report.n_evaluations for report in reports] == np.cumsum(n_evaluations).tolist()
    assert reports[-1].best_fitness == best


def test_the_global_generator_is_neither_read_nor_changed():
    random.seed(5)
    before = random.getstate()
    reports = deap_search(table(), Objective.S_PLUS, settings=QUICK, seed=3)
    for _ in range(3):
        next(reports)
        assert random.getstate() == before
    random.seed(6)  # as another part of the program might
    rest = list(reports)
    whole = list(deap_search(table(), Objective.S_PLUS, settings=QUICK, seed=3))
    assert rest == whole[3:]


def drawing_modules():
    return [algorithms, tools.selection, tools.crossover, tools.mutation]


def test_deap_gets_its_generator_back_after_a_close_and_an_error(monkeypatch):
    reports = deap_search(table(), Objective.S_PLUS, settings=QUICK, seed=3)
    next(reports)
    reports.close()
    assert all(module.random is random for module in drawing_modules())
    failing = deap_search(table(), Objective.S_PLUS, settings=QUICK, seed=3)
    next(failing)
    monkeypatch.setattr(Fitness, "__call__", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        next(failing)
    assert all(module.random is random for module in drawing_modules())


def test_searches_side_by_side_do_not_mix():
    counts = table()
    alone = [last(deap_search(counts, o, settings=QUICK, seed=1)) for o in Objective]
    together = [deap_search(counts, o, settings=QUICK, seed=1) for o in Objective]
    assert list(list(zip(*together, strict=True))[-1]) == alone


def test_no_class_is_left_in_creator():
    before = set(vars(creator))
    last(deap_search(table(), Objective.S_PLUS, settings=QUICK, seed=0))
    assert set(vars(creator)) == before


def test_its_first_population_is_random():
    """Single questions among the first individuals are the other engine's."""
    counts = table(n_questions=40)
    first = next(deap_search(counts, Objective.S_MINUS, settings=QUICK, seed=0))
    assert len(first.subset) > 5
