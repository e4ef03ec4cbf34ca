"""Measures the embedded model on one task, by the paper's rules, averaged over random draws."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vqa_state.answers.answer import Answer
from vqa_state.answers.rates import Counts, count, question_stats, score
from vqa_state.answers.table import AnswerTable
from vqa_state.embedded_training.dataset import Example
from vqa_state.embedded_training.intervals import Tally, balanced_interval
from vqa_state.images import pixel_hash
from vqa_state.images.augmentation import Augmentation, copies
from vqa_state.models.embedded.predictor import Predictor
from vqa_state.questions.grid import Question
from vqa_state.search.genetic import search
from vqa_state.search.objectives import Objective

__all__ = [
    "N_DRAWS",
    "N_PER_STATE",
    "WAYS",
    "TaskNumbers",
    "answer_table",
    "ask",
    "measure_task",
    "whole_tally",
]

#: Labelled pictures of each state that s+ is chosen on; as many as in the paper.
N_PER_STATE = 10

#: Random choices of those pictures.
N_DRAWS = 20

#: Ways of choosing questions, see `TaskNumbers`.
WAYS = ("s_plus", "s_plus_random", "s_plus_grid", "s_all", "all_questions", "single")

_SEED = 0


@dataclass(frozen=True, slots=True)
class TaskNumbers:
    """One task. Accuracies are balanced: the mean of the two states' recognized shares, in [0, 1].

    The ways of choosing questions (`WAYS`) are means over draws, each tested on the pictures that
    were not drawn. None where a state has too few pictures to draw from; then `s_all` and
    `all_questions` are tested on all pictures, once.

    Attributes:
        name: the task; `group` is scenes, foreign or photos.
        n_positive, n_negative: pictures of each state.
        s_plus: the search's choice on 20 labelled pictures, among all questions.
        s_plus_random: the same from a random first population, the paper's search to the letter.
        s_plus_grid: the same as `s_plus`, choosing in the paper's grid only.
        single: the question that is best on the same 20, among all questions.
        s_all: the paper's grid.
        all_questions: grid and cues together.
        called_positive: share of all pictures that the grid calls positive; 0.5 has no lean.
        n_grid, n_questions: questions of the grid, and with cues.
        n_used: mean number of questions in s+.
        invalid: share of Invalid answers in the grid.
        single_min, single_median, single_max, single_sd: accuracy of single questions among valid
            answers, over all questions.
        intervals: 95 % intervals of the ways that were tested.
        tally: how often each picture was tested and recognized.
    """

    name: str
    group: str
    n_positive: int
    n_negative: int
    s_plus: float | None
    s_plus_random: float | None
    s_plus_grid: float | None
    single: float | None
    s_all: float
    all_questions: float
    called_positive: float
    n_grid: int
    n_questions: int
    n_used: float | None
    invalid: float
    single_min: float
    single_median: float
    single_max: float
    single_sd: float
    intervals: dict[str, list[float]]
    tally: Tally


def ask(
    predictor: Predictor, examples: Sequence[Example], questions: tuple[Question, ...]
) -> AnswerTable:
    """All answers about some pictures: the paper's six shifted copies, every question."""
    meanings = [question.yes_means for question in questions]
    read = predictor.read([question.text for question in questions])
    verdicts = np.zeros((len(examples), Augmentation().n_copies, len(questions)), np.int8)
    p_positive = np.zeros(verdicts.shape, np.float32)
    for row, example in enumerate(examples):
        for copy_number, answers in enumerate(predictor.answer(_copies(example), read)):
            for column, (text, p_yes) in enumerate(answers):
                meaning = meanings[column]
                verdicts[row, copy_number, column] = Answer(text, p_yes).verdict(meaning)
                p_positive[row, copy_number, column] = p_yes if meaning > 0 else 1 - p_yes
    return answer_table(examples, questions, verdicts, p_positive)


def answer_table(
    examples: Sequence[Example],
    questions: tuple[Question, ...],
    verdicts: NDArray[np.int8],
    p_positive: NDArray[np.float32],
) -> AnswerTable:
    """A table of (n_images, n_copies, n_questions) answers, with the pictures' paths and labels."""
    names = tuple(str(example.path) for example in examples)
    labels = np.array([1 if example.is_positive else -1 for example in examples], np.int8)
    return AnswerTable(names, questions, verdicts, p_positive, labels)


