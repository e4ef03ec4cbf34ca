"""Prove the optima that `benchmarks.search` compares with: `python -m benchmarks.prove_optima`.

Takes up to an hour and writes `optima.json` beside this file; a table whose proof does not end
within its limit is kept with its bound and counted as not proved. The limit is in deterministic
time, so the file repeats.
"""

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

from benchmarks.tables import digest, numbered_table
from vqa_state.search.engines.restarts import restart_search
from vqa_state.search.objectives import Objective
from vqa_state.search.proof import PROOF_TOLERANCE, Badge, ProofLimits, prove

__all__ = ["OPTIMA_FILE", "Optimum", "main", "read_optima"]

OPTIMA_FILE = Path(__file__).with_name("optima.json")
OBJECTIVE = Objective.S_PLUS
SIZES = ((16, 20), (32, 20), (64, 20))
#: Lower numbers served to tune the default engine.
NUMBERS = range(100, 120)
LIMITS = ProofLimits(deterministic_time=60)
SEED = 1_000_000  # of no run of the benchmark


@dataclass(frozen=True, slots=True)
class Optimum:
    """The best fitness s+ on one table.

    Attributes:
        n_questions: questions to choose from.
        n_images: training images.
        number: of the table, see `numbered_table`.
        digest: of the table's answers.
        value: largest fitness that was found.
        bound: no subset has more.
        proved: whether the two agree within `PROOF_TOLERANCE`.
        subset: positions of the best subset's questions.
    """

    n_questions: int
    n_images: int
    number: int
    digest: str
    value: float
    bound: float
    proved: bool
    subset: tuple[int, ...]


def read_optima(path: Path = OPTIMA_FILE) -> list[Optimum]:
    """The committed optima."""
    content = json.loads(path.read_text(encoding="utf-8"))
    return [Optimum(**one | {"subset": tuple(one["subset"])}) for one in content["optima"]]


def prove_table(n_questions: int, n_images: int, number: int) -> Optimum:
    counts = numbered_table(n_questions, n_images, number)
    *_, found = restart_search(counts, OBJECTIVE, seed=SEED)
    *_, last = prove(counts, OBJECTIVE, found.subset, limits=LIMITS)
    return Optimum(
        n_questions=n_questions,
        n_images=n_images,
        number=number,
        digest=digest(counts),
        value=last.terms.value,
        bound=last.bound,
        proved=last.badge is Badge.BEST,
        subset=last.subset,
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Prove all tables and write the file."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.prove_optima", description=__doc__)
    parser.add_argument("--json", type=Path, default=OPTIMA_FILE, metavar="FILE")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args(arguments)
    tables = [(*size, number) for size in SIZES for number in NUMBERS]
    optima = []
    with ProcessPoolExecutor(options.processes, mp_context=get_context("spawn")) as pool:
        for optimum in pool.map(prove_table, *zip(*tables, strict=True)):
            optima.append(optimum)
            print(optimum, flush=True)
            content = {
                "objective": OBJECTIVE.value,
                "tolerance": PROOF_TOLERANCE,
                "deterministic_time": LIMITS.deterministic_time,
                "optima": [asdict(one) for one in optima],
            }
            options.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
