"""Time the genetic search against textbook DEAP: `python -m benchmarks.search`.

Both run the paper's algorithm with the paper's settings on the same synthetic tables. Runs are
interleaved, so that a busy machine slows both; look at the ratio more than at the seconds.
"""

import argparse
import json
import random
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from deap import algorithms, base, tools

from benchmarks.tables import draw_counts, draw_task
from vqa_state.scores import PAPER_WEIGHTS, Counts, Objective
from vqa_state.search.genetic import PAPER_SETTINGS, SearchSettings, search

__all__ = ["ENGINES", "Row", "main", "measure"]

OBJECTIVE = Objective.S_PLUS


class _Maximize(base.Fitness):  # type: ignore[misc]  # DEAP ships no types
    weights = (1.0,)


class _Individual(list[int]):
    def __init__(self, genes: Sequence[int]) -> None:
        super().__init__(genes)
        self.fitness = _Maximize()


def textbook_deap(counts: Counts, settings: SearchSettings, seed: int) -> float:
    """DEAP as its tutorial shows it; the best fitness found."""
    random.seed(seed)  # DEAP draws from the global state
    n_questions = counts.n_questions
    valid = counts.correct + counts.wrong

    def evaluate(individual: _Individual) -> tuple[float]:
        chosen = np.array(individual, dtype=bool)
        if not chosen.any():
            return (-1.0,)
        correct, asked = counts.correct[:, chosen].sum(axis=1), valid[:, chosen].sum(axis=1)
        R = correct / np.maximum(asked, 1)
        R_img, R_q = np.mean(2 * correct > asked), chosen.mean()
        return (float(PAPER_WEIGHTS.alpha * R_img + R.mean() + PAPER_WEIGHTS.beta * R_q),)

    toolbox = base.Toolbox()
    toolbox.register("evaluate", evaluate)
    toolbox.register("mate", tools.cxTwoPoint)
    toolbox.register("mutate", tools.mutFlipBit, indpb=settings.bit_flip)
    toolbox.register("select", tools.selTournament, tournsize=settings.tournament)
    population = [
        _Individual([random.randint(0, 1) for _ in range(n_questions)])
        for _ in range(settings.population)
    ]
    best = tools.HallOfFame(1)
    algorithms.eaSimple(
        population,
        toolbox,
        cxpb=settings.crossover,
        mutpb=settings.mutation,
        ngen=settings.generations,
        halloffame=best,
        verbose=False,
    )
    return float(best[0].fitness.values[0])


def paper(counts: Counts, settings: SearchSettings, seed: int) -> float:
    """The same search as this package runs it; the best fitness found."""
    *_, last = search(counts, OBJECTIVE, settings=settings, seed=seed)
    return last.best_fitness


Engine = Callable[[Counts, SearchSettings, int], float]
ENGINES: dict[str, Engine] = {"textbook_deap": textbook_deap, "paper": paper}


@dataclass(frozen=True, slots=True)
class Row:
    """One engine at one size.

    Attributes:
        engine: key of `ENGINES`.
        n_questions: questions to choose from.
        n_images: training images.
        seconds: median time of a run.
        hit_rate: share of runs that reach the proven optimum; None while nothing proves it.
    """

    engine: str
    n_questions: int
    n_images: int
    seconds: float
    hit_rate: float | None = None


@dataclass(frozen=True, slots=True)
class Plan:
    """What to measure: sizes as (n_questions, n_images), runs of each, and the settings."""

    sizes: tuple[tuple[int, int], ...] = ((16, 20), (64, 20))
    n_runs: int = 3
    settings: SearchSettings = field(default=PAPER_SETTINGS)


FULL = Plan()
QUICK = Plan(sizes=((64, 20),), n_runs=2, settings=replace(PAPER_SETTINGS, generations=20))


def measure(plan: Plan) -> list[Row]:
    """Run every engine `n_runs` times at each size, in turns, each run on a table of its own."""
    rows = []
    for n_questions, n_images in plan.sizes:
        seconds: dict[str, list[float]] = {engine: [] for engine in ENGINES}
        for run in range(plan.n_runs):
            rng = np.random.default_rng([n_questions, n_images, run])
            counts = draw_counts(draw_task(rng, n_questions), n_images, rng)
            for engine, times in seconds.items():
                start = time.perf_counter()
                ENGINES[engine](counts, plan.settings, run)
                times.append(time.perf_counter() - start)
        rows += [
            Row(engine, n_questions, n_images, statistics.median(times))
            for engine, times in seconds.items()
        ]
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the table, and write it as JSON if asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.search", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows to FILE")
    parser.add_argument("--quick", action="store_true", help="one size, a tenth of the generations")
    options = parser.parse_args(arguments)
    plan = QUICK if options.quick else FULL
    rows = measure(plan)
    print(table(rows))
    if options.json:
        result = {"settings": asdict(plan.settings), "rows": [asdict(row) for row in rows]}
        options.json.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


def table(rows: Sequence[Row]) -> str:
    """Rows as text, each with how many times faster than textbook DEAP it is."""
    textbook = {(r.n_questions, r.n_images): r.seconds for r in rows if r.engine == "textbook_deap"}
    lines = [f"{'engine':<14} {'questions':>9} {'images':>6} {'seconds':>8} {'times faster':>12}"]
    for row in rows:
        ratio = textbook[row.n_questions, row.n_images] / row.seconds
        lines.append(
            f"{row.engine:<14} {row.n_questions:>9} {row.n_images:>6} {row.seconds:>8.2f} "
            f"{ratio:>12.1f}"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
