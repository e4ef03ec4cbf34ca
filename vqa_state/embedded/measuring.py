"""How good the embedded model is: held-out scenes and photos, by the paper's own rules."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from vqa_state.answers import Answer, AnswerTable
from vqa_state.augment import Augmentation, copies
from vqa_state.embedded.dataset import Example
from vqa_state.embedded.experiments import questions_about
from vqa_state.embedded.predictor import Predictor
from vqa_state.images import pixel_hash
from vqa_state.scores import Counts, Objective, SubsetScore, count, question_stats, score
from vqa_state.search.genetic import search

__all__ = ["N_TRAINING", "PhotoNumbers", "SceneNumbers", "ask", "measure_photos", "measure_scenes"]

#: Pictures that s+ is chosen on, half of them a state; as many as in the paper.
N_TRAINING = 20

_SEED = 0


@dataclass(frozen=True, slots=True)
class SceneNumbers:
    """One thing, on held-out scenes that were not used to choose the questions.

    Attributes:
        thing: which.
        n_test: pictures tested, half of them a state.
        s_plus: recognized with the questions that the search chose on 20 others.
        s_all: recognized with all questions.
        positive, negative: recognized of each state with s+; they show a lean.
        n_questions, n_used: questions of the grid, and those in s+.
        invalid: share of Invalid answers over all questions.
        single_min, single_median, single_max: accuracy of single questions among valid answers.
    """

    thing: str
    n_test: int
    s_plus: int
    s_all: int
    positive: int
    negative: int
    n_questions: int
    n_used: int
    invalid: float
    single_min: float
    single_median: float
    single_max: float


@dataclass(frozen=True, slots=True)
class PhotoNumbers:
    """One thing on real photos that no training has seen.

    The recognized numbers are with all questions; `balanced` is the mean of the two states'
    recognized shares, `s_plus_balanced` the same with the questions chosen on scenes.
    """

    thing: str
    n_positive: int
    n_negative: int
    positive: int
    negative: int
    balanced: float
    s_plus_balanced: float
    invalid: float


def ask(predictor: Predictor, examples: Sequence[Example]) -> AnswerTable:
    """All answers about pictures of one thing: the paper's six shifted copies and its grid."""
    questions = questions_about(examples[0].thing)
    meanings = [question.yes_means for question in questions]
    slots = predictor.read([question.text for question in questions])
    verdicts = np.zeros((len(examples), Augmentation().n_copies, len(questions)), np.int8)
    p_positive = np.zeros(verdicts.shape, np.float32)
    for row, example in enumerate(examples):
        for copy_number, answers in enumerate(predictor.answer(_copies(example), slots)):
            for column, (text, p_yes) in enumerate(answers):
                meaning = meanings[column]
                verdicts[row, copy_number, column] = Answer(text, p_yes).verdict(meaning)
                p_positive[row, copy_number, column] = p_yes if meaning > 0 else 1 - p_yes
    labels = np.array([1 if example.is_positive else -1 for example in examples], np.int8)
    names = tuple(str(example.path) for example in examples)
    return AnswerTable(names, questions, verdicts, p_positive, labels)


def measure_scenes(thing: str, table: AnswerTable) -> tuple[SceneNumbers, tuple[int, ...]]:
    """Choose s+ on the first 20 pictures, test on all others; the numbers and s+."""
    is_training = np.arange(table.n_images) < N_TRAINING
    chosen = _s_plus(count(table.take(is_training)))
    counts = count(table.take(~is_training))
    best, everything = score(counts, chosen), score(counts, range(table.n_questions))
    single = question_stats(counts).accuracy
    numbers = SceneNumbers(
        thing=thing,
        n_test=counts.n_images,
        s_plus=best.n_recognized,
        s_all=everything.n_recognized,
        positive=_recognized(best, counts, 1),
        negative=_recognized(best, counts, -1),
        n_questions=table.n_questions,
        n_used=len(chosen),
        invalid=round(everything.R_invalid, 4),
        single_min=round(float(np.nanmin(single)), 3),
        single_median=round(float(np.nanmedian(single)), 3),
        single_max=round(float(np.nanmax(single)), 3),
    )
    return numbers, chosen


def measure_photos(thing: str, table: AnswerTable, s_plus: Sequence[int]) -> PhotoNumbers:
    """Score photos with all questions, and with those chosen on scenes."""
    counts = count(table)
    everything = score(counts, range(table.n_questions))
    return PhotoNumbers(
        thing=thing,
        n_positive=int((counts.labels == 1).sum()),
        n_negative=int((counts.labels == -1).sum()),
        positive=_recognized(everything, counts, 1),
        negative=_recognized(everything, counts, -1),
        balanced=round(_balanced(everything, counts), 3),
        s_plus_balanced=round(_balanced(score(counts, s_plus), counts), 3),
        invalid=round(everything.R_invalid, 4),
    )


def _s_plus(counts: Counts) -> tuple[int, ...]:
    subset: tuple[int, ...] = ()
    for report in search(counts, Objective.S_PLUS, seed=_SEED):
        subset = report.subset
    return subset


def _recognized(result: SubsetScore, counts: Counts, label: int) -> int:
    return int(result.recognized[counts.labels == label].sum())


def _balanced(result: SubsetScore, counts: Counts) -> float:
    shares = [
        _recognized(result, counts, label) / max(1, int((counts.labels == label).sum()))
        for label in (1, -1)
    ]
    return math.fsum(shares) / 2


def _copies(example: Example) -> list[Image.Image]:
    with Image.open(example.path) as image:
        pixels = image.convert("RGB")
    return list(copies(pixels, pixel_hash(pixels), Augmentation(), _SEED))
