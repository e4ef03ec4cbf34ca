"""The largest number of images that any subset recognizes, as a mixed-integer linear program.

    maximize    sum of y_i
    subject to  sum over classes q of margin_iq s_q >= 1 - M_i (1 - y_i)   for each image i
                sum of s_q >= 1

with s_q the chosen questions of class q, y_i whether image i is recognized, and M_i one more than
all negative margins of image i together. Solved by HiGHS through SciPy, whose copy of it can live
in one process with OR-tools; limits are in nodes, so a result repeats.

Source: paper II-B, term (a); Q. Huangfu and J. A. J. Hall, "Parallelizing the dual revised simplex
method", Math. Prog. Comp. 2018 (HiGHS).
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from vqa_state.answers.rates import Counts
from vqa_state.search.background_task import BackgroundTask, time_limit
from vqa_state.search.objectives import Objective
from vqa_state.search.question_classes import QuestionClasses, question_classes

if TYPE_CHECKING:
    from scipy.optimize import LinearConstraint, OptimizeResult

__all__ = ["NODE_LIMITS", "ImagesReport", "most_images"]

#: Nodes of one solver run after another; each starts anew, so the bound is seen falling.
NODE_LIMITS = (1, 200, 2000)

#: A bound of 18.9999999 from the solver's floats means 19, and one of 18.5 means 18.
_ROUNDING = 1e-4


@dataclass(frozen=True, slots=True)
class ImagesReport:
    """What is known about the largest number of recognized images.

    Attributes:
        n_recognized: images that `subset` recognizes, by the objective's own rates.
        bound: no subset recognizes more; it never rises.
        subset: positions of its questions, ascending.
        stopped: whether the caller stopped before the end.
    """

    n_recognized: int
    bound: int
    subset: tuple[int, ...]
    stopped: bool = False

    @property
    def proved(self) -> bool:
        """Whether no subset recognizes more images."""
        return self.n_recognized == self.bound


def most_images(
    counts: Counts,
    objective: Objective,
    subset: Sequence[int],
    *,
    node_limits: Sequence[int] = NODE_LIMITS,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[ImagesReport]:
    """Prove that no subset recognizes more images than `subset`, or find one that does.

    A stop is heard within a fraction of a second; the solver's thread may go on unheard to the end
    of its node limit. Tables of more than 64 questions and 20 images also have a limit in seconds
    for all runs together, because there a single node may take minutes; what it leaves open may
    differ from run to run, but always holds.

    Args:
        counts: the training images' answers.
        objective: only whether it is primed matters.
        subset: where to start; not empty.
        node_limits: nodes of the solver's runs, one after another while there is no proof.
        stop: asked several times a second.

    Yields:
        The start, then whenever the best or the bound got better; the last is proved, or every
        limit was reached, or it was stopped.
    """
    classes = question_classes(counts, objective)
    best, bound = tuple(sorted(subset)), _recognizable(classes)
    report = ImagesReport(_n_recognized(classes, best), bound, best)
    yield report
    end = time.monotonic() + time_limit(counts.n_images, counts.n_questions)
    for limit in node_limits:
        while not report.proved and (seconds := end - time.monotonic()) > 0:
            before = report
            work = BackgroundTask(partial(_put_solution, classes, before, limit, seconds), stop)
            for found in work:
                report = found
            if work.stopped:
                yield ImagesReport(before.n_recognized, before.bound, before.subset, stopped=True)
                return
            if report != before:
                yield report
            if report.n_recognized == before.n_recognized:
                break  # nothing better within these nodes


def _n_recognized(classes: QuestionClasses, subset: Sequence[int]) -> int:
    return int(np.count_nonzero(classes.margins @ classes.numbers(subset) > 0))


def _recognizable(classes: QuestionClasses) -> int:
    """Images that at least one question recognizes: no subset can do more."""
    return int(np.count_nonzero((classes.margins > 0).any(axis=1)))


def _put_solution(
    classes: QuestionClasses,
    known: ImagesReport,
    node_limit: int,
    seconds: float,
    put: Callable[[ImagesReport], None],
) -> None:
    put(_solve(classes, known, node_limit, seconds))


def _solve(
    classes: QuestionClasses, known: ImagesReport, node_limit: int, seconds: float
) -> ImagesReport:
    """Ask for more images than are known; infeasible means that what is known is the most."""
    from scipy.optimize import Bounds, milp

    n_images, n_classes = classes.margins.shape
    options: Any = {"node_limit": node_limit, "mip_rel_gap": 0.0}
    if np.isfinite(seconds):
        options["time_limit"] = seconds
    result = milp(
        np.concatenate([np.zeros(n_classes), -np.ones(n_images)]),
        integrality=np.ones(n_classes + n_images),
        bounds=Bounds(0, np.concatenate([classes.sizes, np.ones(n_images)])),
        constraints=_constraints(classes, known.n_recognized + 1, known.bound),
        options=options,
    )
    return _read(classes, known, result)


def _constraints(classes: QuestionClasses, least: int, most: int) -> "LinearConstraint":
    """The rows of the program; the last asks for `least` to `most` recognized images."""
    from scipy.optimize import LinearConstraint
    from scipy.sparse import block_array, csr_array, diags_array

    n_images, n_classes = classes.margins.shape
    slack = 1 - np.minimum(classes.margins, 0) @ classes.sizes  # M_i
    rows: Any = block_array(
        [
            [csr_array(classes.margins.astype(float)), -diags_array(slack.astype(float))],
            [csr_array(np.ones((1, n_classes))), None],
            [None, csr_array(np.ones((1, n_images)))],
        ],
        format="csr",
    )
    low = np.concatenate([1 - slack, [1, least]])
    high = np.concatenate([np.full(n_images + 1, np.inf), [most]])
    return LinearConstraint(rows, low, high)


def _read(classes: QuestionClasses, known: ImagesReport, result: "OptimizeResult") -> ImagesReport:
    """The solver's word, checked: a subset counts by what it recognizes in whole numbers."""
    infeasible = 2
    if result.status == infeasible:
        return ImagesReport(known.n_recognized, known.n_recognized, known.subset)
    bound, best = known.bound, known
    if result.mip_dual_bound is not None and np.isfinite(result.mip_dual_bound):
        bound = min(bound, int(np.floor(-result.mip_dual_bound + _ROUNDING)))
    if result.x is not None:
        numbers = np.rint(result.x[: len(classes.members)]).astype(np.int64)
        subset = classes.subset(numbers.tolist())
        n_recognized = _n_recognized(classes, subset)
        if n_recognized > known.n_recognized:
            best = ImagesReport(n_recognized, bound, subset)
    return ImagesReport(best.n_recognized, max(bound, best.n_recognized), best.subset)
