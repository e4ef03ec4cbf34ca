"""The paper's rates and objectives, on integer counts of answers.

Whether an image is recognized is decided with integers (`C > W`), never with floats: a tie is
not recognized. A *subset* is the positions of its questions, ascending, each once. The genetic
search works on many subsets at once, as rows of zeros and ones.

Source: K. Kawaharazuka et al., "VQA-based Robotic State Recognition Optimized with Genetic
Algorithm", ICRA 2023, sections II-A (rates) and II-B (objectives).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.table import MISSING, AnswerTable

__all__ = [
    "Counts",
    "QuestionStats",
    "SubsetScore",
    "count",
    "mean_rate",
    "positions",
    "question_stats",
    "rate",
    "score",
]


@dataclass(frozen=True, slots=True, eq=False)
class Counts:
    """How many copies of each image got each kind of answer to each question.

    Attributes:
        correct: answers that speak for the image's label; int64, (n_images, n_questions).
        wrong: answers that speak for the other state; same shape.
        invalid: answers that speak for neither; same shape.
        labels: int8, (n_images,), +1 or -1.

    Raises:
        ValueError: if the shapes differ, a count is negative, the three do not add up to the
            same number of copies in every cell, or a label is neither +1 nor -1.
    """

    correct: NDArray[np.int64]
    wrong: NDArray[np.int64]
    invalid: NDArray[np.int64]
    labels: NDArray[np.int8]

    def __post_init__(self) -> None:
        shapes = [kind.shape for kind in (self.correct, self.wrong, self.invalid)]
        if len(set(shapes)) > 1 or self.correct.ndim != 2:
            raise ValueError(f"counts need one shape (n_images, n_questions), got {shapes}")
        if any((kind < 0).any() for kind in (self.correct, self.wrong, self.invalid)):
            raise ValueError("counts must not be negative")
        copies = np.unique(self.correct + self.wrong + self.invalid)
        if copies.size > 1 or (copies == 0).any():
            raise ValueError(f"every cell must count the same copies, at least 1; got {copies}")
        if self.labels.shape != self.correct.shape[:1] or not np.isin(self.labels, (-1, 1)).all():
            raise ValueError(f"labels must be {shapes[0][0]} times +1 or -1, got {self.labels}")

    @property
    def n_images(self) -> int:
        """Number of rows."""
        return len(self.labels)

    @property
    def n_questions(self) -> int:
        """Number of columns."""
        return int(self.correct.shape[1])


def count(table: AnswerTable) -> Counts:
    """Count Correct, Wrong and Invalid answers over the copies of each image.

    Raises:
        ValueError: if an answer is missing. A missing answer is not an Invalid one.

    Source: paper II-A.
    """
    missing = (table.verdicts == MISSING).any(axis=(1, 2))
    if missing.any():
        raise ValueError(
            f"{missing.sum()} of {missing.size} images have missing answers; "
            "leave them out with take(complete), or ask them again"
        )
    labels = table.labels[:, np.newaxis, np.newaxis]
    return Counts(
        correct=(table.verdicts == labels).sum(axis=1, dtype=np.int64),
        wrong=(table.verdicts == -labels).sum(axis=1, dtype=np.int64),
        invalid=(table.verdicts == 0).sum(axis=1, dtype=np.int64),
        labels=table.labels,
    )


@dataclass(frozen=True, slots=True, eq=False)
class SubsetScore:
    """How well a subset recognizes the images. Always unprimed, whatever chose the subset.

    Attributes:
        n_recognized: recognized images.
        n_images: images in all.
        R_ave: mean correct rate of the images, in [0, 1]; an image without a valid answer
            counts as 0; NaN without images.
        R_invalid: share of Invalid answers, in [0, 1]; NaN without answers.
        n_used: questions in the subset.
        correct: Correct answers of each image over the subset and all copies, (n_images,).
        wrong: Wrong answers, (n_images,).
        invalid: Invalid answers, (n_images,).
        recognized: bool, (n_images,).
        r_correct: correct rate of each image, (n_images,); NaN means "no answer".
    """

    n_recognized: int
    n_images: int
    R_ave: float
    R_invalid: float
    n_used: int
    correct: NDArray[np.int64]
    wrong: NDArray[np.int64]
    invalid: NDArray[np.int64]
    recognized: NDArray[np.bool_]
    r_correct: NDArray[np.float64]


def score(counts: Counts, subset: Sequence[int]) -> SubsetScore:
    """Score one subset for a report.

    Raises:
        ValueError: if a position is out of range or stands there twice.

    Source: paper II-A.
    """
    chosen = positions(subset, counts.n_questions)
    kinds = (counts.correct, counts.wrong, counts.invalid)
    correct, wrong, invalid = (kind[:, chosen].sum(axis=1) for kind in kinds)
    recognized = correct > wrong
    r_correct = rate(correct, correct + wrong, undefined=math.nan)
    n_answers = int((correct + wrong + invalid).sum())
    return SubsetScore(
        n_recognized=int(recognized.sum()),
        n_images=counts.n_images,
        R_ave=float(mean_rate(np.nan_to_num(r_correct))) if counts.n_images else math.nan,
        R_invalid=int(invalid.sum()) / n_answers if n_answers else math.nan,
        n_used=chosen.size,
        correct=correct,
        wrong=wrong,
        invalid=invalid,
        recognized=recognized,
        r_correct=r_correct,
    )


@dataclass(frozen=True, slots=True, eq=False)
class QuestionStats:
    """How each question does by itself, pooled over images; arrays are (n_questions,).

    Attributes:
        accuracy: correct / (correct + wrong), in [0, 1]; NaN without a valid answer.
        invalid_share: Invalid answers / all answers, in [0, 1]; NaN without images.
        accuracy_positive: accuracy on the images of the positive state.
        accuracy_negative: accuracy on the images of the negative state.
    """

    accuracy: NDArray[np.float64]
    invalid_share: NDArray[np.float64]
    accuracy_positive: NDArray[np.float64]
    accuracy_negative: NDArray[np.float64]


def question_stats(counts: Counts) -> QuestionStats:
    """Accuracy and invalid share of every question."""

    def accuracy(images: NDArray[np.bool_]) -> NDArray[np.float64]:
        correct, wrong = counts.correct[images].sum(axis=0), counts.wrong[images].sum(axis=0)
        return rate(correct, correct + wrong, undefined=math.nan)

    answers = (counts.correct + counts.wrong + counts.invalid).sum(axis=0)
    return QuestionStats(
        accuracy=accuracy(np.ones(counts.n_images, dtype=bool)),
        invalid_share=rate(counts.invalid.sum(axis=0), answers, undefined=math.nan),
        accuracy_positive=accuracy(counts.labels == 1),
        accuracy_negative=accuracy(counts.labels == -1),
    )


def positions(subset: Sequence[int], n_questions: int) -> NDArray[np.intp]:
    """The subset as an index array, (n_used,).

    Raises:
        ValueError: if a position is no whole number, out of range or stands there twice.
    """
    chosen = np.asarray(subset)
    # A mask of booleans, read as positions, would silently mean questions 0 and 1.
    whole = chosen.dtype.kind in "iu" or chosen.size == 0
    in_range = ((chosen >= 0) & (chosen < n_questions)).all()
    if not whole or not in_range or np.unique(chosen).size != chosen.size:
        raise ValueError(
            f"a subset is the distinct positions of its questions, 0 to {n_questions - 1}; "
            f"got {subset!r}"
        )
    return chosen.astype(np.intp)


def rate(
    part: NDArray[np.int64], whole: NDArray[np.int64], *, undefined: float
) -> NDArray[np.float64]:
    """Element-wise part / whole, and `undefined` for 0/0."""
    rates = np.full(part.shape, undefined)
    np.divide(part, whole, out=rates, where=whole > 0)
    return rates


def mean_rate(rates: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the last axis, added one by one from the smallest up.

    `mean` may add in another order for another shape, and then two equal subsets would differ
    in the last bit. The sorting makes the order of the images irrelevant, too.
    """
    ascending = np.sort(rates, axis=-1)
    mean: NDArray[np.float64] = np.cumsum(ascending, axis=-1)[..., -1] / rates.shape[-1]
    return mean
