"""All subsets, MILP and CP-SAT against brute force on random small tables.

`python -m benchmarks.agreement --tables 1000` checks a thousand and prints what disagrees.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vqa_state.answers.rates import Counts
from vqa_state.search.cpsat import best_value
from vqa_state.search.exact import enumerate_subsets
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import fittest
from vqa_state.search.milp import most_images
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.search.proof import PROOF_TOLERANCE

__all__ = ["Case", "disagreements", "draw_case", "main"]

MOST_QUESTIONS = 14
WEIGHTS = (
    ObjectiveWeights(),
    ObjectiveWeights(alpha=100, beta=0),
    ObjectiveWeights(alpha=0, beta=0.5),
    ObjectiveWeights(alpha=1, beta=0.9),
    ObjectiveWeights(alpha=2.75, beta=1 / 3),
)


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A random table and what to maximize on it."""

    counts: Counts
    objective: Objective
    weights: ObjectiveWeights


def draw_case(seed: int, most_questions: int = MOST_QUESTIONS) -> Case:
    """Few images and copies, so that ties, 0/0 and equal questions are frequent."""
    rng = np.random.default_rng(seed)
    n_questions, n_images = rng.integers(1, most_questions + 1), rng.integers(2, 10)
    n_copies = int(rng.choice([1, 2, 6]))
    p_correct = rng.beta(0.7, 0.7, (n_images, n_questions))
    p_invalid = rng.choice([0.0, 0.2, 0.8], p=[0.4, 0.4, 0.2]) * rng.random((n_images, 1))
    invalid = rng.binomial(n_copies, np.broadcast_to(p_invalid, p_correct.shape))
    invalid[rng.random(n_images) < 0.1] = n_copies  # nobody answers about these images
    correct = rng.binomial(n_copies - invalid, p_correct)
    labels = np.where(np.arange(n_images) % 2, 1, -1).astype(np.int8)
    counts = Counts(correct, n_copies - invalid - correct, invalid, labels)
    objective = list(Objective)[int(rng.integers(len(Objective)))]
    return Case(counts, objective, WEIGHTS[int(rng.integers(len(WEIGHTS)))])


def disagreements(case: Case) -> Iterator[str]:
    """What one of the three ways says that brute force does not; nothing if all agree."""
    counts, objective, weights = case.counts, case.objective, case.weights
    every = np.array(list(np.ndindex(*[2] * counts.n_questions)), dtype=np.uint8)
    fitness = Fitness(counts, objective, weights)
    values = fitness(every)
    winner = fittest(every, values)
    best = tuple(np.flatnonzero(every[winner]).tolist())
    asked = objective.kind.asked(counts)
    most = int((every @ (2 * counts.correct - asked).T > 0).sum(axis=1).max())

    *_, exact = enumerate_subsets(counts, objective, weights=weights)
    if not exact.finished or exact.subset != best or exact.n_most != most:
        yield f"all subsets: {exact}, brute force: {best} with {values[winner]}, {most} images"
    start = (counts.n_questions - 1,)
    *_, images = most_images(counts, objective, start)
    if not images.proved or images.bound != most:
        yield f"MILP: {images}, brute force: {most} images"
    *_, last = best_value(
        counts,
        objective,
        start,
        n_recognized=(images.n_recognized, images.bound),
        weights=weights,
        deterministic_time=20,
    )
    if last.bound < values[winner]:
        yield f"CP-SAT's bound {last.bound} is below the optimum {values[winner]}"
    if last.bound - last.value > PROOF_TOLERANCE or values[winner] - last.value > PROOF_TOLERANCE:
        yield f"CP-SAT: {last}, brute force: {best} with {values[winner]}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Check so many random tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.agreement", description=__doc__)
    parser.add_argument("--tables", type=int, default=1000)
    options = parser.parse_args(arguments)
    wrong = 0
    for seed in range(options.tables):
        for difference in disagreements(draw_case(seed)):
            wrong += 1
            print(f"table {seed}: {difference}")
    print(f"{options.tables} random tables up to {MOST_QUESTIONS} questions: {wrong} disagreements")
    if wrong:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
