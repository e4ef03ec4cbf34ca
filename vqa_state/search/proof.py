"""How good the best subset is at most: a proof that it is the best, or a bound on what is missing.

Up to 24 questions every subset is compared. With more, a MILP proves how many images any subset
recognizes, then CP-SAT bounds the fitness E. The search's answer is the start and is only ever
replaced by a better one. Limits are in nodes and in deterministic time, so a proof repeats; beyond
64 questions and 20 images also in minutes, and then a bound may differ from run to run.
"""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.search.background_task import BackgroundTask, StopPoll
from vqa_state.search.badge import Badge
from vqa_state.search.cpsat import CLOSED, best_value
from vqa_state.search.exact import can_enumerate, enumerate_subsets
from vqa_state.search.fitness import Fitness, Terms
from vqa_state.search.genetic import better, require_searchable
from vqa_state.search.local_search import LocalSearch
from vqa_state.search.milp import NODE_LIMITS, most_images
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights

__all__ = [
    "PROOF_TOLERANCE",
    "Badge",
    "ProofLimits",
    "ProofReport",
    "ProofStage",
    "badge_sentence",
    "prove",
    "prove_all",
]

#: A subset is the best if no other is better by more: the solvers round E, upwards.
PROOF_TOLERANCE = CLOSED


class ProofStage(StrEnum):
    """What a proof is doing."""

    SUBSETS = "comparing all subsets"
    IMAGES = "proving the number of images"
    VALUE = "bounding E"


@dataclass(frozen=True, slots=True)
class ProofLimits:
    """Where the solvers give up; not in seconds, so that a result repeats.

    Only tables of more than 64 questions and 20 images have a limit of a minute for each solver
    besides, because a single node of theirs may take so long.

    Attributes:
        nodes: nodes of the MILP solver's runs, one after another.
        deterministic_time: limit of CP-SAT, in its own units; one takes about a second or two.

    Raises:
        ValueError: if there are no nodes, or a limit is not positive.
    """

    nodes: tuple[int, ...] = NODE_LIMITS
    deterministic_time: float = 6.0

    def __post_init__(self) -> None:
        if not self.nodes or min(self.nodes) < 1:
            raise ValueError(f"nodes must be one or more numbers from 1 up, got {self.nodes}")
        if not 0 < self.deterministic_time < float("inf"):
            raise ValueError(
                f"deterministic_time must be positive and finite, got {self.deterministic_time}"
            )


@dataclass(frozen=True, slots=True)
class ProofReport:
    """What is known by now.

    Attributes:
        objective: what is maximized.
        stage: what the proof is doing.
        subset: the best so far, positions ascending; never worse than the start.
        terms: what its fitness E, `terms.value`, is made of.
        bound: no subset has a larger E; it never rises.
        n_bound: no subset recognizes more images; it never rises.
        finished: whether this is the last report.
        stopped: whether the caller stopped before the end.
    """

    objective: Objective
    stage: ProofStage
    subset: tuple[int, ...]
    terms: Terms
    bound: float
    n_bound: int
    finished: bool = False
    stopped: bool = False

    @property
    def gap(self) -> float:
        """By how much the best E may exceed the one found; 0 or more."""
        return max(0.0, self.bound - self.terms.value)

    @property
    def badge(self) -> Badge:
        """What is proved."""
        if self.gap <= PROOF_TOLERANCE:
            return Badge.BEST
        return Badge.IMAGES if self.terms.n_recognized == self.n_bound else Badge.FOUND

    @property
    def sentence(self) -> str:
        """The badge for a reader: "most images proved, E within 0.12 of the bound"."""
        return badge_sentence(self.badge, self.gap, self.n_bound)


def badge_sentence(badge: Badge, gap: float, n_bound: int) -> str:
    """A badge with what it leaves open, for a reader, while proving and afterwards.

    Args:
        badge: what is proved.
        gap: by how much the best E may exceed the one found.
        n_bound: no subset recognizes more images.
    """
    if badge is Badge.IMAGES:
        hundredths = np.ceil(gap * 100) / 100  # rounded up: it is a promise
        return f"{badge}, E within {hundredths:.2f} of the bound"
    if badge is Badge.FOUND:
        return f"{badge}, bound {n_bound}"
    return badge.value


