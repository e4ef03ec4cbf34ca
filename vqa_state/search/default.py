"""The two engines: the paper's one genetic search, and ours, which goes on with restarts.

Ours runs the genetic search, whose first population holds every single question, and then climbs
from many starts: sparse random subsets, and the best one with a few questions changed. On tables
like the paper's that reaches subsets that the genetic search misses
(docs/decisions/0008-restarts.md).

Source: paper II-B; H. R. Lourenço, O. C. Martin, T. Stützle, "Iterated Local Search", 2003.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import count as count_up
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import (
    PAPER_SETTINGS,
    SearchReport,
    SearchSettings,
    better,
    search,
    stream,
)
from vqa_state.search.local_search import Climber, Summit
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights

__all__ = ["CLIMBS", "Engine", "default_search", "search_with"]

#: Climbs after the genetic search.
CLIMBS = 400

_CLIMBS_A_REPORT = 4

# Sums of answers that a climb and a report may look at; a step on 64 questions and 20 images looks
# at 85 thousand. Larger tables get the work of so many climbs, not the climbs.
_CELLS_A_CLIMB = 4_000_000
_CELLS_A_REPORT = 2_500_000
_STEPS_A_CLIMB = 16

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

    Where 64 questions and 20 images are exceeded by far, climbs are cut to a number of steps that
    takes a minute or less, and reports come after a few steps.

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
    fitness, climber = Fitness(counts, objective, weights), Climber(counts, objective, weights)
    plan = _plan(climber.cells_a_step, counts.n_questions, n_climbs)
    report = None
    for evolved in evolution:
        report = replace(evolved, total=evolved.total + plan.n_reports)
        yield report
    assert report is not None  # noqa: S101  # a search reports at least generation 0
    best = np.zeros(counts.n_questions, dtype=np.uint8)
    best[list(report.subset)] = 1
    ways = _Ways(climber, fitness, best, stream(objective, seed, "climbs"))
    for ends in ways.in_full(n_climbs) if plan.in_full else ways.in_part(plan):
        subset = tuple(np.flatnonzero(ways.best).tolist())
        terms = fitness.terms(subset)
        report = SearchReport(
            generation=report.generation + 1,
            total=report.total,
            best_fitness=terms.value,
            mean_fitness=float(np.mean([end.value for end in ends])),
            terms=terms,
            subset=subset,
            n_evaluations=report.n_evaluations + sum(end.n_evaluations for end in ends),
        )
        yield report


@dataclass(frozen=True, slots=True)
class _Plan:
    """How to climb on a table of some size.

    Attributes:
        in_full: whether all climbs are made, each to its summit.
        n_reports: reports about climbs.
        n_steps: steps between two reports, where climbs are not made in full.
    """

    in_full: bool
    n_reports: int
    n_steps: int = 0


def _plan(cells_a_step: int, n_questions: int, n_climbs: int) -> _Plan:
    """All climbs where they are cheap, else as many steps as such climbs cost in all.

    A size decides, not a clock: the same arguments give the same reports, on any machine.
    """
    n_expected = max(_STEPS_A_CLIMB, n_questions // 8)
    if n_expected * cells_a_step <= _CELLS_A_CLIMB:
        return _Plan(in_full=True, n_reports=-(-n_climbs // _CLIMBS_A_REPORT))
    n_steps = max(1, _CELLS_A_REPORT // cells_a_step)
    n_reports = -(-n_climbs * _CELLS_A_CLIMB // (n_steps * cells_a_step))
    return _Plan(in_full=False, n_reports=n_reports, n_steps=n_steps)


class _Ways:
    """Climbs from many starts, and the best subset that one of them passed."""

    def __init__(
        self,
        climber: Climber,
        fitness: Fitness,
        best: NDArray[np.uint8],
        rng: np.random.Generator,
    ) -> None:
        self._climber, self._fitness, self.best, self._rng = climber, fitness, best, rng

    def in_full(self, n_climbs: int) -> Iterator[list[Summit]]:
        """The summits of a few climbs each time."""
        for first in range(0, n_climbs, _CLIMBS_A_REPORT):
            summits = []
            for climb in range(first, min(first + _CLIMBS_A_REPORT, n_climbs)):
                summits.append(self._climber.climb(self._start(climb)))
                self._take(summits[-1])
            yield summits

    def in_part(self, plan: _Plan) -> Iterator[list[Summit]]:
        """Where the climb stands after so many steps; the last one does not come to its end."""
        steps = self._steps()
        for _ in range(plan.n_reports):
            ends = list(islice(steps, plan.n_steps))
            self._take(ends[-1])
            yield [replace(ends[-1], n_evaluations=sum(end.n_evaluations for end in ends))]

    def _steps(self) -> Iterator[Summit]:
        """One climb after the other without end, step by step; a step's own evaluations."""
        for climb in count_up():
            n_before = 0
            for place in self._climber.steps(self._start(climb)):
                yield replace(place, n_evaluations=place.n_evaluations - n_before)
                n_before = place.n_evaluations
            self._take(place)

    def _start(self, climb: int) -> NDArray[np.uint8]:
        return self.best if climb == 0 else _start(self.best, climb, self._rng)

    def _take(self, summit: Summit) -> None:
        self.best = better(self.best, summit.individual, self._fitness)


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
