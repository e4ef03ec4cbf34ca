"""The two engines: the paper's one genetic search, and ours, which goes on with restarts.

Ours runs the genetic search, whose first population holds every single question, and then climbs
from many starts: sparse random subsets, and the best one with a few questions changed. On tables
like the paper's that reaches subsets that the genetic search misses
(docs/decisions/0008-restarts.md).

Source: paper II-B; H. R. Lourenço, O. C. Martin, T. Stützle, "Iterated Local Search", 2003.
"""

from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from vqa_state.scores import PAPER_WEIGHTS, Counts, Objective, ObjectiveWeights
from vqa_state.search.climbing import Climber
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import (
    PAPER_SETTINGS,
    SearchReport,
    SearchSettings,
    better,
    search,
    stream,
)

__all__ = ["CLIMBS", "Engine", "default_search", "search_with"]

#: Climbs after the genetic search.
CLIMBS = 400

_CLIMBS_A_REPORT = 4
_LEAST_CHANGED, _MOST_CHANGED = 3, 8


class Engine(StrEnum):
    """How to look for a subset: exactly as in the paper, or longer."""

    PAPER = "paper"
    DEFAULT = "default"


def search_with(
    engine: Engine,
    counts: Counts,
    objective: Objective,
    *,
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    settings: SearchSettings = PAPER_SETTINGS,
    seed: int,
) -> Iterator[SearchReport]:
    """Search with one of the engines; see `genetic.search` and `default_search`."""
    if engine is Engine.PAPER:
        return search(
            counts, objective, weights=weights, settings=settings, seed=seed, singles_first=False
        )
    return default_search(counts, objective, weights=weights, settings=settings, seed=seed)


def default_search(
    counts: Counts,
    objective: Objective,
    *,
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    settings: SearchSettings = PAPER_SETTINGS,
    n_climbs: int = CLIMBS,
    seed: int,
) -> Iterator[SearchReport]:
    """The genetic search, then `n_climbs` climbs; reports after each generation and few climbs.

    A report's `generation` goes on counting through the climbs up to `total`; the mean fitness is
    then that of the summits since the last report.

    Yields:
        The same reports for the same arguments; never an end below that of the genetic search.

    Raises:
        NothingToSearchError: if there are no questions, no images or no images of one state.
        ValueError: if the seed or the number of climbs is negative, or the population too large.
    """
    if n_climbs < 0:
        raise ValueError(f"n_climbs must be 0 or more, got {n_climbs}")
    evolution = search(counts, objective, weights=weights, settings=settings, seed=seed)
    return _evolve_and_climb(counts, objective, weights, evolution, n_climbs, seed)


def _evolve_and_climb(
    counts: Counts,
    objective: Objective,
    weights: ObjectiveWeights,
    evolution: Iterator[SearchReport],
    n_climbs: int,
    seed: int,
) -> Iterator[SearchReport]:
    n_more = -(-n_climbs // _CLIMBS_A_REPORT)
    report = None
    for evolved in evolution:
        report = replace(evolved, total=evolved.total + n_more)
        yield report
    assert report is not None  # noqa: S101  # a search reports at least generation 0
    fitness, climber = Fitness(counts, objective, weights), Climber(counts, objective, weights)
    rng = stream(objective, seed, "climbs")
    best = np.zeros(counts.n_questions, dtype=np.uint8)
    best[list(report.subset)] = 1
    for first in range(0, n_climbs, _CLIMBS_A_REPORT):
        values, n_evaluations = [], report.n_evaluations
        for climb in range(first, min(first + _CLIMBS_A_REPORT, n_climbs)):
            start = best if climb == 0 else _start(best, climb, rng)
            summit = climber.climb(start)
            best = better(best, summit.individual, fitness)
            values.append(summit.value)
            n_evaluations += summit.n_evaluations
        subset = tuple(np.flatnonzero(best).tolist())
        terms = fitness.terms(subset)
        report = SearchReport(
            generation=report.generation + 1,
            total=report.total,
            best_fitness=terms.value,
            mean_fitness=float(np.mean(values)),
            terms=terms,
            subset=subset,
            n_evaluations=n_evaluations,
        )
        yield report


def _start(best: NDArray[np.uint8], climb: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """In turns the best with a few questions changed, and a random subset, more often a small one.

    Small ones, because the paper's objectives have good subsets of few questions, and a climb adds
    questions more readily than it finds which of many to drop.
    """
    if climb % 2:
        start = best.copy()
        n_changed = min(int(rng.integers(_LEAST_CHANGED, _MOST_CHANGED + 1)), best.size)
        start[rng.choice(best.size, n_changed, replace=False)] ^= 1
        return start
    share = max(rng.random() ** 4, 1.5 / best.size)
    return (rng.random(best.size) < share).astype(np.uint8)
