"""The search on arrays against DEAP itself: operator by operator, run by run, and in law."""

import random
import threading
from functools import cache
from itertools import chain, product
from types import SimpleNamespace

import numpy as np
import pytest
from deap import algorithms, base, tools
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from vqa_state.errors import NothingToSearchError
from vqa_state.scores import Counts, Objective, ObjectiveWeights
from vqa_state.search import genetic
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import SearchSettings, first_population, search

QUICK = SearchSettings(population=60, generations=12)


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


def table(n_images=10, n_questions=16, seed=0) -> Counts:
    """Answers hard enough that runs end in different places."""
    rng = np.random.default_rng(seed)
    correct = rng.binomial(6, rng.beta(0.6, 0.6, (n_images, n_questions)))
    invalid = rng.binomial(6 - correct, 0.15)
    labels = np.where(np.arange(n_images) % 2, 1, -1).astype(np.int8)
    return Counts(correct, 6 - correct - invalid, invalid, labels)


def put_singles(population, questions):
    """Let the first individuals hold one question each."""
    for row, question in enumerate(questions):
        for place in range(len(population[row])):
            population[row][place] = int(place == question)


def last(reports):
    *_, report = reports
    return report


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
@settings(max_examples=20, deadline=None)
def test_reports_are_consistent_and_the_best_never_falls(seed, objective):
    counts = table(n_questions=12)
    reports = list(search(counts, objective, settings=QUICK, seed=seed))
    assert [r.generation for r in reports] == list(range(QUICK.generations + 1))
    assert {r.total for r in reports} == {QUICK.generations}
    best = [r.best_fitness for r in reports]
    assert best == sorted(best)
    for report in reports:
        assert report.mean_fitness <= report.best_fitness
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
