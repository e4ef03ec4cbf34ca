"""What each further question buys: the most recognized images for every number of questions.

A robot pays for every call, so the best subset of all is not always the one to take. For each
number of questions, a beam of the best subsets is kept. One round goes up through the sizes, where
each subset is offered every further question, and down again, where each drops every question of
its own; on the way the best of each size also swap any of theirs for any other. Rounds follow until
one changes no point.

Beyond 64 questions only sizes of 128, 256 and so on, and all questions, are looked at, and of large
tables the beams are narrower, so that a frontier takes minutes, not hours.

It is judged by training images only, as every choice is. Why a beam and not NSGA-II, and how both
were measured: docs/decisions/0010-frontier.md.

Source: P. S. Ow, T. E. Morton, "Filtered beam search in scheduling", International Journal of
Production Research 1988 (the beam); P. Pudil et al., "Floating search methods in feature
selection", Pattern Recognition Letters 1994 (up and down).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts, score
from vqa_state.errors import NothingToSearchError

__all__ = ["FrontierPoint", "FrontierReport", "point_of", "search_frontier", "thinned"]

MAX_ROUNDS = 4

_BEAM = 64  # subsets of each size that are kept
_SWAPPING = 4  # of these, the best, which also swap
_SWAPS = 1024  # of one subset: all that there are of 64 questions
_MAX_CELLS = 500_000  # images x subsets whose sums are held at once

_EVERY_SIZE = 64  # up to here; then sizes double
_LEAPS = 8  # in so many steps from one size to the next
_CELLS_A_STEP = 1_000_000  # images x subsets that a beam, and its swaps, may look at
_OVERHEAD = 20  # a subset costs as much as so many images more

_Moves = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]
"""Rows of subsets, the question that each loses, and the one that it gets; n_questions is none."""


@dataclass(frozen=True, slots=True)
class FrontierPoint:
    """One subset on training images; of the frontier, the best that was found of its size.

    Attributes:
        n_questions: its size.
        n_calls: calls a decision: questions times copies.
        subset: positions of its questions, ascending.
        n_recognized: recognized training images, by the paper's rule.
        n_images: training images.
        R_ave: mean correct rate, in [0, 1].
    """

    n_questions: int
    n_calls: int
    subset: tuple[int, ...]
    n_recognized: int
    n_images: int
    R_ave: float

    @property
    def says(self) -> str:
        """Its cost and what it recognizes, in one line."""
        plural = "" if self.n_questions == 1 else "s"
        return (
            f"{self.n_questions} question{plural}, {self.n_calls} calls a decision: "
            f"{self.n_recognized} of {self.n_images} training images recognized, mean correct rate "
            f"{self.R_ave:.3f}"
        )


@dataclass(frozen=True, slots=True)
class FrontierReport:
    """The search after one more size.

    Attributes:
        step: sizes gone through so far, in all rounds, up to `total`.
        total: steps of all rounds; the search ends sooner if a round changes nothing.
        finished: whether this is the last report.
        points: ascending in questions; each recognizes more images than all cheaper ones, or as
            many with a higher mean correct rate.
    """

    step: int
    total: int
    finished: bool
    points: tuple[FrontierPoint, ...]


def search_frontier(counts: Counts) -> Iterator[FrontierReport]:
    """Look for the frontier of recognized images against calls, reporting after every size.

    The caller shows progress by iterating and stops by no longer iterating; the points so far are
    then the best found. Nothing is random: the same counts give the same reports.

    Args:
        counts: the training images' answers.

    Yields:
        Reports whose points never get worse; the last one has `finished`.

    Raises:
        NothingToSearchError: if there are no images or no questions.

    Source: paper II-B for what is compared: recognized images, then R_ave.
    """
    if 0 in counts.correct.shape:
        raise NothingToSearchError(
            f"no frontier of {counts.n_images} training images and {counts.n_questions} "
            "questions; label images and ask the model first"
        )
    return _rounds(counts)


def point_of(counts: Counts, subset: Sequence[int]) -> FrontierPoint:
    """Where one subset stands beside the frontier.

    Args:
        counts: the training images' answers.
        subset: positions of its questions.

    Raises:
        ValueError: if a position is out of range or stands there twice.
    """
    result = score(counts, subset)
    n_copies = int((counts.correct + counts.wrong + counts.invalid).max(initial=0))
    return FrontierPoint(
        n_questions=len(subset),
        n_calls=len(subset) * n_copies,
        subset=tuple(sorted(subset)),
        n_recognized=result.n_recognized,
        n_images=result.n_images,
        R_ave=result.R_ave,
    )


def thinned(points: tuple[FrontierPoint, ...]) -> tuple[FrontierPoint, ...]:
    """Only the points that recognize more images than every cheaper one."""
    kept: list[FrontierPoint] = []
    for point in points:
        if not kept or point.n_recognized > kept[-1].n_recognized:
            kept.append(point)
    return tuple(kept)


def _rounds(counts: Counts) -> Iterator[FrontierReport]:
    beams, sizes = _Beams(counts), _sizes(counts.n_questions)
    up = list(zip(sizes, [0, *sizes], strict=False))
    down = [(size, start) for start, size in up[:0:-1]]
    steps = len(up) + len(down)
    for number in range(MAX_ROUNDS):
        before = beams.best()
        for done, (size, start) in enumerate([*up, *down], start=1):
            beams.grow(size, start)
            last = done == steps and (number == MAX_ROUNDS - 1 or beams.best() == before)
            yield FrontierReport(
                step=number * steps + done,
                total=MAX_ROUNDS * steps,
                finished=last,
                points=beams.points(),
            )
            if last:
                return


def _sizes(n_questions: int) -> list[int]:
    """Numbers of questions that are looked at, ascending."""
    sizes = list(range(1, min(n_questions, _EVERY_SIZE) + 1))
    while sizes[-1] < n_questions:
        sizes.append(min(2 * sizes[-1], n_questions))
    return sizes


class _Beams:
    """The best subsets of each size found so far.

    A beam is rows of zeros and ones, (up to `width`, n_questions), the best first. A subset's value
    is its recognized images plus half of its R_ave, so more images always come first.
    """

    def __init__(self, counts: Counts) -> None:
        self._counts = counts
        affordable = max(1, _CELLS_A_STEP // (counts.n_images + _OVERHEAD))  # subsets
        self._width = min(_BEAM, max(1, affordable // counts.n_questions))
        self._swapping = min(_SWAPPING, max(1, affordable // _SWAPS))
        # One more row, of zeros, for the question that is none.
        nothing = np.zeros((1, counts.n_images))
        self._correct = np.concatenate([counts.correct.T, nothing])  # (n_questions + 1, n_images)
        self._valid = np.concatenate([(counts.correct + counts.wrong).T, nothing])
        self._names = _names(counts.n_questions)
        self._beams = [np.zeros((0, counts.n_questions), dtype=np.uint8)] * (counts.n_questions + 1)
        self._beams[0] = np.zeros((1, counts.n_questions), dtype=np.uint8)
        self._points: list[FrontierPoint | None] = [None] * len(self._beams)

    def best(self) -> list[FrontierPoint | None]:
        """The best subset found of each size."""
        return list(self._points)

    def points(self) -> tuple[FrontierPoint, ...]:
        """Those of the best subsets that no smaller one equals."""
        kept: list[FrontierPoint] = []
        for point in self._points:
            if point and (not kept or _quality(point) > _quality(kept[-1])):
                kept.append(point)
        return tuple(kept)

    def grow(self, size: int, start: int) -> None:
        """Better the beam of one size from that of a neighbouring size, then by swaps."""
        neighbours = self._beams[start]
        if abs(size - start) > 1:  # not by one question, but nearly so far, in a few leaps
            neighbours = self._leapt(neighbours[: self._swapping], size)
        self._merge(
            size, neighbours, _additions(neighbours) if start < size else _drops(neighbours)
        )
        best = self._beams[size][: self._swapping]
        self._merge(size, best, self._likely_swaps(best))
        subset = tuple(np.flatnonzero(self._beams[size][0]).tolist())
        held = self._points[size]
        if held is None or held.subset != subset:
            self._points[size] = point_of(self._counts, subset)

    def _leapt(self, subsets: NDArray[np.uint8], size: int) -> NDArray[np.uint8]:
        """Each subset with questions added or dropped until one more step leads to the size.

        The best by themselves are taken, several at once.
        """
        rising = bool(subsets[0].sum() < size)
        for left in range(_LEAPS, 0, -1):
            missing = abs(size - int(subsets[0].sum())) - 1
            rows, outs, ins = _additions(subsets) if rising else _drops(subsets)
            values = self._values(subsets, rows, outs, ins)
            subsets = subsets.copy()
            for row in range(len(subsets)):
                of_row = np.flatnonzero(rows == row)
                chosen = of_row[np.argsort(-values[of_row], kind="stable")[: -(-missing // left)]]
                subsets[row, (ins if rising else outs)[chosen]] = rising
        return subsets

    def _likely_swaps(self, subsets: NDArray[np.uint8]) -> _Moves:
        """All swaps; where they are too many, of the questions that are best to drop and to add."""
        size = int(subsets[0].sum())
        if size * (self._counts.n_questions - size) <= _SWAPS:
            return _swaps(subsets)
        held = self._promising(subsets, *_drops(subsets), size)
        lacked = self._promising(subsets, *_additions(subsets), size)
        return _swaps(subsets, held, lacked)

    def _promising(
        self,
        subsets: NDArray[np.uint8],
        rows: NDArray[np.intp],
        outs: NDArray[np.intp],
        ins: NDArray[np.intp],
        size: int,
    ) -> NDArray[np.bool_]:
        """Which questions of each subset are best to move, as many as can be swapped in all."""
        n_held = min(size, int(_SWAPS**0.5))
        n_lacked = min(self._counts.n_questions - size, _SWAPS // n_held)
        n_held = _SWAPS // n_lacked
        dropping = bool((ins == self._counts.n_questions).all())
        values = self._values(subsets, rows, outs, ins)
        chosen = np.zeros(subsets.shape, dtype=np.bool_)
        for row in range(len(subsets)):
            of_row = np.flatnonzero(rows == row)
            best = of_row[np.argsort(-values[of_row], kind="stable")]
            best = best[: n_held if dropping else n_lacked]
            chosen[row, (outs if dropping else ins)[best]] = True
        return chosen

    def _merge(self, size: int, parents: NDArray[np.uint8], moves: _Moves) -> None:
        """Keep the best of a beam and of the parents after each move, each subset once."""
        beam = self._beams[size]
        n_questions, stay = self._counts.n_questions, np.arange(len(beam))
        none = np.full(len(beam), n_questions)
        rows = np.concatenate([stay, len(beam) + moves[0]])
        outs, ins = np.concatenate([none, moves[1]]), np.concatenate([none, moves[2]])
        pool = np.concatenate([beam, parents])
        names = (pool @ self._names[:-1])[rows] - self._names[outs] + self._names[ins]
        _, once = np.unique(names, return_index=True)
        rows, outs, ins = rows[once], outs[once], ins[once]
        order = np.lexsort([names[once], -self._values(pool, rows, outs, ins)])[: self._width]
        moved = np.column_stack([pool[rows[order]], np.zeros(len(order), dtype=np.uint8)])
        moved[np.arange(len(order)), outs[order]] = 0
        moved[np.arange(len(order)), ins[order]] = 1
        self._beams[size] = moved[:, :-1]

    def _values(
        self,
        pool: NDArray[np.uint8],
        rows: NDArray[np.intp],
        outs: NDArray[np.intp],
        ins: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """Values of the subsets `pool[rows]` without the questions `outs` and with `ins`."""
        sums = [pool @ of_question[:-1] for of_question in (self._correct, self._valid)]
        values = np.empty(len(rows))
        step = max(1, _MAX_CELLS // self._counts.n_images)
        for start in range(0, len(rows), step):
            r, o, i = (part[start : start + step] for part in (rows, outs, ins))
            correct = sums[0][r] - self._correct[o] + self._correct[i]  # (moves, n_images)
            valid = sums[1][r] - self._valid[o] + self._valid[i]
            n_recognized = np.count_nonzero(2 * correct > valid, axis=1)
            rates = np.divide(correct, valid, out=np.zeros_like(correct), where=valid > 0)
            values[start : start + step] = n_recognized + rates.mean(axis=1) / 2
        return values


def _quality(point: FrontierPoint) -> tuple[int, float]:
    return point.n_recognized, round(point.R_ave, 9)  # sums may differ in their last bits


def _names(n_questions: int) -> NDArray[np.uint64]:
    """A number for each question, and 0 for none, whose sum modulo 2^64 names a subset.

    They are fixed random numbers: that two of a million subsets share a name has a chance of one
    in 10^7, and would cost one candidate.
    """
    rng = np.random.Generator(np.random.PCG64(0))
    names = rng.integers(2**64, size=n_questions + 1, dtype=np.uint64)
    names[-1] = 0
    return names


def _additions(subsets: NDArray[np.uint8]) -> _Moves:
    """Every question into every subset that lacks it."""
    rows, ins = np.nonzero(subsets == 0)
    return rows, np.full(len(rows), subsets.shape[1]), ins


def _drops(subsets: NDArray[np.uint8]) -> _Moves:
    """Every question out of every subset that holds it."""
    rows, outs = np.nonzero(subsets)
    return rows, outs, np.full(len(rows), subsets.shape[1])


def _swaps(
    subsets: NDArray[np.uint8],
    held: NDArray[np.bool_] | None = None,
    lacked: NDArray[np.bool_] | None = None,
) -> _Moves:
    """Every question that a subset holds for every one that it lacks, or some for some."""
    held = subsets > 0 if held is None else held
    lacked = subsets == 0 if lacked is None else lacked
    rows, outs, ins = np.nonzero(held[:, :, np.newaxis] & lacked[:, np.newaxis, :])
    return rows, outs, ins
