"""Answers about measured pictures, kept on disk, so that a stopped measuring goes on."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

from vqa_state.answers.table import AnswerTable
from vqa_state.embedded_training.dataset import Example
from vqa_state.embedded_training.digests import digest, digest_file
from vqa_state.embedded_training.measuring import ask, labels_of, names_of
from vqa_state.images.augmentation import Augmentation
from vqa_state.models.embedded.predictor import Predictor
from vqa_state.questions.grid import Question

__all__ = ["Asker"]


@dataclass(frozen=True, slots=True)
class Asker:
    """Asks a model about pictures, each table of answers once.

    A table is found again by the weights, the pictures' bytes, the questions and the copies.
    After a change of the network's code, give another folder.

    Attributes:
        predictor: answers what is not yet kept.
        weights: digest of its weights.
        folder: where the tables are kept.
    """

    predictor: Predictor
    weights: str
    folder: Path

    def ask(self, examples: Sequence[Example], questions: tuple[Question, ...]) -> AnswerTable:
        """All answers about some pictures, from the folder or from the model."""
        file = self.folder / f"{self._name(examples, questions)}.safetensors"
        if not file.exists():
            table = ask(self.predictor, examples, questions)
            self.folder.mkdir(parents=True, exist_ok=True)
            unfinished = file.with_suffix(".part")
            save_file({"verdicts": table.verdicts, "p_positive": table.p_positive}, unfinished)
            unfinished.replace(file)
        kept = load_file(file)
        verdicts = kept["verdicts"].astype(np.int8)
        p_positive = kept["p_positive"].astype(np.float32)
        labels = labels_of(examples)
        return AnswerTable(names_of(examples), questions, verdicts, p_positive, labels)

    def _name(self, examples: Sequence[Example], questions: Sequence[Question]) -> str:
        asked = [[question.text, question.yes_means] for question in questions]
        pictures = [digest_file(example.path) for example in examples]
        return digest(self.weights, pictures, asked, asdict(Augmentation()))
