"""The fitness of subsets: what a search maximizes.

Source: paper II-B, equations of E+, E'+, E- and E'-.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts, mean_rate, positions, rate
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights

__all__ = ["EMPTY_SUBSET_FITNESS", "Fitness", "Terms"]

EMPTY_SUBSET_FITNESS = -1.0  # not a solution: below every other subset, see ObjectiveWeights

_EXACT_IN_FLOAT32 = 2**24  # whole numbers up to here survive float32

# Products of this many multiplications stay in one thread of OpenBLAS. Larger ones are shared
# out, and on a busy machine the waiting for each other costs several times what it saves.
_ONE_THREAD = 2**18
_SMALLEST_BLOCK = 64  # individuals; below, the calls cost more than the products


@dataclass(frozen=True, slots=True)
class Terms:
    """The terms of one subset's fitness, to show which of them decided.

    Attributes:
        n_recognized: recognized images, by the objective's own (primed or unprimed) rates.
        n_images: images in all.
        R_ave: mean correct rate of the images, in [0, 1], primed if the objective is.
        n_used: questions in the subset.
        n_questions: questions to choose from.
        value: the fitness E.
    """

    n_recognized: int
    n_images: int
    R_ave: float
    n_used: int
    n_questions: int
    value: float


class Fitness:
    """The fitness E of many subsets at once.

        E = alpha * n_recognized / n_images + R_ave ± beta * n_used / n_questions

    The value of a subset depends on the subset alone, to the last bit: not on its place in the
    population, the population's size or the order of the images.

    Raises:
        ValueError: if there are no images or no questions.

    Source: paper II-B.
    """

    def __init__(
        self, counts: Counts, objective: Objective, weights: ObjectiveWeights = PAPER_WEIGHTS
    ) -> None:
        if 0 in counts.correct.shape:
            raise ValueError(f"no fitness without images and questions: {counts.correct.shape}")
        self.n_images, self.n_questions = counts.correct.shape
        self._alpha, self._beta = weights.alpha, objective.kind.signed_beta(weights)
        asked = objective.kind.asked(counts)
        # Matrix products of whole numbers held in floats are exact and use BLAS.
        exact = np.float32 if asked.sum(axis=1).max() < _EXACT_IN_FLOAT32 else np.float64
        self._per_question = np.concatenate([counts.correct, asked]).T.astype(exact)

    def __call__(self, population: NDArray[np.uint8] | NDArray[np.bool_]) -> NDArray[np.float64]:
        """Fitness of each individual.

        Args:
            population: zeros and ones, (n_individuals, n_questions).

        Returns:
            Shape (n_individuals,).
        """
        n_recognized, R_ave = self._rates(population)
        return self._weighted_sum(n_recognized, R_ave, np.count_nonzero(population, axis=1))

    def terms(self, subset: Sequence[int]) -> Terms:
        """The terms behind the fitness of one subset.

        Raises:
            ValueError: if a position is out of range or stands there twice.
        """
        individual = np.zeros((1, self.n_questions), dtype=np.uint8)
        individual[0, positions(subset, self.n_questions)] = 1
        n_recognized, R_ave = self._rates(individual)
        return Terms(
            n_recognized=int(n_recognized[0]),
            n_images=self.n_images,
            R_ave=float(R_ave[0]),
            n_used=len(subset),
            n_questions=self.n_questions,
            value=float(self._weighted_sum(n_recognized, R_ave, np.array([len(subset)]))[0]),
        )

    def _rates(
        self, population: NDArray[np.uint8] | NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Recognized images and mean correct rate, both (n_individuals,)."""
        sums = self._sums(population)
        correct, asked = sums[:, : self.n_images], sums[:, self.n_images :]  # (individuals, images)
        n_recognized = np.count_nonzero(2 * correct > asked, axis=1)
        return n_recognized, mean_rate(rate(correct, asked, undefined=0.0))

    def _sums(self, population: NDArray[np.uint8] | NDArray[np.bool_]) -> NDArray[np.int64]:
        """Correct, then asked, answers of each image, (n_individuals, 2 * n_images)."""
        sums = np.empty((len(population), 2 * self.n_images), dtype=np.int64)
        size = max(_SMALLEST_BLOCK, _ONE_THREAD // self._per_question.size)
        for start in range(0, len(population), size):
            block = slice(start, start + size)
            sums[block] = population[block].astype(self._per_question.dtype) @ self._per_question
        return sums

    def _weighted_sum(
        self, n_recognized: NDArray[np.int64], R_ave: NDArray[np.float64], n_used: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """E itself, (n_individuals,) like its arguments."""
        R_img, R_q = n_recognized / self.n_images, n_used / self.n_questions
        E = self._alpha * R_img + R_ave + self._beta * R_q
        return np.where(n_used == 0, EMPTY_SUBSET_FITNESS, E)
