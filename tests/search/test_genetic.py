"""The genetic search against DEAP: each operator for the same draws, and whole runs."""

import random
from functools import cache
from itertools import chain, product
from types import SimpleNamespace

import numpy as np
import pytest
from deap import algorithms, base, tools
from genetic_tables import QUICK, put_singles, table
from scipy import stats

from vqa_state.search import genetic
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import SearchSettings, search
from vqa_state.search.objectives import Objective


class DeapFitness(base.Fitness):
    weights = (1.0,)


class Individual(list):
    """What DEAP's `creator` would make, without its global registry."""

    def __init__(self, genes, value=None):
        super().__init__(genes)
        self.fitness = DeapFitness() if value is None else DeapFitness((value,))


class Draws:
    """A generator that remembers or replays: feeds DEAP and the arrays the same numbers."""

    def __init__(self, *script):
        self.script = list(script)

    def integers(self, *_args, **_kwargs):
        return np.array(self.script.pop(0))

    def random(self, _size):
        return np.array(self.script.pop(0))


class Recorder:
    """A NumPy generator that keeps what it drew."""

    def __init__(self, seed):
        self.rng, self.drawn = np.random.default_rng(seed), []

    def _keep(self, values):
        self.drawn.append(values.copy())
        return values

    def integers(self, *args, **kwargs):
        return self._keep(self.rng.integers(*args, **kwargs))

    def random(self, size):
        return self._keep(self.rng.random(size))

    def permutation(self, size):
        return self._keep(self.rng.permutation(size))


def toolbox_for(counts, objective, *, tournament=5, bit_flip=0.05):
    fitness = Fitness(counts, objective)
    toolbox = base.Toolbox()
    evaluate = cache(lambda genes: (float(fitness(np.array([genes], np.uint8))[0]),))
    toolbox.register("evaluate", lambda genes: evaluate(tuple(genes)))
    toolbox.register("mate", tools.cxTwoPoint)
    toolbox.register("mutate", tools.mutFlipBit, indpb=bit_flip)
    toolbox.register("select", tools.selTournament, tournsize=tournament)
    return toolbox


def script_deap(monkeypatch, module, **draws):
    """Let one module of DEAP draw from our lists instead of from the global `random`."""
    queues = {name: iter(values) for name, values in draws.items()}
    fake = {name: (lambda *_, queue=queue: next(queue)) for name, queue in queues.items()}
    monkeypatch.setattr(f"deap.{module}.random", SimpleNamespace(**fake))


# --- one operator at a time -------------------------------------------------------------------


def test_tournament_is_deaps_for_every_draw(monkeypatch):
    """All tournaments of three among four, two of them equally fit."""
    values = np.array([1.0, 3.0, 2.0, 3.0])
    for aspirants in product(range(4), repeat=3):
        winners = genetic.tournament(values, 3, Draws([aspirants] * 4))
        population = [Individual([i], value) for i, value in enumerate(values)]
        script_deap(monkeypatch, "tools.selection", choice=[population[i] for i in aspirants])
        assert tools.selTournament(population, 1, 3)[0][0] == winners[0]


def test_tournament_draws_everyone_equally_often():
    """With one aspirant there is no contest; chi-square at a fixed seed."""
    parents = genetic.tournament(np.arange(50.0), 1, np.random.default_rng(1))
    assert parents.shape == (50,)
    rng = np.random.default_rng(2)
    drawn = np.concatenate([genetic.tournament(np.zeros(50), 1, rng) for _ in range(400)])
    assert stats.chisquare(np.bincount(drawn, minlength=50)).pvalue > 0.01


@pytest.mark.parametrize("n_questions", [2, 3, 6])
def test_crossover_is_deaps_for_every_draw(monkeypatch, n_questions):
    parents = [[0] * n_questions, [1] * n_questions]
    for cuts in product(range(1, n_questions + 1), range(1, n_questions)):
        children = np.array(parents, dtype=np.uint8)
        mated = genetic.two_point_crossover(children, 0.5, Draws([0.0], [cuts[0]], [cuts[1]]))
        script_deap(monkeypatch, "tools.crossover", randint=cuts)
        assert children.tolist() == list(tools.cxTwoPoint(*map(list, parents)))
        assert mated.all()


@pytest.mark.parametrize("n_questions", [3, 5])
def test_crossover_draws_its_cuts_in_deaps_ranges(n_questions):
    rng = Recorder(3)
    genetic.two_point_crossover(np.zeros((20_000, n_questions), np.uint8), 1, rng)
    _, first, second = rng.drawn  # the second before it is shifted past the first
    assert (first.min(), first.max()) == (1, n_questions)
    assert (second.min(), second.max()) == (1, n_questions - 1)
    assert stats.chisquare(np.bincount(first)[1:]).pvalue > 0.01
    assert stats.chisquare(np.bincount(second)[1:]).pvalue > 0.01


def test_crossover_pairs_neighbours_and_leaves_the_odd_one():
    population = np.array([[0, 0, 0], [1, 1, 1]] * 2 + [[1, 0, 1]], dtype=np.uint8)
    mated = genetic.two_point_crossover(population, 0.5, Draws([0.9, 0.1], [1], [1]))
    assert mated.tolist() == [False, False, True, True, False]
    assert population.tolist() == [[0, 0, 0], [1, 1, 1], [0, 1, 0], [1, 0, 1], [1, 0, 1]]


