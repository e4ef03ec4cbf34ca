"""How good the embedded model is on one task, by the paper's rules, averaged over random draws."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vqa_state.answers import Answer, AnswerTable
from vqa_state.augment import Augmentation, copies
from vqa_state.embedded.dataset import Example
from vqa_state.embedded.predictor import Predictor
from vqa_state.images import pixel_hash
from vqa_state.questions import Question
from vqa_state.scores import Counts, Objective, count, question_stats, score
from vqa_state.search.genetic import search

__all__ = ["N_DRAWS", "N_PER_STATE", "TaskNumbers", "ask", "balanced", "measure_task"]

#: Labelled pictures of each state that s+ is chosen on; as many as in the paper.
N_PER_STATE = 10

#: Random choices of those pictures.
N_DRAWS = 20

_SEED = 0


@dataclass(frozen=True, slots=True)
class TaskNumbers:
    """One task. Accuracies are balanced: the mean of the two states' recognized shares, in [0, 1].

    `s_plus`, `single` and `s_all` are means over draws, each tested on the pictures that were not
    drawn. `s_plus` and `single` choose among all questions, `s_all` asks the paper's grid,
    `all_questions` everything. None where a state has too few pictures to draw from.

    Attributes:
        name: the task; `group` is scenes, foreign or photos.
        n_positive, n_negative: pictures of each state.
        s_plus: the search's choice on 20 labelled pictures.
        s_plus_grid: the same, choosing in the paper's grid only.
        single: the question that is best on the same 20.
        s_all: the paper's grid.
        all_questions: grid and cues together.
        called_positive: share of all pictures that the grid calls positive; 0.5 has no lean.
        n_grid, n_questions: questions of the grid, and with cues.
        n_used: mean number of questions in s+.
        invalid: share of Invalid answers in the grid.
        single_min, single_median, single_max, single_sd: accuracy of single questions among valid
            answers, over all questions.
        gain_over_all, gain_over_single: for every picture, in how much larger a share of the draws
            s+ recognized it when it was tested.
    """

    name: str
    group: str
    n_positive: int
    n_negative: int
    s_plus: float | None
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
    gain_over_all: list[float] = field(default_factory=list)
    gain_over_single: list[float] = field(default_factory=list)


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
    labels = np.array([1 if example.is_positive else -1 for example in examples], np.int8)
    names = tuple(str(example.path) for example in examples)
    return AnswerTable(names, questions, verdicts, p_positive, labels)


def measure_task(
    name: str, group: str, table: AnswerTable, n_grid: int, n_draws: int = N_DRAWS
) -> TaskNumbers:
    """Draw 20 pictures, choose, test on the others, again and again.

    The first `n_grid` questions of the table are the paper's grid, the others are cues.
    """
    counts = count(table)
    grid, everything = range(n_grid), range(table.n_questions)
    accuracy = question_stats(counts).accuracy
    both_states = min(int((table.labels == state).sum()) for state in (1, -1))
    draws = _Draws(table, n_grid)
    if both_states > N_PER_STATE:
        for number in range(n_draws):
            draws.add(np.random.default_rng([_SEED, number]))
    of_grid = score(counts, grid)
    return TaskNumbers(
        name=name,
        group=group,
        n_positive=int((table.labels == 1).sum()),
        n_negative=int((table.labels == -1).sum()),
        s_plus=draws.mean("s_plus"),
        s_plus_grid=draws.mean("s_plus_grid"),
        single=draws.mean("single"),
        s_all=draws.mean("s_all") or round(balanced(of_grid.recognized, counts.labels), 4),
        all_questions=draws.mean("all_questions")
        or round(balanced(score(counts, everything).recognized, counts.labels), 4),
        called_positive=round(_called_positive(of_grid.recognized, counts.labels), 4),
        n_grid=n_grid,
        n_questions=table.n_questions,
        n_used=draws.mean("n_used"),
        invalid=round(of_grid.R_invalid, 4),
        single_min=round(float(np.nanmin(accuracy)), 3),
        single_median=round(float(np.nanmedian(accuracy)), 3),
        single_max=round(float(np.nanmax(accuracy)), 3),
        single_sd=round(float(np.nanstd(accuracy)), 3),
        gain_over_all=draws.gain("s_all"),
        gain_over_single=draws.gain("single"),
    )


class _Draws:
    """Collects what every draw recognized of the pictures that it left for testing."""

    def __init__(self, table: AnswerTable, n_grid: int) -> None:
        self._table = table
        self._grid = tuple(range(n_grid))
        self._values: dict[str, list[float]] = {}
        self._n_tested = np.zeros(table.n_images)
        self._recognized: dict[str, NDArray[np.float64]] = {}

    def add(self, rng: np.random.Generator) -> None:
        """Choose on ten random pictures a state, test on all others."""
        is_training = np.zeros(self._table.n_images, bool)
        for state in (1, -1):
            own = np.flatnonzero(self._table.labels == state)
            is_training[rng.choice(own, N_PER_STATE, replace=False)] = True
        training = count(self._table.take(is_training))
        tested = count(self._table.take(~is_training))
        s_plus = _s_plus(training, range(training.n_questions))
        chosen = {
            "s_plus": s_plus,
            "s_plus_grid": _s_plus(training, self._grid),
            "single": (_best_single(training),),
            "s_all": self._grid,
            "all_questions": tuple(range(training.n_questions)),
        }
        self._n_tested += ~is_training
        self._values.setdefault("n_used", []).append(len(s_plus))
        for name, subset in chosen.items():
            recognized = score(tested, subset).recognized
            total = self._recognized.setdefault(name, np.zeros(self._table.n_images))
            total[~is_training] += recognized
            self._values.setdefault(name, []).append(balanced(recognized, tested.labels))

    def mean(self, name: str) -> float | None:
        """The mean over draws, or None without any."""
        values = self._values.get(name)
        return None if values is None else round(math.fsum(values) / len(values), 4)

    def gain(self, other: str) -> list[float]:
        """Of every tested picture: the share of draws with s+ minus that with `other`."""
        if not self._recognized:
            return []
        tested = self._n_tested > 0
        gains = (self._recognized["s_plus"] - self._recognized[other])[tested]
        return [round(float(gain), 4) for gain in gains / self._n_tested[tested]]


def balanced(recognized: NDArray[np.bool_], labels: NDArray[np.int8]) -> float:
    """The mean of the two states' recognized shares, in [0, 1]."""
    return math.fsum(float(recognized[labels == state].mean()) for state in (1, -1)) / 2


def _called_positive(recognized: NDArray[np.bool_], labels: NDArray[np.int8]) -> float:
    """The mean over both states of the share that is called positive."""
    of_positive = float(recognized[labels == 1].mean())
    return (of_positive + 1 - float(recognized[labels == -1].mean())) / 2


def _s_plus(counts: Counts, columns: Sequence[int]) -> tuple[int, ...]:
    """The search's choice among some of the questions."""
    own = np.array(columns)
    part = Counts(
        counts.correct[:, own], counts.wrong[:, own], counts.invalid[:, own], counts.labels
    )
    subset: tuple[int, ...] = ()
    for report in search(part, Objective.S_PLUS, seed=_SEED):
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
