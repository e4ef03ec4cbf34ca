"""An upper bound on the literal fitness E of all subsets, and better subsets on the way.

OR-tools' CP-SAT knows whole numbers only. So E is multiplied by the number of images and by
`SCALE`, and whatever has to be rounded is rounded up: the model's optimum is at least the true one,
and its bound is valid for E. One worker and a limit in deterministic time: a result repeats.

The mean of `correct / asked` over images is the hard part. Images with the same `asked` answers in
every question share one denominator, so their rates are added first; in the primed objectives that
is all of them. If besides a denominator is the same for every question, it is a multiple of the
number of questions, and for each number the rate is linear; else it is a product.

Source: paper II-B; L. Perron and F. Didier, "CP-SAT", OR-tools.
"""

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vqa_state.answers.rates import Counts
from vqa_state.search.background_task import BackgroundTask, time_limit
from vqa_state.search.fitness import Fitness
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights
from vqa_state.search.question_classes import Integers, QuestionClasses, question_classes

if TYPE_CHECKING:
    from ortools.sat.python import cp_model

__all__ = ["CLOSED", "SCALE", "ValueReport", "best_value", "images_come_first"]

#: A gap in E that is none: rates are rounded up.
CLOSED = 1e-5

#: Steps into which a rate is divided.
SCALE = 1_000_000

# Terms of the largest model: 1000 questions on 80 images. A larger one takes minutes to build and
# to simplify, before the solver's own limit counts, and then its bound hardly falls.
_MOST_CELLS = 2_500_000

# CP-SAT could turn in circles that count little of its own time (see its parameters below). Should
# it again, the clock ends it: seconds, many times what any table without circles took.
_BACKSTOP = 120.0


@dataclass(frozen=True, slots=True)
class ValueReport:
    """What is known about the largest fitness.

    Attributes:
        value: fitness of `subset`.
        bound: no subset has more; it never rises.
        subset: positions of its questions, ascending.
        stopped: whether the caller stopped before the end.
    """

    value: float
    bound: float
    subset: tuple[int, ...]
    stopped: bool = False


def images_come_first(n_images: int, weights: ObjectiveWeights) -> bool:
    """Whether one more recognized image outweighs all the rest of E.

    With the paper's weights that is so up to 90 images.
    """
    return weights.alpha / n_images > 1 + weights.beta


