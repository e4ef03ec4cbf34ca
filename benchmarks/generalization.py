"""What the recommended vote gains on new images: `python -m benchmarks.generalization`.

On each synthetic task, everything is chosen on 20 training images: the paper's search for s+, every
kind of vote, the out-of-bag estimate, and the recommendation. Then 400 other images say how many of
20 each recognizes. Gains are paired: both on the same images. The bias is an estimate less what the
400 images say of the recommended kind: of the estimate that users are shown, which has the choice
between the kinds inside, and of the kind's own, which they are not shown.

For a coverage of 0.9 and 0.7, the smallest sureness of the recommended kind is learned as for a
recognizer's file. Then the 400 images say how many of them get a verdict, how many of the verdicts
are right, and how often the promised interval of that holds it.

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
from vqa_state.answers.rates import Counts
from vqa_state.answers.table import AnswerTable
from vqa_state.evaluation.coverage import CoveragePoint, choose_point, coverage_curve, single_votes
from vqa_state.evaluation.estimates import Estimate
from vqa_state.evaluation.out_of_bag import N_RESAMPLES, out_of_bag
from vqa_state.questions.grid import Question
from vqa_state.search.genetic import PAPER_SETTINGS, SearchSettings, search
from vqa_state.search.objectives import Objective
from vqa_state.votes.fitting import fit_votes
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import Ballots, FittedVote, VoteKind

__all__ = [
    "Careful",
    "Outcome",
    "Plan",
    "answers",
    "main",
    "measure",
    "run_task",
    "summarize",
    "table",
]

N_TRAIN, N_TEST = 20, 400
SIZES = (16, 32, 64)
COVERAGES = (0.9, 0.7)


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
class Careful:
    """What a wanted coverage gave on the new images; shares in [0, 1].

    Attributes:
        coverage: of the new images with a verdict.
        accuracy: of their verdicts that are right; NaN without a verdict.
        promised: the same, as out-of-bag votes promise it.
        low: lower end of the promised 95 % interval.
        high: its upper end.
    """

    coverage: float
    accuracy: float
    promised: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """One task; shares of recognized images in [0, 1].

    Attributes:
        test: of the new images, of each kind of vote.
        train: of the training images, of each kind.
        recommended: the kind that training images alone recommend.
        estimate: out-of-bag, of the procedure that recommends: the one that users are shown.
        own_estimate: of the recommended kind by itself.
        n_used: questions of each kind.
        careful: of the recommended kind, at each of `COVERAGES`.
    """

    test: Mapping[VoteKind, float]
    train: Mapping[VoteKind, float]
    recommended: VoteKind
    estimate: Estimate
    own_estimate: Estimate
    n_used: Mapping[VoteKind, int]
    careful: tuple[Careful, ...]


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
    kind = result.recommendation.kind
    copies = np.random.default_rng([*b"copies", number])
    sureness, states = single_votes(result, kind, answers(train, copies))
    curve = coverage_curve(sureness, states, train.labels)
    points = [choose_point(curve, coverage) for coverage in COVERAGES]
    new_table = answers(test, copies)
    return Outcome(
        test={k: float((v.decide(new) == test.labels).mean()) for k, v in votes.items()},
        train={k: float((v.decide(seen) == train.labels).mean()) for k, v in votes.items()},
        recommended=kind,
        estimate=result.recommended,
        own_estimate=result.kinds[kind],
        n_used={k: v.n_used for k, v in votes.items()},
        careful=tuple(_careful(votes[kind], point, new_table) for point in points),
    )


def answers(counts: Counts, rng: np.random.Generator) -> AnswerTable:
    """Counted answers spread over the copies in random order, as they were drawn: without shares.

    The copies of `benchmarks.tables` are drawn independently, so any order is as likely.
    """
    positive = counts.labels[:, np.newaxis] > 0
    n_for = np.where(positive, counts.correct, counts.wrong)[:, np.newaxis]
    n_against = np.where(positive, counts.wrong, counts.correct)[:, np.newaxis]
    n_copies = int((counts.correct + counts.wrong + counts.invalid).max())
    place = np.arange(n_copies)[:, np.newaxis]
    said = np.where(place < n_for, 1, np.where(place < n_for + n_against, -1, 0))
    return AnswerTable(
        image_ids=tuple(map(str, range(len(said)))),
        questions=tuple(Question(f"Is it {q}?", yes_means=1) for q in range(said.shape[2])),
        verdicts=rng.permuted(said, axis=1).astype(np.int8),
        p_positive=np.full(said.shape, np.nan, np.float32),
        labels=counts.labels,
    )


def _careful(vote: FittedVote, point: CoveragePoint, new: AnswerTable) -> Careful:
    states = AbstainRule(vote, point.min_sureness).states(new.verdicts)
    n_covered = int(np.count_nonzero(states))
    n_right = int(np.count_nonzero(states == new.labels))
    return Careful(
        coverage=n_covered / new.n_images,
        accuracy=n_right / n_covered if n_covered else float("nan"),
        promised=point.accuracy,
        low=point.interval.low,
        high=point.interval.high,
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
    own_errors = np.array([outcome.own_estimate.share for outcome in outcomes]) - chosen
    held = [e.low <= share <= e.high for e, share in zip(estimates, chosen, strict=True)]
    kinds = list(outcomes[0].test)
    gains = {k: np.array([outcome.test[k] for outcome in outcomes]) - paper for k in kinds}
    return {
        "n_tasks": len(outcomes),
        "s_plus_of_20": 20 * float(paper.mean()),
        "gain_of_20": _mean_of_20(chosen - paper),
        "oob_bias_of_20": 20 * float(errors.mean()),
        "oob_bias_interval_of_20": _mean_of_20(errors),
        "oob_own_bias_interval_of_20": _mean_of_20(own_errors),
        "oob_rmse_of_20": 20 * float(np.sqrt((errors**2).mean())),
        "oob_interval_holds": float(np.mean(held)),
        "coverage": {str(c): _covered(outcomes, place) for place, c in enumerate(COVERAGES)},
        "train_bias_of_20": 20 * float((train - chosen).mean()),
        "kind_gains_of_20": {k.value: _mean_of_20(gain) for k, gain in gains.items()},
        "kind_questions": {k.value: float(np.mean([o.n_used[k] for o in outcomes])) for k in kinds},
        "recommended": {k.value: n for k, n in Counter(o.recommended for o in outcomes).items()},
    }


def _covered(outcomes: Sequence[Outcome], place: int) -> dict[str, Any]:
    """Means over the tasks; the accuracy only over those where any new image got a verdict."""
    own = [outcome.careful[place] for outcome in outcomes]
    some = [one for one in own if one.coverage > 0]
    errors = np.array([one.promised - one.accuracy for one in some])
    return {
        "actual": _mean(np.array([one.coverage for one in own])),
        "accuracy": float(np.mean([one.accuracy for one in some])),
        "accuracy_bias": _mean(errors),
        "accuracy_interval_holds": float(np.mean([o.low <= o.accuracy <= o.high for o in some])),
    }


def _mean_of_20(shares: NDArray[np.float64]) -> dict[str, float]:
    return {name: 20 * value for name, value in _mean(shares).items()}


def _mean(values: NDArray[np.float64]) -> dict[str, float]:
    """With the ends of its 95 % interval, of Student's t."""
    from scipy.stats import t

    mean, n = float(values.mean()), values.size
    half = float(t.ppf(0.975, n - 1) * values.std(ddof=1) / np.sqrt(n)) if n > 1 else float("nan")
    return {"mean": mean, "low": mean - half, "high": mean + half}


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
        line("bias of what is shown", result["oob_bias_interval_of_20"]),
        line("bias, kind's own", result["oob_own_bias_interval_of_20"], "not shown"),
        f"RMSE {result['oob_rmse_of_20']:.2f}; its 95 % interval holds the truth in "
        f"{result['oob_interval_holds']:.0%} of the tasks; training scores promise "
        f"{result['train_bias_of_20']:+.2f} too many",
        "recommended kind, at a wanted coverage, 95 % intervals",
    ]
    for wanted, one in result["coverage"].items():
        actual, bias = one["actual"], one["accuracy_bias"]
        lines.append(
            f"coverage {wanted}: actual coverage {actual['mean']:.3f} [{actual['low']:.3f}, "
            f"{actual['high']:.3f}]; {one['accuracy']:.1%} of the verdicts right, promised "
            f"{100 * bias['mean']:+.1f} [{100 * bias['low']:+.1f}, {100 * bias['high']:+.1f}] "
            f"points too many; the promised interval holds in {one['accuracy_interval_holds']:.0%}"
        )
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
