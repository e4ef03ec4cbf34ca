"""The table that a search is judged by: chosen subsets beside baselines, on held-out images.

Everything is chosen on the training images; the test images are only scored. Training scores
carry no interval, because the search has seen these images and any interval would flatter.

Source: paper II-B (baselines) and III (tables); the intervals, the paired test and the best
single question are additions of this project.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts, SubsetScore, count, score
from vqa_state.answers.table import AnswerTable
from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.intervals import CONFIDENCE, Interval, clopper_pearson
from vqa_state.questions.grid import Form, Question
from vqa_state.search.objectives import Objective

__all__ = [
    "Baseline",
    "Candidate",
    "Evaluation",
    "Intervals",
    "MissedImage",
    "Row",
    "best_question",
    "evaluate",
]

N_RESAMPLES = 2000


class Baseline(StrEnum):
    """Subsets that no search chose: all questions, those of one form, and the best single one."""

    S_DOES = "s_does"
    S_IS = "s_is"
    S_ALL = "s_all"
    BEST_QUESTION = "best question"


Candidate = Objective | Baseline
"""A row of the table is named by the objective that chose its subset, or by its baseline."""


@dataclass(frozen=True, slots=True)
class Intervals:
    """How far the test scores may be from what new images of the same kind would give.

    Attributes:
        R_img: share of recognized images; exact (Clopper-Pearson).
        R_ave: mean correct rate; percentiles of a bootstrap over images.
        R_invalid: share of Invalid answers; percentiles of the same bootstrap.
    """

    R_img: Interval
    R_ave: Interval
    R_invalid: Interval


@dataclass(frozen=True, slots=True)
class MissedImage:
    """An image that a subset does not recognize, and what its answers said.

    Attributes:
        image_id: as in the answer table.
        label: its state, +1 or -1.
        n_for: answers for its label, over the subset and all copies.
        n_against: answers for the other state.
        n_invalid: answers for neither.
    """

    image_id: str
    label: int
    n_for: int
    n_against: int
    n_invalid: int

    @property
    def no_answer(self) -> bool:
        """Whether no answer spoke for either state."""
        return self.n_for == self.n_against == 0


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """One subset, scored.

    Attributes:
        name: which subset.
        subset: positions of its questions, ascending.
        train: score on the complete training images.
        train_missed: training images that it does not recognize, in the table's order.
        test: score on the complete test images, None without any.
        test_missed: test images that it does not recognize.
        intervals: of the test score, None without one.
    """

    name: Candidate
    subset: tuple[int, ...]
    train: SubsetScore
    train_missed: tuple[MissedImage, ...]
    test: SubsetScore | None
    test_missed: tuple[MissedImage, ...]
    intervals: Intervals | None


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """The whole table.

    Attributes:
        rows: the objectives, then the baselines; a row that has no questions of its kind is absent.
        n_left_out_train: training images left out because answers are missing.
        n_left_out_test: test images left out for the same reason.
    """

    rows: tuple[Row, ...]
    n_left_out_train: int
    n_left_out_test: int


def evaluate(
    train: AnswerTable,
    test: AnswerTable | None,
    chosen: Mapping[Objective, Sequence[int]],
    *,
    seed: int,
) -> Evaluation:
    """Score the chosen subsets and the baselines on training and test images.

    Args:
        train: answers on the images that the subsets were chosen with.
        test: answers to the same questions on other images, or None.
        chosen: the subset that each objective's search found.
        seed: of the bootstrap, 0 or more; all rows share its resamples.

    Raises:
        NothingToSearchError: if no training image has all its answers, or there is no question.
        ValueError: if the tables' questions differ, or a subset does not fit them.
    """
    if test is not None and test.questions != train.questions:
        raise ValueError("train and test must hold answers to the same questions, in one order")
    seen = train.take(train.complete)
    held_out = None if test is None or not test.complete.any() else test.take(test.complete)
    if 0 in (seen.n_images, seen.n_questions):
        raise NothingToSearchError(
            f"nothing to evaluate: {seen.n_images} training images have all their answers to "
            f"{seen.n_questions} questions; ask the model for the missing ones"
        )
    seen_counts = count(seen)
    test_counts = None if held_out is None else count(held_out)
    resamples = _resamples(0 if held_out is None else held_out.n_images, seed)

    def row(name: Candidate, subset: tuple[int, ...]) -> Row:
        on_train = score(seen_counts, subset)
        on_test = None if test_counts is None else score(test_counts, subset)
        return Row(
            name=name,
            subset=subset,
            train=on_train,
            train_missed=_missed(seen, on_train),
            test=on_test,
            test_missed=() if held_out is None or on_test is None else _missed(held_out, on_test),
            intervals=None if on_test is None else _intervals(on_test, resamples),
        )

    return Evaluation(
        rows=tuple(row(name, s) for name, s in _subsets(seen.questions, seen_counts, chosen)),
        n_left_out_train=train.n_images - seen.n_images,
        n_left_out_test=0 if test is None else int(np.count_nonzero(~test.complete)),
    )


def best_question(counts: Counts) -> int:
    """Position of the best single question, by training images alone.

    Most recognized images, then the higher mean correct rate, then fewer Invalid answers, then
    the first.
    """

    def badness(question: int) -> tuple[int, float, float]:
        alone = score(counts, (question,))
        return -alone.n_recognized, -alone.R_ave, alone.R_invalid

    return min(range(counts.n_questions), key=badness)


def _subsets(
    questions: Sequence[Question], counts: Counts, chosen: Mapping[Objective, Sequence[int]]
) -> Iterator[tuple[Candidate, tuple[int, ...]]]:
    """Name and subset of every row, in order."""
    for objective in Objective:
        if objective in chosen:
            yield objective, tuple(sorted(chosen[objective]))
    for name, form in ((Baseline.S_DOES, Form.DOES), (Baseline.S_IS, Form.IS)):
        of_form = tuple(i for i, question in enumerate(questions) if question.form == form)
        if of_form:
            yield name, of_form
    yield Baseline.S_ALL, tuple(range(len(questions)))
    yield Baseline.BEST_QUESTION, (best_question(counts),)


def _missed(table: AnswerTable, result: SubsetScore) -> tuple[MissedImage, ...]:
    return tuple(
        MissedImage(
            image_id=table.image_ids[i],
            label=int(table.labels[i]),
            n_for=int(result.correct[i]),
            n_against=int(result.wrong[i]),
            n_invalid=int(result.invalid[i]),
        )
        for i in np.flatnonzero(~result.recognized)
    )


def _resamples(n_images: int, seed: int) -> NDArray[np.intp]:
    """Positions of images drawn with replacement, (N_RESAMPLES, n_images)."""
    stream = np.random.SeedSequence([seed, *b"bootstrap"])
    rng = np.random.Generator(np.random.PCG64(stream))
    return rng.integers(max(n_images, 1), size=(N_RESAMPLES, n_images), dtype=np.intp)


def _intervals(result: SubsetScore, resamples: NDArray[np.intp]) -> Intervals:
    asked = result.correct + result.wrong + result.invalid
    invalid = result.invalid / asked if result.n_used else np.full(result.n_images, np.nan)
    return Intervals(
        R_img=clopper_pearson(result.n_recognized, result.n_images),
        R_ave=_bootstrap(np.nan_to_num(result.r_correct), resamples),
        R_invalid=_bootstrap(invalid, resamples),
    )


def _bootstrap(values: NDArray[np.float64], resamples: NDArray[np.intp]) -> Interval:
    """Percentile interval of the mean of one value an image, (n_images,)."""
    means = values[resamples].mean(axis=1)  # (N_RESAMPLES,)
    tail = 100 * (1 - CONFIDENCE) / 2
    low, high = np.percentile(means, [tail, 100 - tail])
    return Interval(float(low), float(high))
