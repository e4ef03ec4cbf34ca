"""The paper's search: DEAP's `eaSimple` with the paper's settings, and nothing after it.

All operators are DEAP's own. What the toolbox replaces is how a population is evaluated, as one
array instead of one list after another, and how an individual is copied; both change no value and
no random draw, and make it several times as fast.

DEAP draws from Python's global `random`. Here its modules draw from a generator that belongs to the
search, so searches side by side do not mix, and the global state is neither read nor changed.

Source: paper II-B; F.-A. Fortin et al., "DEAP: Evolutionary Algorithms Made Easy", JMLR 2012.
"""

import random
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.search.engines._base import EngineKind
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import (
    PAPER_SETTINGS,
    SearchReport,
    SearchSettings,
    better,
    fittest,
    report_of,
    require_searchable,
    require_small,
)
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights

__all__ = ["ENGINE", "deap_search"]

#: DEAP's modules have one generator at a time.
_DRAWING = threading.Lock()


def deap_search(
    counts: Counts,
    objective: Objective,
    *,
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    settings: SearchSettings = PAPER_SETTINGS,
    seed: int,
) -> Iterator[SearchReport]:
    """Run DEAP's `eaSimple`, reporting after every generation; see `EngineSearch`."""
    require_searchable(counts)
    require_small(settings, counts.n_questions)
    if seed < 0:
        raise ValueError(f"seed must be 0 or more, got {seed}")
    fitness = Fitness(counts, objective, weights)
    return _evolve(fitness, settings, random.Random(f"{objective.value} {seed}"))


def _evolve(
    fitness: Fitness, settings: SearchSettings, rng: random.Random
) -> Iterator[SearchReport]:
    from deap import algorithms

    toolbox = _toolbox(fitness, settings, rng)
    population = toolbox.population(n=settings.population)
    n_evaluations, best = 0, np.zeros(fitness.n_questions, dtype=np.uint8)
    for generation in range(settings.generations + 1):
        with _drawing_from(rng):  # the first evaluates what was drawn, each other one evolves it
            population, log = algorithms.eaSimple(
                population,
                toolbox,
                cxpb=settings.crossover,
                mutpb=settings.mutation,
                ngen=min(generation, 1),
                verbose=False,
            )
        n_evaluations += sum(log.select("nevals"))
        values = np.array([individual.fitness.values[0] for individual in population])
        genes = _stacked(population)
        fittest_now = genes[fittest(genes, values)]
        best = fittest_now if generation == 0 else better(best, fittest_now, fitness)
        yield report_of(best, fitness, generation, settings.generations, values, n_evaluations)


@contextmanager
def _drawing_from(rng: random.Random) -> Iterator[None]:
    """Let DEAP's modules draw from this generator instead of from Python's global one."""
    from deap import algorithms
    from deap.tools import crossover, mutation, selection

    modules = (algorithms, crossover, mutation, selection)
    with _DRAWING:
        for module in modules:
            module.random = rng
        try:
            yield
        finally:
            for module in modules:
                module.random = random


def _toolbox(fitness: Fitness, settings: SearchSettings, rng: random.Random) -> Any:
    """DEAP's toolbox for `eaSimple`: the paper's operators, and whole populations evaluated."""
    from deap import base, tools

    class Maximized(base.Fitness):  # type: ignore[misc]  # DEAP ships no types
        weights = (1.0,)

        def __init__(self, wvalues: tuple[float, ...] = ()) -> None:
            self.wvalues = wvalues  # without DEAP's check of `weights` for every copy

    class Individual(bytearray):
        """Zeros and ones with a fitness, as DEAP's `creator` would make it, but not global."""

        __slots__ = ("fitness",)

        def __init__(self, genes: Iterable[int], fitness: Maximized | None = None) -> None:
            super().__init__(genes)
            self.fitness = fitness or Maximized()

    def clone(individual: Individual) -> Individual:
        return Individual(individual, Maximized(individual.fitness.wvalues))

    def evaluate_all(evaluate: Any, individuals: Sequence[Individual]) -> list[tuple[float]]:
        values = evaluate(_stacked(individuals)) if individuals else np.zeros(0)
        return [(value,) for value in values.tolist()]

    toolbox = base.Toolbox()
    toolbox.register("bit", rng.randint, 0, 1)
    toolbox.register("individual", tools.initRepeat, Individual, toolbox.bit, fitness.n_questions)
    toolbox.register("population", tools.initRepeat, list, toolbox.individual)
    toolbox.register("clone", clone)
    toolbox.register("evaluate", fitness)
    toolbox.register("map", evaluate_all)
    # Two cuts need two questions; with one there is nothing to swap.
    toolbox.register("mate", tools.cxTwoPoint if fitness.n_questions > 1 else lambda *pair: pair)
    toolbox.register("mutate", tools.mutFlipBit, indpb=settings.bit_flip)
    toolbox.register(  # compares the values themselves, not objects around them
        "select", tools.selTournament, tournsize=settings.tournament, fit_attr="fitness.wvalues"
    )
    return toolbox


def _stacked(individuals: Sequence[bytearray]) -> NDArray[np.uint8]:
    """The individuals as one array, (n_individuals, n_questions)."""
    return np.frombuffer(b"".join(individuals), dtype=np.uint8).reshape(len(individuals), -1)


ENGINE = EngineKind(
    name="paper",
    hint="paper: its one genetic search, nothing proved",
    is_proved=False,
    search=deap_search,
)
