"""The best of all subsets, by looking at every one of them.

The sums over a subset are a sum over its questions of the left half and one over those of the
right half, so there are two small tables of sums, and 2^24 subsets are 4096 comparisons of a
table with a column. Only subsets that recognize enough images to win get their rates computed;
only those whose rates come within rounding of the best get the fitness that the genetic search
computes, and that one decides.

Source: paper II-B (objectives); E. Horowitz and S. Sahni, "Computing Partitions with Applications
to the Knapsack Problem", JACM 1974 (two halves).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.search.background_task import StopPoll
from vqa_state.search.fitness import Fitness, Terms
from vqa_state.search.genetic import fittest, require_searchable
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights
from vqa_state.search.question_classes import Integers, QuestionClasses, question_classes

__all__ = ["MAX_SUBSETS", "ExactReport", "can_enumerate", "enumerate_subsets"]

#: All subsets of 24 questions; more questions are fine if enough of them have the same answers.
MAX_SUBSETS = 2**24


@dataclass(frozen=True, slots=True)
class ExactReport:
    """How far the enumeration has come.

    Attributes:
        checked: subsets, different in their answers, that are compared or ruled out; up to `total`.
        total: all of them, the empty one among them.
        subset: the best so far, positions ascending; empty before the first one is found.
        terms: what its fitness is made of; None before the first one is found.
        n_most: the largest number of images that any subset recognizes.
    """

    checked: int
    total: int
    subset: tuple[int, ...]
    terms: Terms | None
    n_most: int

    @property
    def finished(self) -> bool:
        """Whether the best so far is the best of all."""
        return self.checked == self.total


def can_enumerate(counts: Counts, objective: Objective) -> bool:
    """Whether there are few enough subsets to look at each."""
    return question_classes(counts, objective).n_subsets <= MAX_SUBSETS


def enumerate_subsets(
    counts: Counts,
    objective: Objective,
    *,
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[ExactReport]:
    """Find the best subset of all; ties as in the genetic search.

    With 2^24 subsets it takes about 30 MB (up to 255 images; else 50) and 100 kB an image. The
    caller stops by no longer iterating, or with `stop`.

    Yields:
        At least one report; the last is finished unless it was stopped.

    Raises:
        NothingToSearchError: if there are no questions, no images or no images of one state.
        ValueError: if there are more than `MAX_SUBSETS` subsets.
    """
    require_searchable(counts)
    classes = question_classes(counts, objective)
    if classes.n_subsets > MAX_SUBSETS:
        raise ValueError(
            f"{counts.n_questions} questions have {classes.n_subsets} different subsets, more "
            f"than {MAX_SUBSETS}; prove the best with vqa_state.search.proof instead"
        )
    return _Enumeration(counts, classes, objective, weights).run(stop)


@dataclass(slots=True)
class _Half:
    """All subsets of some classes: sums of their questions' answers.

    Attributes:
        numbers: questions of each class, (n_combinations, n_classes).
        margins: (n_images, n_combinations), in the smallest type that holds every sum.
        correct: same shape; float32 where that holds every sum, else float64.
        asked: same shape and type.
        used: questions in the combination, (n_combinations,), same type.
    """

    numbers: Integers
    margins: NDArray[Any]
    correct: NDArray[np.floating[Any]]
    asked: NDArray[np.floating[Any]]
    used: NDArray[np.floating[Any]]


class _Enumeration:
    """One run: the two halves, and the best subset so far."""

    def __init__(
        self,
        counts: Counts,
        classes: QuestionClasses,
        objective: Objective,
        weights: ObjectiveWeights,
    ) -> None:
        self._classes = classes
        self._alpha, self._beta = weights.alpha, objective.kind.signed_beta(weights)
        self._fitness = Fitness(counts, objective, weights)
        self._left, self._right = self._halves()
        # Sums of n float32 rates, each in [0, 1], are off by less than this, on both sides; and
        # with a large alpha, fitness itself is rounded more coarsely.
        self._rounding = 2 * (classes.n_images + 8) * float(np.finfo(np.float32).eps)
        self._rounding += 4 * float(np.spacing(self._alpha + 2))
        self._best: NDArray[np.uint8] | None = None
        self._value = -np.inf
        self._n_most = classes.n_images  # until all is counted

    def run(self, stop: Callable[[], bool]) -> Iterator[ExactReport]:
        """Level by level: first the subsets that recognize most images."""
        n_left, n_right = len(self._left.used), len(self._right.used)
        total, checked, is_stopped = n_left * n_right, 0, StopPoll(stop)
        n_recognized = self._count(is_stopped)
        if n_recognized is None:
            yield self._report(0, total)
            return
        self._n_most = int(n_recognized.max())
        for level in range(self._n_most, -1, -1):
            if self._most(level) < self._value:
                break
            for right in range(n_right):
                if is_stopped():
                    yield self._report(checked, total)
                    return
                wanted = np.flatnonzero(n_recognized[right] == level)
                if wanted.size:
                    self._look_at(wanted, right, level)
                checked += int(wanted.size)
            yield self._report(min(checked, total - 1), total)
        yield self._report(total, total)

    def _report(self, checked: int, total: int) -> ExactReport:
        if self._best is None:
            return ExactReport(checked, total, (), None, self._n_most)
        subset = tuple(np.flatnonzero(self._best).tolist())
        return ExactReport(checked, total, subset, self._fitness.terms(subset), self._n_most)

    def _most(self, n_recognized: int) -> float:
        """No subset that recognizes so many images is better, whatever its other terms."""
        E = self._alpha * n_recognized / self._classes.n_images + 1 + max(self._beta, 0)
        return E + self._rounding

    def _count(self, stop: StopPoll) -> NDArray[np.unsignedinteger[Any]] | None:
        """Recognized images of every subset, (n_right, n_left); None after a stop."""
        n_left, n_right = len(self._left.used), len(self._right.used)
        small: type[np.unsignedinteger[Any]] = np.min_scalar_type(self._classes.n_images).type
        n_recognized = np.empty((n_right, n_left), dtype=small)
        for right in range(n_right):
            if stop():
                return None
            recognized = self._left.margins > -self._right.margins[:, right, np.newaxis]
            np.add.reduce(recognized.view(np.uint8), axis=0, dtype=small, out=n_recognized[right])
        return n_recognized

    def _look_at(self, lefts: NDArray[np.intp], right: int, level: int) -> None:
        """Compare the best with the subsets of one right half and some left ones."""
        left, other = self._left, self._right
        every = 2 * lefts.size > left.used.size  # then picking columns costs more than it saves
        columns = slice(None) if every else lefts
        correct = left.correct[:, columns] + other.correct[:, right, np.newaxis]
        asked = left.asked[:, columns] + other.asked[:, right, np.newaxis]
        R_ave = np.divide(correct, np.maximum(asked, 1)).sum(axis=0) / self._classes.n_images
        used = left.used[columns] + other.used[right]
        if every:
            R_ave, used = R_ave[lefts], used[lefts]
        rest = R_ave + (self._beta / self._classes.n_questions) * used
        rest[used == 0] = -np.inf  # the empty subset is no solution
        above = self._alpha * level / self._classes.n_images
        least = max(self._value - above, float(rest.max())) - self._rounding
        close = np.flatnonzero(rest >= least)
        if close.size and np.isfinite(rest[close]).all():
            self._decide(lefts[close], right)

    def _decide(self, lefts: NDArray[np.intp], right: int) -> None:
        """The fitness to the last bit, and the documented order of ties."""
        individuals = self._vectors(lefts, right)
        if self._best is not None:
            individuals = np.vstack([self._best, individuals])
        values = self._fitness(individuals)
        winner = fittest(individuals, values)
        self._best, self._value = individuals[winner], float(values[winner])

    def _vectors(self, lefts: NDArray[np.intp], right: int) -> NDArray[np.uint8]:
        """Zeros and ones, (n, n_questions): of each class, the last questions."""
        rows = np.broadcast_to(
            self._right.numbers[right], (lefts.size, self._right.numbers.shape[1])
        )
        numbers = np.hstack([self._left.numbers[lefts], rows])
        vectors = np.zeros((lefts.size, self._classes.n_questions), dtype=np.uint8)
        for chosen, members in zip(numbers.T, self._classes.members, strict=True):
            for place, position in enumerate(reversed(members)):
                vectors[:, position] = chosen > place
        return vectors

    def _halves(self) -> tuple[_Half, _Half]:
        """Left and right: the split of the classes that leaves the smaller larger half."""
        options = self._classes.sizes + 1
        cuts = range(len(options) + 1)
        larger = [max(np.prod(options[:cut]), np.prod(options[cut:])) for cut in cuts]
        cut = int(np.argmin(larger))
        return self._half(slice(None, cut)), self._half(slice(cut, None))

    def _half(self, part: slice) -> _Half:
        classes = self._classes
        ranges = [np.arange(size + 1) for size in classes.sizes[part]]
        grids = np.meshgrid(*ranges, indexing="ij")
        n_combinations = int(np.prod([len(r) for r in ranges], dtype=np.int64))
        numbers = np.array([grid.ravel() for grid in grids], dtype=np.int64).reshape(
            len(ranges), n_combinations
        )
        largest = int((np.abs(classes.margins) @ classes.sizes).max())
        small = np.int16 if largest < np.iinfo(np.int16).max else np.int64
        real: Any = np.float32 if int((classes.asked @ classes.sizes).max()) < 2**24 else np.float64
        # Whole numbers held in floats add up exactly, and many times faster.
        floats = numbers.astype(real)
        return _Half(
            numbers=numbers.T,
            margins=(classes.margins[:, part].astype(real) @ floats).astype(small),
            correct=classes.correct[:, part].astype(real) @ floats,
            asked=classes.asked[:, part].astype(real) @ floats,
            used=numbers.sum(axis=0).astype(real),
        )
