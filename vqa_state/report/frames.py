"""What a project's results say, as data frames and sentences: for the app, the terminal and CSV.

The heatmap reads training images only; looks at the test table are counted by the caller.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts, count, question_stats
from vqa_state.answers.store import AnswerStore, copy_keys
from vqa_state.answers.table import AnswerTable
from vqa_state.evaluation.held_out import Evaluation, Row
from vqa_state.evaluation.intervals import Interval
from vqa_state.project.project import Project
from vqa_state.project.searches import Results, SavedSearch
from vqa_state.project.split import Split
from vqa_state.search.fitness import Fitness
from vqa_state.study.collect import answer_table

__all__ = [
    "ImageAnswer",
    "MissedPicture",
    "comparison_frame",
    "heatmap",
    "image_answers",
    "look_alike_sentences",
    "missed_pictures",
    "question_frame",
    "score_frame",
    "term_sentences",
]


@dataclass(frozen=True, slots=True)
class ImageAnswer:
    """One stored answer about one copy of an image; `speaks_for` is +1, -1 or 0 (invalid).

    `cut_off`: invalid because the length limit ended it before yes or no.
    """

    question: str
    copy: int
    text: str
    speaks_for: int
    cut_off: bool = False


def question_frame(train: AnswerTable) -> pd.DataFrame:
    """One row a question: where it stands in the grid and how it does on the training images.

    Columns: question, form, article, phrase, wording, yes_means, accuracy and its two parts by
    state (NaN without a valid answer), invalid, and cut_off, the part of invalid that the length
    limit ended before yes or no. Shares are in [0, 1].
    """
    complete = train.take(train.complete)
    stats = question_stats(count(complete))
    return pd.DataFrame(
        {
            "question": [question.text for question in train.questions],
            "form": [question.form.value for question in train.questions],
            "article": [q.article.value if q.article else "" for q in train.questions],
            "phrase": [question.phrase or "" for question in train.questions],
            "wording": [question.wording or "" for question in train.questions],
            "yes_means": [question.yes_means for question in train.questions],
            "accuracy": stats.accuracy,
            "accuracy_positive": stats.accuracy_positive,
            "accuracy_negative": stats.accuracy_negative,
            "invalid": stats.invalid_share,
            "cut_off": _cut_off_share(complete),
        }
    )


def _cut_off_share(table: AnswerTable) -> NDArray[np.float64]:
    """(n_questions,), of each question's answers; NaN without any."""
    n_answers = table.n_images * table.n_copies
    if table.cut_off is None or not n_answers:
        return np.full(table.n_questions, np.nan)
    return np.asarray(table.cut_off.sum(axis=(0, 1)) / n_answers)


def score_frame(evaluation: Evaluation) -> pd.DataFrame:
    """The paper's table in numbers, one row a subset; test columns are NaN without test images."""
    return pd.DataFrame([_numbers(row) for row in evaluation.rows])


def comparison_frame(evaluation: Evaluation) -> pd.DataFrame:
    """The paper's table as a person reads it: test scores with their 95 % intervals."""
    return pd.DataFrame([_words(row) for row in evaluation.rows])


def term_sentences(found: Results) -> list[str]:
    """For each objective, what its best fitness is made of, and which term beat asking all.

    Source: paper II-B; the weighted sum is literal, so no term outranks another in every case.
    """
    counts = count(found.train)
    return [_terms_in_words(counts, saved) for saved in found.searches.values()]


def _terms_in_words(counts: Counts, saved: SavedSearch) -> str:
    fitness = Fitness(counts, saved.objective, saved.weights)
    best, everything = fitness.terms(saved.subset), fitness.terms(range(counts.n_questions))
    alpha, beta = saved.weights.alpha, saved.objective.kind.signed_beta(saved.weights)
    shares = {
        "recognized images": alpha * (best.n_recognized - everything.n_recognized) / best.n_images,
        "the mean correct rate": best.R_ave - everything.R_ave,
        "the number of questions": beta * (best.n_used - everything.n_used) / best.n_questions,
    }
    decided = (
        f"above all questions by {max(shares, key=lambda term: shares[term])}"
        if best.value > everything.value
        else "no better than all questions"
    )
    return (
        f"{saved.objective.value}: E = {alpha:g} × {best.n_recognized}/{best.n_images} + "
        f"{best.R_ave:.3f} {'+' if beta >= 0 else '-'} {abs(beta):g} × "
        f"{best.n_used}/{best.n_questions} = {best.value:.3f}, {decided}."
    )


