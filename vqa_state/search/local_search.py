"""Local search: from a subset to one that no change of one or two questions makes better."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.search.fitness import Fitness
from vqa_state.search.objectives import Objective, ObjectiveWeights

__all__ = ["LocalSearch", "Position"]

#: Pairs are tried among so many questions, the best by themselves: 2016 pairs a step.
_IN_PAIRS = 64

#: A gain below this is rounding; a local search on it would never end.
_LEAST_GAIN = 1e-5

#: Sums that are held at once; larger steps are looked at in pieces.
_MAX_CELLS = 4_000_000

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Position:
    """Where a local search stands, or ended.

    Attributes:
        individual: zeros and ones, (n_questions,).
        value: its fitness, rounded like float32.
        n_evaluations: neighbours looked at on the way.
    """

    individual: NDArray[np.uint8]
    value: float
    n_evaluations: int


class LocalSearch:
    """Steepest ascent on E; a step switches one or two questions on or off.

    Sums of answers are kept and changed by what the switched questions add, for all neighbours at
    once; so a step costs about as much as evaluating a generation of the genetic search.
    """

    def __init__(self, counts: Counts, objective: Objective, weights: ObjectiveWeights) -> None:
        self.fitness = Fitness(counts, objective, weights)
        asked = objective.kind.asked(counts)
        used = np.ones((counts.n_questions, 1))
        # One row for each question: correct by image, asked by image, and the question itself.
        self._columns: Floats = np.hstack([counts.correct.T, asked.T, used]).astype(np.float32)
        self._n_images, self._n_questions = counts.n_images, counts.n_questions
        self._alpha, self._beta = weights.alpha, objective.kind.signed_beta(weights)

    @property
    def cells_a_step(self) -> int:
        """Sums that one step looks at: what it costs."""
        n_tried = min(self._n_questions, _IN_PAIRS)
        neighbours = self._n_questions + n_tried * (n_tried - 1) // 2
        return neighbours * (2 * self._n_images + 1)

    def optimum(self, start: NDArray[np.uint8]) -> Position:
        """Take the best step until none helps; of equally good ones the first."""
        *_, end = self.steps(start)
        return end

    def steps(self, start: NDArray[np.uint8]) -> Iterator[Position]:
        """The same, step by step; the caller may leave between two steps.

        Yields:
            The position after each step that helps, then the local optimum.
        """
        individual, n_evaluations = start.copy(), 1
        sums = start.astype(np.float32) @ self._columns
        value = float(self._value(sums[np.newaxis])[0])
        while True:
            signs = np.where(individual, np.float32(-1), np.float32(1))
            single = signs[:, np.newaxis] * self._columns
            steps = self._steps(sums, single)
            values = self._values(steps, sums, single)
            best = int(values.argmax())
            n_evaluations += len(values)
            # Of the gain, not of the sum: a small gain vanishes beside a large value.
            if not values[best] - value >= _LEAST_GAIN:
                yield Position(individual, value, n_evaluations)
                return
            sums, value = sums + _changes(steps[[best]], single)[0], float(values[best])
            individual = individual.copy()
            individual[steps[best]] = 1 - individual[steps[best]]
            yield Position(individual, value, n_evaluations)

    def _values(self, steps: NDArray[np.intp], sums: Floats, single: Floats) -> NDArray[np.float64]:
        """E after each step, (n_steps,)."""
        size = max(1, _MAX_CELLS // sums.size)
        pieces = (steps[at : at + size] for at in range(0, len(steps), size))
        return np.concatenate([self._value(sums + _changes(piece, single)) for piece in pieces])

    def _steps(self, sums: Floats, single: Floats) -> NDArray[np.intp]:
        """Questions that each step switches, (n_steps, 2); one of one question names it twice."""
        alone = np.arange(self._n_questions)
        chosen = alone
        if self._n_questions > _IN_PAIRS:
            values = self._value(sums + single)
            chosen = np.sort(np.argsort(-values, kind="stable")[:_IN_PAIRS])
        first, second = np.triu_indices(chosen.size, 1)
        first, second = chosen[first], chosen[second]
        return np.column_stack([np.r_[alone, first], np.r_[alone, second]])

    def _value(self, sums: Floats) -> NDArray[np.float64]:
        """E of each row of sums."""
        n = self._n_images
        correct, asked, used = sums[:, :n], sums[:, n : 2 * n], sums[:, -1]
        R_img = np.count_nonzero(2 * correct > asked, axis=1) / n
        R_ave = (correct / np.maximum(asked, 1)).sum(axis=1) / n
        E = self._alpha * R_img + R_ave + self._beta * (used / self._n_questions)
        return np.where(used == 0, -1.0, E)


def _changes(steps: NDArray[np.intp], single: Floats) -> Floats:
    """What each step adds to the sums, (n_steps, n_sums), given what each question does."""
    first, second = steps.T
    changes: Floats = single[first]
    changes[first != second] += single[second[first != second]]
    return changes