def best_value(
    counts: Counts,
    objective: Objective,
    subset: Sequence[int],
    *,
    n_recognized: tuple[int, int],
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    deterministic_time: float,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[ValueReport]:
    """Bound the fitness of all subsets from above, and improve on `subset` where possible.

    Args:
        counts: the training images' answers.
        objective: what to maximize.
        subset: where to start; not empty.
        n_recognized: images that some subset is known to recognize, and the most that any can.
        weights: weights of the objective's terms.
        deterministic_time: the solver's limit, in its own units: about a second each. Tables of
            more than 64 questions and 20 images also have a limit of a minute.
        stop: asked several times a second.

    Yields:
        The start, then whenever the best or the bound got better. Of tables whose model would be
        too large to build, the start alone, with the bound that `n_recognized` gives.
    """
    classes = question_classes(counts, objective)
    fitness = Fitness(counts, objective, weights)
    signed_beta = objective.kind.signed_beta(weights)
    cap = weights.alpha * n_recognized[1] / counts.n_images + 1 + max(signed_beta, 0)
    best = tuple(sorted(subset))
    report = ValueReport(fitness.terms(best).value, cap, best)
    yield report
    if _cells(classes) > _MOST_CELLS:
        return

    def build(stop: Callable[[], bool]) -> _Model:
        model = _Model(classes, weights.alpha, signed_beta, stop)
        model.limit_images(n_recognized, images_come_first(counts.n_images, weights))
        model.start_from(best)
        return model

    seconds = min(time_limit(counts.n_images, counts.n_questions), _BACKSTOP)
    solver = _Solver(build, deterministic_time, seconds)
    work = BackgroundTask(solver.run, stop, solver.interrupt)
    with closing(iter(work)) as told:
        for news in told:
            better = _take_in(report, news, fitness)
            if better != report:
                report = better
                yield report
            if report.bound - report.value <= CLOSED:
                break
    if work.stopped:
        yield ValueReport(report.value, report.bound, report.subset, stopped=True)


@dataclass(frozen=True, slots=True)
class _News:
    """A lower bound or a subset from the solver."""

    bound: float = math.inf
    subset: tuple[int, ...] = ()


def _take_in(report: ValueReport, news: _News, fitness: Fitness) -> ValueReport:
    value, subset = report.value, report.subset
    if news.subset:
        found = fitness.terms(news.subset).value
        if found > value:
            value, subset = found, news.subset
    # The solver may prove a bound below the start, which it was told, by its rounding alone.
    return ValueReport(value, max(value, min(report.bound, news.bound)), subset)


def _cells(classes: QuestionClasses) -> int:
    """Terms of the model, roughly: of each image's vote, of the cases, and of the rates."""
    rates = _same_rows(classes.asked)
    n_linear = sum(_is_even(classes.asked[images[0]]) for images in rates)
    n_rows = 2 * classes.n_images + classes.n_questions * (1 + n_linear) + 4 * len(rates)
    return n_rows * len(classes.members)


class _StoppedError(Exception):
    """The model is not wanted any more."""


class _Model:
    """E in whole numbers.

    Building a large one takes seconds, so `stop` is asked at every image and case.

    Raises:
        _StoppedError: if `stop` says so.
    """

    def __init__(
        self,
        classes: QuestionClasses,
        alpha: float,
        signed_beta: float,
        stop: Callable[[], bool],
    ) -> None:
        from ortools.sat.python import cp_model

        self._stop = stop
        self.cp = cp_model.CpModel()
        self.classes = classes
        self.unit = classes.n_images * SCALE
        sizes = classes.sizes.tolist()
        self.chosen = [self.cp.new_int_var(0, size, f"s{c}") for c, size in enumerate(sizes)]
        self.used = self.cp.new_int_var(1, classes.n_questions, "used")
        self.cp.add(self.used == sum(self.chosen))
        self._hints: list[tuple[cp_model.IntVar, Callable[[Integers], int]]] = []
        self.recognized = [self._recognized(image) for image in range(classes.n_images)]
        self._cases = [self._case(number) for number in range(1, classes.n_questions + 1)]
        self.cp.add_exactly_one(self._cases)
        rates = [self._rate(images) for images in _same_rows(classes.asked)]
        self._limit_rates(cp_model.LinearExpr.sum(rates))
        self.cp.maximize(
            math.ceil(alpha * SCALE) * sum(self.recognized)
            + sum(rates)
            + math.ceil(signed_beta * self.unit / classes.n_questions) * self.used
        )

    def limit_images(self, known: tuple[int, int], come_first: bool) -> None:
        """No subset recognizes more than known[1]; and none with less than known[0] can be best."""
        total = sum(self.recognized)
        self.cp.add(total <= known[1])
        if come_first:
            self.cp.add(total >= known[0])

    def start_from(self, subset: Sequence[int]) -> None:
        """Tell the solver a solution in full."""
        numbers = self.classes.numbers(subset)
        for variable, number in zip(self.chosen, numbers.tolist(), strict=True):
            self.cp.add_hint(variable, number)
        self.cp.add_hint(self.used, int(numbers.sum()))
        margins = self.classes.margins @ numbers
        for literal, margin in zip(self.recognized, margins.tolist(), strict=True):
            self.cp.add_hint(literal, margin > 0)
        for variable, value in self._hints:
            self.cp.add_hint(variable, value(numbers))

    def _sum(self, answers: Integers) -> Any:  # an expression, or a number if no answer counts
        """Answers of the chosen questions, given those of each class, (n_classes,)."""
        from ortools.sat.python import cp_model

        return cp_model.LinearExpr.weighted_sum(self.chosen, answers.tolist())

    def _go_on(self) -> None:
        if self._stop():
            raise _StoppedError

    def _recognized(self, image: int) -> "cp_model.IntVar":
        self._go_on()
        recognized = self.cp.new_bool_var(f"y{image}")
        margin = self._sum(self.classes.margins[image])
        self.cp.add(margin >= 1).only_enforce_if(recognized)
        self.cp.add(margin <= 0).only_enforce_if(~recognized)
        return recognized

    def _rate(self, images: Integers) -> "cp_model.IntVar":
        """The rates of images with one denominator, added; at least SCALE times what they are."""
        from ortools.sat.python import cp_model

        self._go_on()
        correct = self.classes.correct[images].sum(axis=0)
        asked = self.classes.asked[images[0]]
        rate = self.cp.new_int_var(0, len(images) * SCALE, f"r{images[0]}")
        half = SCALE // 2 + 1
        # An unrecognized image has a rate of at most one half: cheap, and it helps the solver.
        theirs = [self.recognized[image] for image in images.tolist()]
        above = cp_model.LinearExpr.weighted_sum([rate, *theirs], [1] + [-half] * len(theirs))
        self.cp.add(above <= half * len(theirs))
        self._hints.append((rate, lambda numbers: _ratio(correct, asked, numbers)))
        if _is_even(asked):
            self._linear_rate(rate, correct, int(asked[0]))
        else:
            self._product_rate(rate, correct, asked)
        return rate

    def _product_rate(self, rate: "cp_model.IntVar", correct: Integers, asked: Integers) -> None:
        most = int(asked @ self.classes.sizes)
        denominator = self.cp.new_int_var(0, most, "")
        self.cp.add(denominator == self._sum(asked))
        product = self.cp.new_int_var(0, 2 * SCALE * self.classes.n_images * most, "")
        self.cp.add_multiplication_equality(product, [rate, denominator])
        self.cp.add(product <= SCALE * self._sum(correct) + denominator)
        self.cp.add(rate <= SCALE * self._sum(correct))  # 0/0 is 0
        self._hints.append((denominator, lambda numbers: int(asked @ numbers)))
        self._hints.append((product, lambda n: int(asked @ n) * _ratio(correct, asked, n)))

    def _case(self, number: int) -> "cp_model.IntVar":
        """Whether so many questions are used."""
        case = self.cp.new_bool_var(f"used{number}")
        self.cp.add(self.used == number).only_enforce_if(case)
        self._hints.append((case, lambda numbers: int(numbers.sum() == number)))
        return case

    def _linear_rate(self, rate: "cp_model.IntVar", correct: Integers, asked: int) -> None:
        """The denominator is `asked` times the number of questions: a case for each number."""
        total = self._sum(correct)
        for number, case in enumerate(self._cases, start=1):
            self._go_on()
            denominator = asked * number
            self.cp.add(denominator * rate <= SCALE * total + denominator - 1).only_enforce_if(case)

    def _limit_rates(self, rates: "cp_model.LinearExprT") -> None:
        """What follows for the sum of all rates from the number of questions.

        An image's rate is 1 - wrong / asked, and `asked` is at most what the questions that are
        asked most have together. That is linear, and close if few answers are Invalid.
        """
        classes = self.classes
        wrong = classes.asked - classes.correct
        repeated = np.repeat(classes.asked, classes.sizes, axis=1)
        most_asked = np.cumsum(np.sort(repeated, axis=1)[:, ::-1], axis=1)
        for number, case in enumerate(self._cases, start=1):
            self._go_on()
            weight = SCALE // np.maximum(most_asked[:, number - 1], 1)
            loss = weight @ wrong
            least = int(np.sort(np.repeat(loss, classes.sizes))[:number].sum())
            room = classes.n_images * (SCALE + 1)
            self.cp.add(rates <= room - self._sum(loss)).only_enforce_if(case)
            self.cp.add(rates <= room - least).only_enforce_if(case)


def _is_even(asked: Integers) -> bool:
    """Whether all questions have the same denominator, so that their number alone counts."""
    return bool((asked == asked[0]).all() and asked[0])


def _ratio(correct: Integers, asked: Integers, numbers: Integers) -> int:
    """SCALE times the rate of so many questions of each class, rounded up; 0 for 0/0."""
    part, whole = int(correct @ numbers), int(asked @ numbers)
    return -(-SCALE * part // whole) if whole else 0


def _same_rows(asked: Integers) -> list[Integers]:
    """Images with equal rows, as arrays of positions."""
    _, row = np.unique(asked, axis=0, return_inverse=True)
    return [np.flatnonzero(row == one) for one in range(int(row.max()) + 1)]


class _Solver:
    """One run of CP-SAT that tells its bound and its solutions as it finds them.

    Args:
        build: makes the model; gets what to ask for a stop.
        deterministic_time: the limit.
        seconds: another one, that of large tables; else infinite.
    """

    def __init__(
        self,
        build: Callable[[Callable[[], bool]], _Model],
        deterministic_time: float,
        seconds: float,
    ) -> None:
        from ortools.sat.python import cp_model

        self._build, self._closing = build, threading.Event()
        self._solver = cp_model.CpSolver()
        parameters = self._solver.parameters
        parameters.num_workers = 1
        parameters.random_seed = 0
        parameters.max_deterministic_time = deterministic_time
        parameters.max_time_in_seconds = seconds
        parameters.linearization_level = 2
        # Its search around the start, and one that follows the relaxation up, can go round without
        # end among rates that differ by a millionth; closing in on the bound from above cannot.
        parameters.hint_conflict_limit = 0
        parameters.use_objective_lb_search = True

    def run(self, put: Callable[[_News], None]) -> None:
        from ortools.sat.python import cp_model

        try:
            model = self._build(self._closing.is_set)
        except _StoppedError:
            return

        class Solutions(cp_model.CpSolverSolutionCallback):
            def on_solution_callback(self) -> None:
                numbers = [self.value(chosen) for chosen in model.chosen]
                put(_News(subset=model.classes.subset(numbers)))

        # The model's objective is rounded up, so its bound is one for E.
        self._solver.best_bound_callback = lambda bound: put(_News(bound=bound / model.unit))
        status = self._solver.solve(model.cp, Solutions())
        if status == cp_model.OPTIMAL:
            put(_News(bound=self._solver.best_objective_bound / model.unit))

    def interrupt(self) -> None:
        self._closing.set()
        self._solver.stop_search()
