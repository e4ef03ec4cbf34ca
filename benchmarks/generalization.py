"""What the recommended vote gains on new images: `python -m benchmarks.generalization`.

On each synthetic task, everything is chosen on 20 training images: the paper's search for s+, every
kind of vote, the out-of-bag estimate, and the recommendation. Then 400 other images say how many of
20 each recognizes. Gains are paired: both on the same images. The bias is the out-of-bag estimate
less what the 400 images say, of the procedure that takes the recommended kind.

The tables give no probabilities, so the vote by p_yes is not measured here.
"""

import argparse
import json
import multiprocessing
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.tables import draw_counts, draw_task
from vqa_state.out_of_bag import N_RESAMPLES, out_of_bag
from vqa_state.scores import Objective
from vqa_state.search.genetic import PAPER_SETTINGS, SearchSettings, search
from vqa_state.voting.estimates import Estimate
from vqa_state.voting.fitting import fit_votes
from vqa_state.voting.kinds import Ballots, VoteKind

__all__ = ["Outcome", "Plan", "main", "measure", "run_task", "summarize", "table"]

N_TRAIN, N_TEST = 20, 400
SIZES = (16, 32, 64)


@dataclass(frozen=True, slots=True)
class Plan:
    """How many tasks, their sizes in turns, and how hard each one is worked on."""

    n_tasks: int = 240
    n_resamples: int = N_RESAMPLES
    settings: SearchSettings = PAPER_SETTINGS
    n_processes: int = 2


FULL = Plan()
QUICK = Plan(n_tasks=12, n_resamples=6, settings=SearchSettings(population=100, generations=20))


@dataclass(frozen=True, slots=True)
class Outcome:
    """One task; shares of recognized images in [0, 1].

    Attributes:
        test: of the new images, of each kind of vote.
        train: of the training images, of each kind.
        recommended: the kind that training images alone recommend.
        estimate: out-of-bag, of the procedure that recommends.
        n_used: questions of each kind.
    """

    test: Mapping[VoteKind, float]
    train: Mapping[VoteKind, float]
    recommended: VoteKind
    estimate: Estimate
    n_used: Mapping[VoteKind, int]


def run_task(number: int, plan: Plan) -> Outcome:
    """One task from its number alone."""
    rng = np.random.default_rng([*b"generalization", number])
    task = draw_task(rng, SIZES[number % len(SIZES)])
    train, test = draw_counts(task, N_TRAIN, rng), draw_counts(task, N_TEST, rng)
    seen, new = Ballots.of_counts(train), Ballots.of_counts(test)
    *_, last = search(train, Objective.S_PLUS, settings=plan.settings, seed=number)
    votes = fit_votes(seen, train.labels, last.subset)
    estimates = out_of_bag(seen, train.labels, seed=number, n_resamples=plan.n_resamples)
    *_, done = estimates
    result = done.result()
    return Outcome(
        test={k: float((v.decide(new) == test.labels).mean()) for k, v in votes.items()},
        train={k: float((v.decide(seen) == train.labels).mean()) for k, v in votes.items()},
        recommended=result.recommendation.kind,
        estimate=result.recommended,
        n_used={k: v.n_used for k, v in votes.items()},
    )


def measure(plan: Plan) -> Iterator[Outcome]:
    """All tasks, in order, on several processes."""
    jobs = [(number, plan) for number in range(plan.n_tasks)]
    with multiprocessing.get_context("spawn").Pool(plan.n_processes) as pool:
        yield from pool.imap(_run, jobs)


def _run(job: tuple[int, Plan]) -> Outcome:
    return run_task(*job)


def summarize(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The figures for the JSON file, in images of 20; intervals are paired, 95 %."""
    paper = np.array([outcome.test[VoteKind.PAPER] for outcome in outcomes])
    chosen = np.array([outcome.test[outcome.recommended] for outcome in outcomes])
    train = np.array([outcome.train[outcome.recommended] for outcome in outcomes])
    estimates = [outcome.estimate for outcome in outcomes]
    errors = np.array([one.share for one in estimates]) - chosen
    held = [e.low <= share <= e.high for e, share in zip(estimates, chosen, strict=True)]
    kinds = list(outcomes[0].test)
    gains = {k: np.array([outcome.test[k] for outcome in outcomes]) - paper for k in kinds}
    return {
        "n_tasks": len(outcomes),
        "s_plus_of_20": 20 * float(paper.mean()),
        "gain_of_20": _mean_of_20(chosen - paper),
        "oob_bias_of_20": 20 * float(errors.mean()),
        "oob_bias_interval_of_20": _mean_of_20(errors),
        "oob_rmse_of_20": 20 * float(np.sqrt((errors**2).mean())),
        "oob_interval_holds": float(np.mean(held)),
        "train_bias_of_20": 20 * float((train - chosen).mean()),
        "kind_gains_of_20": {k.value: _mean_of_20(gain) for k, gain in gains.items()},
        "kind_questions": {k.value: float(np.mean([o.n_used[k] for o in outcomes])) for k in kinds},
        "recommended": {k.value: n for k, n in Counter(o.recommended for o in outcomes).items()},
    }


def _mean_of_20(shares: NDArray[np.float64]) -> dict[str, float]:
    from scipy.stats import t

    mean, n = float(shares.mean()), shares.size
    half = float(t.ppf(0.975, n - 1) * shares.std(ddof=1) / np.sqrt(n)) if n > 1 else float("nan")
    return {"mean": 20 * mean, "low": 20 * (mean - half), "high": 20 * (mean + half)}


def table(result: Mapping[str, Any]) -> str:
    """The figures as text."""

    def line(name: str, gain: Mapping[str, float], note: str = "") -> str:
        interval = f"[{gain['low']:+.2f}, {gain['high']:+.2f}]"
        return f"{name:<22} {gain['mean']:>+6.2f} {interval:<16} {note}"

    lines = [
        f"{result['n_tasks']} tasks; s+ with the paper's vote recognizes "
        f"{result['s_plus_of_20']:.2f} of 20 new images",
        "gain over it, images of 20, paired 95 % interval",
    ]
    for kind, gain in result["kind_gains_of_20"].items():
        note = f"{result['kind_questions'][kind]:.0f} questions"
        times = result["recommended"].get(kind, 0)
        lines.append(line(kind, gain, f"{note}, recommended {times} times"))
    lines += [
        line("recommended", result["gain_of_20"]),
        line("out-of-bag bias", result["oob_bias_interval_of_20"]),
        f"RMSE {result['oob_rmse_of_20']:.2f}; its 95 % interval holds the truth in "
        f"{result['oob_interval_holds']:.0%} of the tasks; training scores promise "
        f"{result['train_bias_of_20']:+.2f} too many",
    ]
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the comparison, and write it as JSON if asked to."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.generalization",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to FILE")
    parser.add_argument("--quick", action="store_true", help="few tasks and resamples; no evidence")
    options = parser.parse_args(arguments)
    began = time.perf_counter()
    result = summarize(list(measure(QUICK if options.quick else FULL)))
    result["seconds"] = round(time.perf_counter() - began, 1)
    print(table(result))
    if options.json:
        options.json.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