@dataclass(frozen=True, slots=True)
class MissedPicture:
    """An image that a subset does not recognize, under the name that it came with."""

    name: str
    state: str
    split: str
    n_for: int
    n_against: int
    n_invalid: int

    def sentence(self) -> str:
        """One line; an image without a clear yes or no has no answer, which is not 0."""
        if self.n_for == self.n_against == 0:
            votes = f"no answer ({self.n_invalid} invalid)"
        else:
            votes = f"{self.n_for} for, {self.n_against} against, {self.n_invalid} invalid"
        return f"{self.split}: {self.name} is {self.state}: {votes}"


def missed_pictures(project: Project, row: Row) -> list[MissedPicture]:
    """Training and test images that this row's subset does not recognize."""
    return [
        MissedPicture(
            project.images[one.image_id].name,
            project.states.of(one.label),
            split.value,
            one.n_for,
            one.n_against,
            one.n_invalid,
        )
        for split, missed in ((Split.TRAIN, row.train_missed), (Split.TEST, row.test_missed))
        for one in missed
    ]


def look_alike_sentences(project: Project) -> list[str]:
    """The groups of look-alikes, and where they stand."""
    astride = project.look_alikes_astride()
    sentences = []
    for group in project.look_alikes():
        where = "on both sides, so the test flatters" if group in astride else "kept on one side"
        names = ", ".join(project.images[image_id].name for image_id in group)
        sentences.append(f"These images look alike ({where}): {names}")
    return sentences


def image_answers(project: Project, image_id: str, texts: set[str]) -> list[ImageAnswer]:
    """The raw answers about one image to the questions with these texts.

    Raises:
        StoreError: if the store cannot be read.
    """
    image = project.images[image_id]
    questions = [question for question in project.questions() if question.text in texts]
    found = []
    with AnswerStore(project.store_path) as store:
        for key in copy_keys(image.pixel_hash, project.augmentation, project.seed):
            said = store.answers(project.fingerprint or "", key, list(texts))
            found += [
                ImageAnswer(
                    q.text,
                    key.number,
                    said[q.text].text,
                    said[q.text].verdict(q.yes_means),
                    said[q.text].cut_off,
                )
                for q in questions
                if q.text in said
            ]
    return found


def heatmap(project: Project) -> pd.DataFrame:
    """`question_frame` of the project's training images, before any search.

    Raises:
        NothingToSearchError: if the model was never asked.
    """
    return question_frame(answer_table(project, Split.TRAIN))


def _numbers(row: Row) -> dict[str, object]:
    nan = float("nan")
    none = Interval(nan, nan)
    test, intervals = row.test, row.intervals
    return {
        "subset": row.name.value,
        "n_used": row.train.n_used,
        "train_n_recognized": row.train.n_recognized,
        "train_n_images": row.train.n_images,
        "train_R_ave": row.train.R_ave,
        "train_R_invalid": row.train.R_invalid,
        "test_n_recognized": test.n_recognized if test else nan,
        "test_n_images": test.n_images if test else nan,
        "test_R_ave": test.R_ave if test else nan,
        "test_R_invalid": test.R_invalid if test else nan,
        "test_R_img_low": (intervals.R_img if intervals else none).low,
        "test_R_img_high": (intervals.R_img if intervals else none).high,
        "test_R_ave_low": (intervals.R_ave if intervals else none).low,
        "test_R_ave_high": (intervals.R_ave if intervals else none).high,
        "test_R_invalid_low": (intervals.R_invalid if intervals else none).low,
        "test_R_invalid_high": (intervals.R_invalid if intervals else none).high,
    }


def _words(row: Row) -> dict[str, object]:
    words: dict[str, object] = {
        "subset": row.name.value,
        "questions": row.train.n_used,
        "train: recognized": f"{row.train.n_recognized} of {row.train.n_images}",
        "train: R_ave": f"{row.train.R_ave:.3f}",
        "train: R_invalid": f"{row.train.R_invalid:.3f}",
    }
    test, intervals = row.test, row.intervals
    if test is None or intervals is None:
        return words | dict.fromkeys(("test: recognized", "test: R_ave", "test: R_invalid"), "–")
    low, high = (test.n_images * end for end in (intervals.R_img.low, intervals.R_img.high))
    return words | {
        "test: recognized": f"{test.n_recognized} of {test.n_images} ({low:.1f}–{high:.1f})",
        "test: R_ave": _with_interval(test.R_ave, intervals.R_ave),
        "test: R_invalid": _with_interval(test.R_invalid, intervals.R_invalid),
    }


def _with_interval(value: float, interval: Interval) -> str:
    return f"{value:.3f} ({interval.low:.3f}–{interval.high:.3f})"
