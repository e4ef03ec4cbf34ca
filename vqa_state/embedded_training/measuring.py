"""How good the embedded model is on one task, by the paper's rules, averaged over random draws."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vqa_state.answers.parse import Answer
from vqa_state.answers.rates import Counts, count, question_stats, score
from vqa_state.answers.table import AnswerTable
from vqa_state.embedded_training.dataset import Example
from vqa_state.embedded_training.intervals import Tally, balanced_interval
from vqa_state.images.augmentation import Augmentation, copies
from vqa_state.images.reading import pixel_hash
from vqa_state.models.embedded.predictor import Predictor
from vqa_state.questions.grid import Question
from vqa_state.search.genetic import search
from vqa_state.search.objectives import Objective

__all__ = [
    "N_DRAWS",
    "N_PER_STATE",
    "WAYS",
    "TaskNumbers",
    "ask",
    "balanced",
    "labels_of",
    "measure_task",
    "names_of",
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
    return AnswerTable(names_of(examples), questions, verdicts, p_positive, labels_of(examples))


def labels_of(examples: Sequence[Example]) -> NDArray[np.int8]:
    """+1 for the positive state, -1 for the other."""
    return np.array([1 if example.is_positive else -1 for example in examples], np.int8)


def names_of(examples: Sequence[Example]) -> tuple[str, ...]:
    """What the pictures are called in tables."""
    return tuple(str(example.path) for example in examples)


def measure_task(
    name: str, group: str, table: AnswerTable, n_grid: int, n_draws: int = N_DRAWS
) -> TaskNumbers:
    """Draw 20 pictures, choose, test on the others, again and again.

    The first `n_grid` questions of the table are the paper's grid, the others are cues.
    """
    counts = count(table)
    of_grid = score(counts, range(n_grid)).recognized
    draws = _Draws(table, n_grid)
    if min(int((table.labels == state).sum()) for state in (1, -1)) > N_PER_STATE:
        for number in range(n_draws):
            draws.add(np.random.default_rng([_SEED, number]))
    else:
        draws.add_unsearched()
    tally = draws.tally()
    means = {way: round(tally.balanced(way), 4) for way in tally.recognized}
    return TaskNumbers(
        name=name,
        group=group,
        n_positive=int((table.labels == 1).sum()),
        n_negative=int((table.labels == -1).sum()),
        s_plus=means.get("s_plus"),
        s_plus_random=means.get("s_plus_random"),
        s_plus_grid=means.get("s_plus_grid"),
        single=means.get("single"),
        s_all=means["s_all"],
        all_questions=means["all_questions"],
        called_positive=round(_called_positive(of_grid, counts.labels), 4),
        n_grid=n_grid,
        n_questions=table.n_questions,
        n_used=draws.n_used(),
        invalid=round(score(counts, range(n_grid)).R_invalid, 4),
        **_spread_of_singles(counts),
        intervals={way: balanced_interval(tally, way) for way in means},
        tally=tally,
    )


def whole_tally(table: AnswerTable) -> Tally:
    """All questions, on all pictures, once; the way is called "asked"."""
    recognized = score(count(table), range(table.n_questions)).recognized
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


class _Draws:
    """Collects what every draw recognized of the pictures that it left for testing."""

    def __init__(self, table: AnswerTable, n_grid: int) -> None:
        self._table = table
        self._grid = tuple(range(n_grid))
        self._everything = tuple(range(table.n_questions))
        self._used: list[int] = []
        self._tested = np.zeros(table.n_images, np.int64)
        self._recognized: dict[str, NDArray[np.int64]] = {}

    def add(self, rng: np.random.Generator) -> None:
        """Choose on ten random pictures a state, test on all others."""
        is_training = np.zeros(self._table.n_images, bool)
        for state in (1, -1):
            own = np.flatnonzero(self._table.labels == state)
            is_training[rng.choice(own, N_PER_STATE, replace=False)] = True
        training = count(self._table.take(is_training))
        chosen = {
            "s_plus": _s_plus(training, self._everything),
            "s_plus_random": _s_plus(training, self._everything, singles_first=False),
            "s_plus_grid": _s_plus(training, self._grid),
            "single": (_best_single(training),),
            "s_all": self._grid,
            "all_questions": self._everything,
        }
        self._used.append(len(chosen["s_plus"]))
        self._test(~is_training, chosen)

    def add_unsearched(self) -> None:
        """Test what needs no choice on all pictures."""
        everywhere = np.ones(self._table.n_images, bool)
        self._test(everywhere, {"s_all": self._grid, "all_questions": self._everything})

    def tally(self) -> Tally:
        """What became of every picture."""
        recognized = {way: times.tolist() for way, times in self._recognized.items()}
        return Tally(self._table.labels.tolist(), self._tested.tolist(), recognized)

    def n_used(self) -> float | None:
        """Mean number of questions in s+, or None without a search."""
        return round(sum(self._used) / len(self._used), 4) if self._used else None

    def _test(self, is_tested: NDArray[np.bool_], chosen: Mapping[str, tuple[int, ...]]) -> None:
        tested = count(self._table.take(is_tested))
        self._tested += is_tested
        for way, subset in chosen.items():
            total = self._recognized.setdefault(way, np.zeros(self._table.n_images, np.int64))
            total[is_tested] += score(tested, subset).recognized


def balanced(recognized: NDArray[np.bool_], labels: NDArray[np.int8]) -> float:
    """The mean of the two states' recognized shares, in [0, 1]."""
    return math.fsum(float(recognized[labels == state].mean()) for state in (1, -1)) / 2


def _called_positive(recognized: NDArray[np.bool_], labels: NDArray[np.int8]) -> float:
    """The mean over both states of the share that is called positive."""
    of_positive = float(recognized[labels == 1].mean())
    return (of_positive + 1 - float(recognized[labels == -1].mean())) / 2


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
