"""Answers and measured tasks, kept on disk, so that a stopped measuring goes on behind them."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from safetensors.numpy import load, save

from vqa_state.answers import rates
from vqa_state.answers.table import AnswerTable
from vqa_state.embedded_training import intervals, measuring
from vqa_state.embedded_training.cache import cached, digest, digest_file
from vqa_state.embedded_training.dataset import Example
from vqa_state.embedded_training.intervals import Tally
from vqa_state.embedded_training.measuring import (
    N_DRAWS,
    TaskNumbers,
    answer_table,
    ask,
    measure_task,
)
from vqa_state.images.augmentation import Augmentation
from vqa_state.models.embedded.predictor import Predictor
from vqa_state.questions.grid import Question
from vqa_state.search import genetic

__all__ = ["AnswerCache", "measure_once"]

#: Their code decides what is measured.
_CODE = (rates, genetic, measuring, intervals)


@dataclass(frozen=True, slots=True)
class AnswerCache:
    """Asks a model about pictures, each table of answers once.

    A table is found again by the weights, the pictures' bytes, the questions and the copies.
    After a change of the network's code, give another folder.

    Attributes:
        predictor: answers what is not in the cache.
        weights: digest of its weights.
        folder: where the tables are kept.
    """

    predictor: Predictor
    weights: str
    folder: Path

    def ask(self, examples: Sequence[Example], questions: tuple[Question, ...]) -> AnswerTable:
        """All answers about some pictures, from the folder or from the model."""
        pictures = [digest_file(example.path) for example in examples]
        name = digest(self.weights, pictures, _plain(questions), asdict(Augmentation()))

        def make() -> bytes:
            table = ask(self.predictor, examples, questions)
            return save({"verdicts": table.verdicts, "p_positive": table.p_positive})

        arrays = load(cached(self.folder / f"{name}.safetensors", make))
        return answer_table(examples, questions, **arrays)


def measure_once(
    folder: Path, name: str, group: str, table: AnswerTable, n_grid: int, n_draws: int = N_DRAWS
) -> TaskNumbers:
    """`measure_task`, or what it gave before for the same answers by the same code."""
    made_by = [digest_file(Path(str(module.__file__))) for module in _CODE]
    answers = [table.verdicts.tolist(), table.labels.tolist(), _plain(table.questions)]
    file = folder / f"{digest(name, group, n_grid, n_draws, made_by, answers)}.json"

    def make() -> bytes:
        return json.dumps(asdict(measure_task(name, group, table, n_grid, n_draws))).encode()

    row = json.loads(cached(file, make))
    return TaskNumbers(**{**row, "tally": Tally(**row["tally"])})


def _plain(questions: Sequence[Question]) -> list[list[object]]:
    return [[question.text, question.yes_means] for question in questions]