def test_crossover_needs_two_questions():
    population = np.array([[0], [1]], dtype=np.uint8)
    assert not genetic.two_point_crossover(population, 1, np.random.default_rng(0)).any()
    assert population.tolist() == [[0], [1]]


def test_mutation_is_deaps(monkeypatch):
    rng = np.random.default_rng(4)
    for _ in range(50):
        before = rng.integers(0, 2, (3, 5), dtype=np.uint8)
        flips, after = rng.random((2, 5)), before.copy()
        mutated = genetic.flip_mutation(after, 0.2, 0.4, Draws([0.1, 0.2, 0.0], flips))
        assert mutated.tolist() == [True, False, True]  # 0.2 is not below 0.2
        script_deap(monkeypatch, "tools.mutation", random=flips.ravel())
        expected = [tools.mutFlipBit(before[i].tolist(), 0.4)[0] for i in (0, 2)]
        assert after[[0, 2]].tolist() == expected
        assert (after[1] == before[1]).all()


# --- whole runs -------------------------------------------------------------------------------


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("population", [20, 21])
@pytest.mark.parametrize(("n_questions", "singles_first"), [(2, True), (9, True), (9, False)])
def test_a_run_is_easimple_given_the_same_draws(
    monkeypatch, objective, population, n_questions, singles_first
):
    counts, n_generations = table(n_questions=n_questions), 8
    rng = Recorder(population)
    sizes = SearchSettings(population=population, generations=n_generations)
    ours = list(genetic._evolve(Fitness(counts, objective), sizes, rng, singles_first))

    first, *rest = rng.drawn
    if singles_first:
        order, *rest = rest
        put_singles(first, order[: population // 8])
    steps = [rest[i : i + 6] for i in range(0, len(rest), 6)]
    aspirants, mating, cuts1, cuts2, mutating, flips = zip(*steps, strict=True)
    deap_population = [Individual(genes) for genes in first.tolist()]
    script_deap(
        monkeypatch,
        "tools.selection",
        choice=(deap_population[i] for i in chain.from_iterable(a.flat for a in aspirants)),
    )
    coins = chain.from_iterable([*m, *u] for m, u in zip(mating, mutating, strict=True))
    script_deap(monkeypatch, "algorithms", random=coins)
    both = chain.from_iterable(zip(chain(*cuts1), chain(*cuts2), strict=True))
    script_deap(monkeypatch, "tools.crossover", randint=both)
    script_deap(monkeypatch, "tools.mutation", random=chain.from_iterable(f.flat for f in flips))
    statistics = tools.Statistics(lambda individual: individual.fitness.values[0])
    statistics.register("mean", np.mean)
    hall = tools.HallOfFame(1)
    _, log = algorithms.eaSimple(
        deap_population,
        toolbox_for(counts, objective),
        cxpb=0.5,
        mutpb=0.2,
        ngen=n_generations,
        stats=statistics,
        halloffame=hall,
        verbose=False,
    )
    assert [r.mean_fitness for r in ours] == log.select("mean")
    assert [r.n_evaluations for r in ours] == np.cumsum(log.select("nevals")).tolist()
    assert ours[-1].best_fitness == hall[0].fitness.values[0]


def test_runs_have_the_distribution_of_easimple():
    """Two-sample Kolmogorov-Smirnov on 60 runs of DEAP and 200 of ours.

    Seeds are fixed, so nothing flickers; 0.005 for each of five tests keeps the chance of an
    unlucky pair of seeds, when they were chosen, at 2.5 %.
    """
    counts, objective = table(), Objective.S_PLUS
    toolbox = toolbox_for(counts, objective)
    statistics = tools.Statistics(lambda individual: individual.fitness.values[0])
    statistics.register("mean", np.mean)
    outer = random.getstate()

    def textbook(seed):
        random.seed(seed)
        genes = [[random.randint(0, 1) for _ in range(16)] for _ in range(QUICK.population)]
        put_singles(genes, random.sample(range(16), QUICK.population // 8))
        population, hall = [Individual(g) for g in genes], tools.HallOfFame(1)
        _, log = algorithms.eaSimple(
            population, toolbox, 0.5, 0.2, QUICK.generations, statistics, hall, verbose=False
        )
        means, nevals = log.select("mean"), log.select("nevals")
        return (hall[0].fitness.values[0], means[0], means[3], means[12], sum(nevals))

    def paper(seed):
        reports = list(search(counts, objective, settings=QUICK, seed=seed))
        means = [report.mean_fitness for report in reports]
        return (reports[-1].best_fitness, means[0], means[3], means[12], reports[-1].n_evaluations)

    try:
        deaps = np.array([textbook(seed) for seed in range(60)])
    finally:
        random.setstate(outer)
    ours = np.array([paper(seed) for seed in range(200)])
    assert len(np.unique(deaps[:, 0])) > 5  # the final best differs from run to run
    for column in range(deaps.shape[1]):
        assert stats.ks_2samp(deaps[:, column], ours[:, column]).pvalue > 0.005
