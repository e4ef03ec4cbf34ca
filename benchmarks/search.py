"""Time and hit rate of the searches, and their proofs: `python -m benchmarks.search`.

Textbook DEAP, the paper's search as this package runs it, and our default engine look for s+ on
the same synthetic tables, whose optima `benchmarks.prove_optima` has proved. Runs are interleaved,
so that a busy machine slows all; look at the ratio more than at the seconds. Then all four
objectives are proved on some of the largest tables.
"""

import argparse
import json
import random
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from deap import algorithms, base, tools

from benchmarks.prove_optima import OBJECTIVE, Optimum, read_optima
from benchmarks.tables import digest, numbered_table
from vqa_state.answers.rates import Counts
from vqa_state.evaluation.intervals import clopper_pearson
from vqa_state.search.engines.paper import deap_search
from vqa_state.search.engines.restarts import N_RESTARTS, restart_search
from vqa_state.search.genetic import PAPER_SETTINGS, SearchSettings
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective
from vqa_state.search.proof import Badge, ProofLimits, ProofReport, prove_all

__all__ = [
    "ENGINES",
    "Plan",
    "ProofRow",
    "Row",
    "hit_interval",
    "main",
    "measure",
    "measure_proofs",
]

_SAME = 1e-9  # textbook DEAP adds the rates in another order


class _Maximize(base.Fitness):  # type: ignore[misc]  # DEAP ships no types
    weights = (1.0,)


class _Individual(list[int]):
    def __init__(self, genes: Sequence[int]) -> None:
        super().__init__(genes)
        self.fitness = _Maximize()


def textbook_deap(counts: Counts, plan: "Plan", seed: int) -> float:
    """DEAP as its tutorial shows it; the best fitness found."""
    random.seed(seed)  # DEAP draws from the global state
    settings = plan.settings
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


def paper(counts: Counts, plan: "Plan", seed: int) -> float:
    """The same search as this package runs it; the best fitness found."""
    *_, last = deap_search(counts, OBJECTIVE, settings=plan.settings, seed=seed)
    return last.best_fitness


def default(counts: Counts, plan: "Plan", seed: int) -> float:
    """Our engine without the proof; the best fitness found."""
    reports = restart_search(
        counts, OBJECTIVE, settings=plan.settings, n_restarts=plan.n_restarts, seed=seed
    )
    *_, last = reports
    return last.best_fitness


@dataclass(frozen=True, slots=True)
class Plan:
    """What to measure.

    Attributes:
        sizes: (n_questions, n_images) of the tables.
        n_tables: tables of each size; every engine but DEAP runs once on each.
        n_textbook: tables of each size that textbook DEAP runs on, the first ones.
        n_proofs: tables of 64 questions on which all four objectives are proved, the first ones.
        settings: of the genetic algorithm.
        n_restarts: of the default engine.
        limits: of the proofs.
    """

    sizes: tuple[tuple[int, int], ...] = ((16, 20), (32, 20), (64, 20))
    n_tables: int = 20
    n_textbook: int = 4
    n_proofs: int = 5
    settings: SearchSettings = field(default=PAPER_SETTINGS)
    n_restarts: int = N_RESTARTS
    limits: ProofLimits = field(default_factory=ProofLimits)


FULL = Plan()
QUICK = Plan(
    sizes=((64, 20),),
    n_tables=2,
    n_textbook=2,
    n_proofs=1,
    settings=replace(PAPER_SETTINGS, generations=20),
    n_restarts=N_RESTARTS // 10,
)

Engine = Callable[[Counts, Plan, int], float]
ENGINES: dict[str, Engine] = {"textbook_deap": textbook_deap, "paper": paper, "default": default}


@dataclass(frozen=True, slots=True)
class Row:
    """One engine at one size.

    Attributes:
        engine: key of `ENGINES`.
        n_questions: questions to choose from.
        n_images: training images.
        seconds: median time of a run.
        seconds_beside_textbook: the same on the tables that textbook DEAP ran on.
        hit_rate: share of runs on proved tables that reach the optimum; None without such a run.
        n_proved: runs on tables whose optimum is proved.
        n_unproved: runs on tables whose optimum is not; they are in no hit rate.
    """

    engine: str
    n_questions: int
    n_images: int
    seconds: float
    seconds_beside_textbook: float
    hit_rate: float | None
    n_proved: int
    n_unproved: int


@dataclass(frozen=True, slots=True)
class ProofRow:
    """All four objectives proved, two at a time.

    Attributes:
        n_questions: questions to choose from.
        n_images: training images.
        n_tables: tables.
        seconds: median time of a table, for the proofs of all four objectives.
        seconds_most: the longest.
        cpu_seconds: median processor time, which other people's work stretches less.
        images_proved: share of proofs that prove the number of recognized images.
        best_proved: share of proofs that prove the best subset.
        median_gap: median over proofs of bound - E.
        gap_most: the largest.
    """

    n_questions: int
    n_images: int
    n_tables: int
    seconds: float
    seconds_most: float
    cpu_seconds: float
    images_proved: float
    best_proved: float
    median_gap: float
    gap_most: float


def measure(plan: Plan, optima: Sequence[Optimum]) -> Iterator[Row]:
    """Run every engine on the tables of each size, in turns."""
    for size in plan.sizes:
        known = [one for one in optima if (one.n_questions, one.n_images) == size][: plan.n_tables]
        runs: dict[str, list[tuple[float, float]]] = {engine: [] for engine in ENGINES}
        for place, optimum in enumerate(known):
            counts = _table(optimum)
            for name, engine in ENGINES.items():
                if name == "textbook_deap" and place >= plan.n_textbook:
                    continue
                start = time.perf_counter()
                found = engine(counts, plan, optimum.number)
                runs[name].append((time.perf_counter() - start, found))
        yield from (_row(name, known, done, plan) for name, done in runs.items() if done)