def prove(
    counts: Counts,
    objective: Objective,
    subset: Sequence[int],
    *,
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    limits: ProofLimits | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[ProofReport]:
    """Improve on a subset and bound what any subset could reach.

    Of subsets that all come within `PROOF_TOLERANCE` of the best, CP-SAT may not tell the best;
    the comparison of all subsets does, to the last bit.

    Args:
        counts: the training images' answers.
        objective: what to maximize.
        subset: where to start, usually what a search found.
        weights: weights of the objective's terms.
        limits: where the solvers give up; the default takes seconds to half a minute.
        stop: asked several times a second; the proof ends with what it knows.

    Yields:
        At least one report; the last is finished. The same arguments give the same last report,
        if no solver came to its limit in seconds.

    Raises:
        NothingToSearchError: if there are no questions, no images or no images of one state.
        ValueError: if the subset is empty or not one of these questions.
    """
    require_searchable(counts)
    if not len(subset):
        raise ValueError("a proof starts from a subset with at least one question, got none")
    return _Proof(counts, objective, subset, weights).run(limits or ProofLimits(), stop)


def prove_all(
    counts: Counts,
    subsets: Mapping[Objective, Sequence[int]],
    *,
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    limits: ProofLimits | None = None,
    stop: Callable[[], bool] = lambda: False,
    n_threads: int = 2,
) -> Iterator[Mapping[Objective, ProofReport]]:
    """`prove` for several objectives, some at a time.

    Args:
        counts: the training images' answers.
        subsets: where to start, for each objective.
        weights: weights of the objectives' terms.
        limits: where the solvers give up.
        stop: asked several times a second, from several threads.
        n_threads: proofs that run at a time.

    Yields:
        The last report of each objective that has one, whenever one of them has news. The order of
        news depends on the threads; what the last one holds does not.

    Raises:
        NothingToSearchError: as `prove`.
        ValueError: as `prove`.
    """
    closing = threading.Event()
    proofs = {
        objective: prove(
            counts,
            objective,
            subset,
            weights=weights,
            limits=limits,
            stop=lambda: closing.is_set() or stop(),
        )
        for objective, subset in subsets.items()
    }

    def run(put: Callable[[ProofReport], None]) -> None:
        def drain(reports: Iterator[ProofReport]) -> None:
            for report in reports:
                put(report)

        with ThreadPoolExecutor(n_threads) as pool:
            list(pool.map(drain, proofs.values()))  # the list raises what a proof raised

    known: dict[Objective, ProofReport] = {}
    for report in BackgroundTask(run, lambda: False, closing.set):
        known[report.objective] = report
        yield dict(known)


class _Proof:
    """One objective's proof, and what it knows."""

    def __init__(
        self,
        counts: Counts,
        objective: Objective,
        subset: Sequence[int],
        weights: ObjectiveWeights,
    ) -> None:
        self._counts, self._objective, self._weights = counts, objective, weights
        self._fitness = Fitness(counts, objective, weights)
        best, n_images = tuple(sorted(subset)), counts.n_images
        self._known = ProofReport(
            objective=objective,
            stage=ProofStage.SUBSETS if can_enumerate(counts, objective) else ProofStage.IMAGES,
            subset=best,
            terms=self._fitness.terms(best),
            bound=self._cap(n_images),
            n_bound=n_images,
        )
        self._is_stopped = StopPoll(lambda: False)

    def run(self, limits: ProofLimits, stop: Callable[[], bool]) -> Iterator[ProofReport]:
        self._is_stopped = StopPoll(stop)
        if self._known.stage is ProofStage.SUBSETS:
            yield from self._compare(stop)
        else:
            yield from self._bound(limits, stop)
        yield replace(self._known, finished=True)

    def _compare(self, stop: Callable[[], bool]) -> Iterator[ProofReport]:
        """Look at every subset."""
        for report in enumerate_subsets(
            self._counts, self._objective, weights=self._weights, stop=stop
        ):
            self._take(report.subset)
            value = self._known.terms.value
            self._lower(report.n_most, value if report.finished else self._cap(report.n_most))
            self._known = replace(self._known, stopped=not report.finished)
            if not report.finished:
                yield replace(self._known, stopped=False)

    def _bound(self, limits: ProofLimits, stop: Callable[[], bool]) -> Iterator[ProofReport]:
        """The number of images, then E."""
        n_known = 0
        for images in most_images(
            self._counts, self._objective, self._known.subset, node_limits=limits.nodes, stop=stop
        ):
            self._take(images.subset, improve=True)
            self._lower(images.bound, self._cap(images.bound))
            self._known = replace(self._known, stopped=images.stopped)
            n_known = images.n_recognized
            yield self._known
        if self._known.stopped or self._known.badge is Badge.BEST:
            return
        self._known = replace(self._known, stage=ProofStage.VALUE)
        for value in best_value(
            self._counts,
            self._objective,
            self._known.subset,
            n_recognized=(n_known, self._known.n_bound),
            weights=self._weights,
            deterministic_time=limits.deterministic_time,
            stop=stop,
        ):
            self._take(value.subset)
            self._lower(self._known.n_bound, value.bound)
            self._known = replace(self._known, stopped=value.stopped)
            yield self._known
        self._take(self._known.subset, improve=True)

    def _cap(self, n_recognized: int) -> float:
        """E of a subset that recognizes so many images is at most this."""
        signed_beta = self._objective.kind.signed_beta(self._weights)
        R_img = n_recognized / self._counts.n_images
        return float(self._weights.alpha * R_img + 1 + max(signed_beta, 0))

    def _take(self, subset: tuple[int, ...], *, improve: bool = False) -> None:
        """Keep a subset if it is better, or what a local search from it leads to."""
        if not subset:
            return
        individuals = np.zeros((2, self._counts.n_questions), dtype=np.uint8)
        individuals[0, list(self._known.subset)] = individuals[1, list(subset)] = 1
        best = better(individuals[0], individuals[1], self._fitness)
        if improve:
            best = better(best, self._improved(individuals[1]), self._fitness)
        taken = tuple(np.flatnonzero(best).tolist())
        self._known = replace(self._known, subset=taken, terms=self._fitness.terms(taken))

    def _improved(self, start: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Where a local search leads, as far as it comes before a stop."""
        local, reached = LocalSearch(self._counts, self._objective, self._weights), start
        for position in local.steps(start):
            reached = position.individual
            if self._is_stopped():
                break
        return reached

    def _lower(self, n_bound: int, bound: float) -> None:
        """Bounds fall, but never below what is found: the solvers round by 1e-6 or so."""
        self._known = replace(
            self._known,
            n_bound=min(self._known.n_bound, n_bound),
            bound=max(self._known.terms.value, min(self._known.bound, bound)),
        )
