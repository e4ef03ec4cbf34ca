"""Climbing from a subset to one that no change of one or two questions makes better."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.scores import Counts, Objective, ObjectiveWeights

__all__ = ["Climber", "Summit"]

#: Pairs are tried among so many questions, the best by themselves: 2016 pairs a step.
_IN_PAIRS = 64

#: A gain below this is rounding; a climb on it would never end.
_LEAST_GAIN = 1e-5

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Summit:
    """Where a climb ended.

    Attributes:
        individual: zeros and ones, (n_questions,).
        value: its fitness, rounded like float32.
        n_evaluations: neighbours looked at on the way.
    """

    individual: NDArray[np.uint8]
    value: float
    n_evaluations: int


class Climber:
    """Steepest ascent on E; a step switches one or two questions on or off.

    Sums of answers are kept and changed by what the switched questions add, for all neighbours at
    once; so a step costs about as much as evaluating a generation of the genetic search.
    """

    def __init__(self, counts: Counts, objective: Objective, weights: ObjectiveWeights) -> None:
        asked = counts.correct + counts.wrong + (counts.invalid if objective.primed else 0)
        used = np.ones((counts.n_questions, 1))
        # One row for each question: correct by image, asked by image, and the question itself.
        self._columns: Floats = np.hstack([counts.correct.T, asked.T, used]).astype(np.float32)
        self._n_images, self._n_questions = counts.n_images, counts.n_questions
        self._alpha, self._beta = weights.alpha, objective.beta_sign * weights.beta

    def climb(self, start: NDArray[np.uint8]) -> Summit:
        """Take the best step until none helps; of equally good ones the first."""
        individual, n_evaluations = start.copy(), 1
        sums = start.astype(np.float32) @ self._columns
        value = float(self._value(sums[np.newaxis])[0])
        while True:
            signs = np.where(individual, np.float32(-1), np.float32(1))
            steps, changes = self._steps(sums, signs[:, np.newaxis] * self._columns)
            neighbours = sums + changes
            values = self._value(neighbours)
            best = int(values.argmax())
            n_evaluations += len(values)
            if values[best] < value + _LEAST_GAIN:
                return Summit(individual, value, n_evaluations)
            for question in {*steps[best].tolist()}:
                individual[question] ^= 1
            sums, value = neighbours[best].copy(), float(values[best])

    def _steps(self, sums: Floats, single: Floats) -> tuple[NDArray[np.intp], Floats]:
        """Questions that each step switches, (n_steps, 2), and the change of the sums.

        A step of one question names it twice.
        """
        alone = np.arange(self._n_questions)
        chosen = alone
        if self._n_questions > _IN_PAIRS:
            values = self._value(sums + single)
            chosen = np.sort(np.argsort(-values, kind="stable")[:_IN_PAIRS])
        first, second = np.triu_indices(chosen.size, 1)
        first, second = chosen[first], chosen[second]
        steps = np.column_stack([np.r_[alone, first], np.r_[alone, second]])
        return steps, np.vstack([single, single[first] + single[second]])

    def _value(self, sums: Floats) -> NDArray[np.float64]:
        """E of each row of sums."""
        n = self._n_images
        correct, asked, used = sums[:, :n], sums[:, n : 2 * n], sums[:, -1]
        R_img = np.count_nonzero(2 * correct > asked, axis=1) / n
        R_ave = (correct / np.maximum(asked, 1)).sum(axis=1) / n
        E = self._alpha * R_img + R_ave + self._beta * (used / self._n_questions)
        return np.where(used == 0, -1.0, E)