def _row(
    name: str, known: Sequence[Optimum], runs: Sequence[tuple[float, float]], plan: Plan
) -> Row:
    seconds = [taken for taken, _ in runs]
    of_proved = [
        found >= one.value - _SAME
        for one, (_, found) in zip(known, runs, strict=False)
        if one.proved
    ]
    return Row(
        engine=name,
        n_questions=known[0].n_questions,
        n_images=known[0].n_images,
        seconds=statistics.median(seconds),
        seconds_beside_textbook=statistics.median(seconds[: plan.n_textbook]),
        hit_rate=statistics.mean(of_proved) if of_proved else None,
        n_proved=len(of_proved),
        n_unproved=len(runs) - len(of_proved),
    )


def _table(optimum: Optimum) -> Counts:
    counts = numbered_table(optimum.n_questions, optimum.n_images, optimum.number)
    if digest(counts) != optimum.digest:
        raise SystemExit(
            f"table {optimum.number} of {optimum.n_questions} questions is not the one whose "
            "optimum is known; this NumPy draws other numbers: run benchmarks.prove_optima again"
        )
    return counts


def measure_proofs(plan: Plan, optima: Sequence[Optimum]) -> ProofRow:
    """Prove all four objectives on the first of the largest tables, from the default engine's."""
    n_questions, n_images = max(plan.sizes)
    largest = [one for one in optima if (one.n_questions, one.n_images) == (n_questions, n_images)]
    times, cpu_times, last = [], [], []
    for optimum in largest[: plan.n_proofs]:
        counts = _table(optimum)
        starts = {objective: _start(counts, objective, plan) for objective in Objective}
        start, cpu = time.perf_counter(), time.process_time()
        *_, reports = prove_all(counts, starts, limits=plan.limits)
        times.append(time.perf_counter() - start)
        cpu_times.append(time.process_time() - cpu)
        last += list(reports.values())
    gaps = [report.gap for report in last]
    return ProofRow(
        n_questions=n_questions,
        n_images=n_images,
        n_tables=len(times),
        seconds=statistics.median(times),
        seconds_most=max(times),
        cpu_seconds=statistics.median(cpu_times),
        images_proved=statistics.mean(map(_images_are_proved, last)),
        best_proved=statistics.mean(report.badge is Badge.BEST for report in last),
        median_gap=statistics.median(gaps),
        gap_most=max(gaps),
    )


def _images_are_proved(report: ProofReport) -> bool:
    return report.terms.n_recognized == report.n_bound


def _start(counts: Counts, objective: Objective, plan: Plan) -> tuple[int, ...]:
    reports = restart_search(
        counts, objective, settings=plan.settings, n_restarts=plan.n_restarts // 4, seed=0
    )
    *_, last = reports
    return last.subset


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the tables, and write them as JSON if asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.search", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows to FILE")
    parser.add_argument(
        "--quick", action="store_true", help="one size, few tables, a tenth of the work"
    )
    options = parser.parse_args(arguments)
    plan, optima = QUICK if options.quick else FULL, read_optima()
    rows = list(measure(plan, optima))
    print(table(rows))
    proof = measure_proofs(plan, optima)
    print(proof_text(proof))
    if options.json:
        result = {
            "settings": asdict(plan.settings),
            "rows": [asdict(row) for row in rows],
            "proof": asdict(proof),
        }
        options.json.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


def table(rows: Sequence[Row]) -> str:
    """Rows as text, each with how many times faster than textbook DEAP it is on its tables."""
    textbook = {(r.n_questions, r.n_images): r.seconds for r in rows if r.engine == "textbook_deap"}
    lines = [
        f"{'engine':<14} {'questions':>9} {'images':>6} {'seconds':>8} {'times faster':>12} "
        f"{'hits':>6} {'95 %':>10} {'proved':>6} {'unproved':>8}"
    ]
    for row in rows:
        ratio = textbook[row.n_questions, row.n_images] / row.seconds_beside_textbook
        hits = "–" if row.hit_rate is None else f"{row.hit_rate:.0%}"
        lines.append(
            f"{row.engine:<14} {row.n_questions:>9} {row.n_images:>6} {row.seconds:>8.2f} "
            f"{ratio:>12.1f} {hits:>6} {hit_interval(row):>10} {row.n_proved:>6} "
            f"{row.n_unproved:>8}"
        )
    return "\n".join(lines)


def hit_interval(row: Row) -> str:
    """The exact 95 % interval of a hit rate, in percent; few tables tell little."""
    if row.hit_rate is None:
        return "–"
    exact = clopper_pearson(round(row.hit_rate * row.n_proved), row.n_proved)
    return f"{100 * exact.low:.0f} to {100 * exact.high:.0f}"


def proof_text(proof: ProofRow) -> str:
    """The proofs in a few lines."""
    return (
        f"proof of four objectives, {proof.n_questions} x {proof.n_images}, "
        f"{proof.n_tables} tables: median {proof.seconds:.1f} s, at most "
        f"{proof.seconds_most:.1f} s ({proof.cpu_seconds:.1f} s of processor)\n"
        f"number of images proved {proof.images_proved:.0%}, "
        f"proved best {proof.best_proved:.0%}, gap in E: "
        f"median {proof.median_gap:.4f}, at most {proof.gap_most:.4f}"
    )


if __name__ == "__main__":
    main()