def measure_task(
    name: str, group: str, table: AnswerTable, n_grid: int, n_draws: int = N_DRAWS
) -> TaskNumbers:
    """Draw 20 pictures, choose, test on the others, again and again.

    The first `n_grid` questions of the table are the paper's grid, the others are cues.
    """
    counts, grid = count(table), tuple(range(n_grid))
    tally, n_used = _tally_of_draws(table, grid, n_draws)
    means = {way: round(tally.balanced(way), 4) for way in tally.recognized}
    ways: dict[str, Any] = {way: means.get(way) for way in WAYS}
    return TaskNumbers(
        name=name,
        group=group,
        n_positive=int((table.labels == 1).sum()),
        n_negative=int((table.labels == -1).sum()),
        **ways,
        called_positive=round(whole_tally(table, grid).called_positive("asked"), 4),
        n_grid=n_grid,
        n_questions=table.n_questions,
        n_used=round(float(np.mean(n_used)), 4) if n_used else None,
        invalid=round(score(counts, grid).R_invalid, 4),
        **_spread_of_singles(counts),
        intervals={way: balanced_interval(tally, way) for way in means},
        tally=tally,
    )


def whole_tally(table: AnswerTable, subset: Sequence[int]) -> Tally:
    """Some questions, on all pictures, once; the way is called "asked"."""
    recognized = score(count(table), subset).recognized
    once = np.ones(table.n_images, int).tolist()
    return Tally(table.labels.tolist(), once, {"asked": recognized.astype(int).tolist()})


def _spread_of_singles(counts: Counts) -> dict[str, float]:
    accuracy = question_stats(counts).accuracy
    return {
        "single_min": round(float(np.nanmin(accuracy)), 3),
        "single_median": round(float(np.nanmedian(accuracy)), 3),
        "single_max": round(float(np.nanmax(accuracy)), 3),
        "single_sd": round(float(np.nanstd(accuracy)), 3),
    }


def _tally_of_draws(
    table: AnswerTable, grid: tuple[int, ...], n_draws: int
) -> tuple[Tally, list[int]]:
    """What every draw recognized of the pictures left for testing; the sizes of s+, one a draw."""
    tested = np.zeros(table.n_images, np.int64)
    recognized: defaultdict[str, NDArray[np.int64]] = defaultdict(lambda: np.zeros_like(tested))
    n_used = []
    for is_training in _draws(table.labels, n_draws):
        chosen = {"s_all": grid, "all_questions": tuple(range(table.n_questions))}
        if is_training.any():
            chosen = {**_choose(count(table.take(is_training)), grid), **chosen}
            n_used.append(len(chosen["s_plus"]))
        left = count(table.take(~is_training))
        tested += ~is_training
        for way, subset in chosen.items():
            recognized[way][~is_training] += score(left, subset).recognized
    times = {way: found.tolist() for way, found in recognized.items()}
    return Tally(table.labels.tolist(), tested.tolist(), times), n_used


def _draws(labels: NDArray[np.int8], n_draws: int) -> Iterator[NDArray[np.bool_]]:
    """For every draw, on which pictures questions are chosen: ten random ones a state.

    Where a state has no more than ten pictures there is one draw, and nothing is chosen.
    """
    states = [np.flatnonzero(labels == state) for state in (1, -1)]
    if min(len(own) for own in states) <= N_PER_STATE:
        yield np.zeros(len(labels), bool)
        return
    for number in range(n_draws):
        rng = np.random.default_rng([_SEED, number])
        is_training = np.zeros(len(labels), bool)
        for own in states:
            is_training[rng.choice(own, N_PER_STATE, replace=False)] = True
        yield is_training


def _choose(training: Counts, grid: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
    """The questions that each searching way chooses on some pictures."""
    everything = tuple(range(training.n_questions))
    return {
        "s_plus": _s_plus(training, everything),
        "s_plus_random": _s_plus(training, everything, singles_first=False),
        "s_plus_grid": _s_plus(training, grid),
        "single": (_best_single(training),),
    }


def _s_plus(
    counts: Counts, columns: Sequence[int], *, singles_first: bool = True
) -> tuple[int, ...]:
    """The search's choice among some of the questions."""
    own = np.array(columns)
    part = Counts(
        counts.correct[:, own], counts.wrong[:, own], counts.invalid[:, own], counts.labels
    )
    subset: tuple[int, ...] = ()
    for report in search(part, Objective.S_PLUS, seed=_SEED, singles_first=singles_first):
        subset = report.subset
    return tuple(columns[number] for number in subset)


def _best_single(counts: Counts) -> int:
    """The question that recognizes most training pictures; ties go to the surer one, R_ave."""
    results = [score(counts, (number,)) for number in range(counts.n_questions)]
    return max(range(len(results)), key=lambda q: (results[q].n_recognized, results[q].R_ave, -q))


def _copies(example: Example) -> list[Image.Image]:
    with Image.open(example.path) as image:
        pixels = image.convert("RGB")
    return list(copies(pixels, pixel_hash(pixels), Augmentation(), _SEED))
