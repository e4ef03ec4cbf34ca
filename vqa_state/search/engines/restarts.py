"""The default engine: the genetic search, then local searches from many starts.

The first population of the genetic search holds every single question. The local searches start
from sparse random subsets, and from the best subset with a few questions changed. On tables like
the paper's that reaches subsets that the genetic search misses (docs/decisions/0008-restarts.md).

Source: paper II-B; H. R. Lourenço, O. C. Martin, T. Stützle, "Iterated Local Search", 2003.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count as count_up
from itertools import islice

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
    report_of,
    search,
    stream,
)
from vqa_state.search.local_search import LocalSearch, Position
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights

__all__ = ["ENGINE", "N_RESTARTS", "restart_search"]

#: Local searches after the genetic search.
N_RESTARTS = 400

_RESTARTS_A_REPORT = 4

# Sums of answers that a local search and a report may look at; a step on 64 questions and 20 images
# looks at 85 thousand. Larger tables get the work of so many local searches, not their number.
_CELLS_A_RESTART = 4_000_000
_CELLS_A_REPORT = 2_500_000
_STEPS_A_RESTART = 16

_LEAST_CHANGED, _MOST_CHANGED = 3, 8


def restart_search(
    counts: Counts,
    objective: Objective,
    *,
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    settings: SearchSettings = PAPER_SETTINGS,
    seed: int,
    n_restarts: int = N_RESTARTS,
) -> Iterator[SearchReport]:
    """The genetic search, then local searches; reports after each generation and a few of them.

    Where 64 questions and 20 images are exceeded by far, local searches are cut to a number of
    steps that takes a minute or less, and reports come after a few steps.

    A report's `generation` goes on counting through the local searches up to `total`; the mean
    fitness is then that of the optima since the last report. See `EngineSearch` for the rest.

    Yields:
        The same reports for the same arguments; never an end below that of the genetic search.

    Raises:
        NothingToSearchError: if there are no questions, no images or no images of one state.
        ValueError: if the seed or the number of restarts is negative, or the population too large.
    """
    if n_restarts < 0:
        raise ValueError(f"n_restarts must be 0 or more, got {n_restarts}")
    evolution = search(counts, objective, weights=weights, settings=settings, seed=seed)
    local = LocalSearch(counts, objective, weights)
    rng = stream(objective, seed, "climbs")
    return _evolve_and_restart(evolution, _Restarts(local, n_restarts, rng), local.fitness)


def _evolve_and_restart(
    evolution: Iterator[SearchReport], restarts: "_Restarts", fitness: Fitness
) -> Iterator[SearchReport]:
    report = None
    for evolved in evolution:
        report = replace(evolved, total=evolved.total + restarts.n_reports)
        yield report
    assert report is not None  # noqa: S101  # a search reports at least generation 0
    restarts.best[list(report.subset)] = 1
    for ends in restarts.run():
        report = report_of(
            restarts.best,
            fitness,
            report.generation + 1,
            report.total,
            np.array([end.value for end in ends]),
            report.n_evaluations + sum(end.n_evaluations for end in ends),
        )
        yield report


class _Restarts:
    """Local searches from many starts, and the best subset that they found.

    All are made where they are cheap, else as many steps as such local searches cost in all. A size
    decides, not a clock: the same arguments give the same reports, on any machine.
    """

    def __init__(self, local: LocalSearch, n_restarts: int, rng: np.random.Generator) -> None:
        self.local, self.n_restarts, self.rng = local, n_restarts, rng
        self.best = np.zeros(local.fitness.n_questions, dtype=np.uint8)

    @property
    def in_full(self) -> bool:
        """Whether all local searches are made, each to its optimum."""
        n_expected = max(_STEPS_A_RESTART, self.best.size // 8)
        return n_expected * self.local.cells_a_step <= _CELLS_A_RESTART

    @property
    def _steps_a_report(self) -> int:
        """Steps between two reports, where local searches are not made in full."""
        return max(1, _CELLS_A_REPORT // self.local.cells_a_step)

    @property
    def n_reports(self) -> int:
        """Reports that `run` gives."""
        if self.in_full:
            return -(-self.n_restarts // _RESTARTS_A_REPORT)
        cells_a_report = self._steps_a_report * self.local.cells_a_step
        return -(-self.n_restarts * _CELLS_A_RESTART // cells_a_report)

    def run(self) -> Iterator[list[Position]]:
        """A few optima each time, or where the local search stands after some steps."""
        if self.in_full:
            for first in range(0, self.n_restarts, _RESTARTS_A_REPORT):
                numbers = range(first, min(first + _RESTARTS_A_REPORT, self.n_restarts))
                yield [self._keep(self.local.optimum(self._start(number))) for number in numbers]
            return
        steps = self._steps()
        for _ in range(self.n_reports):
            ends = list(islice(steps, self._steps_a_report))
            self._keep(ends[-1])
            yield [replace(ends[-1], n_evaluations=sum(end.n_evaluations for end in ends))]

    def _steps(self) -> Iterator[Position]:
        """One local search after the other without end; a step's own evaluations."""
        for number in count_up():
            n_before = 0
            for position in self.local.steps(self._start(number)):
                yield replace(position, n_evaluations=position.n_evaluations - n_before)
                n_before = position.n_evaluations
            self._keep(position)

    def _keep(self, position: Position) -> Position:
        self.best = better(self.best, position.individual, self.local.fitness)
        return position

    def _start(self, number: int) -> NDArray[np.uint8]:
        """First the best; then in turns it with a few questions changed, and a random subset.

        More often a small one, because the paper's objectives have good subsets of few questions,
        and a local search adds questions more readily than it finds which of many to drop.
        """
        if number == 0:
            return self.best
        if number % 2:
            start = self.best.copy()
            n_changed = min(int(self.rng.integers(_LEAST_CHANGED, _MOST_CHANGED + 1)), start.size)
            start[self.rng.choice(start.size, n_changed, replace=False)] ^= 1
            return start
        share = max(self.rng.random() ** 4, 1.5 / self.best.size)
        return (self.rng.random(self.best.size) < share).astype(np.uint8)


ENGINE = EngineKind(
    name="default",
    hint="default: searches longer, then proves how good the best can be",
    is_proved=True,
    search=restart_search,
)
