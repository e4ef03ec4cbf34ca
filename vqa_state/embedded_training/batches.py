"""Batches: which pictures, which questions, and the right answers."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from vqa_state.embedded_training.cache import digest
from vqa_state.embedded_training.dataset import Example
from vqa_state.embedded_training.scenes import THINGS
from vqa_state.embedded_training.training_questions import TrainingQuestion, make_training_questions
from vqa_state.models.embedded.text import encode_questions
from vqa_state.models.embedded.vocabulary import ANSWERS

__all__ = ["UNKNOWN", "BatchSampler", "TrainingBatch"]

#: The target of a question without a known answer for a picture; the loss leaves it out.
UNKNOWN = -100


@dataclass(frozen=True, slots=True)
class TrainingBatch:
    """Pictures and their questions.

    `rows` (n_images,) are positions in the list of examples. `buckets` are the batch's different
    questions, `asked` (n_images, n_questions) picks from them, `targets` are the right answers.
    `states` (n_images,) are 1 for positive pictures, 0 for others; `things` (n_images,) are
    positions in THINGS; `meanings`, one for each of the different questions, are what "yes" says:
    0 the positive state, 1 the negative one, 2 neither, `UNKNOWN` for questions about evidence.
    """

    rows: NDArray[np.int64]
    buckets: Tensor
    asked: Tensor
    targets: Tensor
    states: Tensor
    things: Tensor
    meanings: Tensor


class BatchSampler:
    """Draws batches from examples; rare kinds of pictures come up more often than their share."""

    def __init__(self, examples: Sequence[Example], n_questions: int, seed: int) -> None:
        """Make up to `n_questions` different questions about each thing that the examples show."""
        self._rng = np.random.default_rng([seed, 1])
        self._seed = seed
        self._examples = examples
        things = sorted({example.thing for example in examples})
        self._asked = {
            thing: make_training_questions(thing, n_questions, self._rng) for thing in things
        }
        self._buckets = {
            thing: torch.from_numpy(encode_questions([question.text for question in questions]))
            for thing, questions in self._asked.items()
        }
        self._targets = [_targets(example, self._asked[example.thing]) for example in examples]
        self._shares = _shares(examples)

    @property
    def questions(self) -> str:
        """A digest of all questions that may be drawn, and of their answers."""
        return digest(
            *([thing, [repr(one) for one in questions]] for thing, questions in self._asked.items())
        )

    def restart(self, stage: int) -> None:
        """Draw anew, so that a stage draws the same whether or not another ran before it."""
        self._rng = np.random.default_rng([self._seed, 2, stage])

    def draw(self, n_images: int, n_questions: int) -> TrainingBatch:
        """A batch in which all pictures of a thing are asked the same questions.

        That keeps the number of different questions, which cost much to read, small.
        """
        rows = self._rng.choice(len(self._examples), n_images, p=self._shares)
        drawn = [self._examples[row] for row in rows]
        things = sorted({example.thing for example in drawn})
        chosen = {
            thing: self._rng.choice(len(self._asked[thing]), n_questions, replace=False)
            for thing in things
        }
        buckets = torch.cat([self._buckets[thing][chosen[thing]] for thing in things])
        longest = int((buckets[:, :, 0] > 0).sum(dim=1).max())
        first = {thing: number * n_questions for number, thing in enumerate(things)}
        asked = np.stack([first[example.thing] + np.arange(n_questions) for example in drawn])
        targets = [
            self._targets[row][chosen[example.thing]]
            for row, example in zip(rows, drawn, strict=True)
        ]
        meanings = [_meaning(self._asked[thing][n]) for thing in things for n in chosen[thing]]
        return TrainingBatch(
            rows=rows,
            buckets=buckets[:, :longest],
            asked=torch.from_numpy(asked),
            targets=torch.from_numpy(np.stack(targets)),
            states=torch.tensor([float(example.is_positive) for example in drawn]),
            things=torch.tensor([THINGS.index(example.thing) for example in drawn]),
            meanings=torch.tensor(meanings),
        )


def _meaning(question: TrainingQuestion) -> int:
    if question.evidence is not None:
        return UNKNOWN
    return {("yes", "no"): 0, ("no", "yes"): 1}.get((question.when_true, question.when_false), 2)


def _targets(example: Example, questions: Sequence[TrainingQuestion]) -> NDArray[np.int64]:
    answers = [question.answer(example.is_positive, example.facts) for question in questions]
    numbers = [UNKNOWN if answer is None else ANSWERS.index(answer) for answer in answers]
    return np.array(numbers, np.int64)


def _shares(examples: Sequence[Example]) -> NDArray[np.float64]:
    """Probabilities: a source's share grows with the square root of its size, states are even.

    A source is one thing as rendered here, in a simulator, or photographed. Photos are worth twice
    their share, since people ask about photos.
    """
    sources = [(example.thing, example.scene.partition("/")[0]) for example in examples]
    states = [example.is_positive for example in examples]
    sizes = Counter(sources)
    both = Counter(zip(sources, states, strict=True))
    weights = np.array(
        [
            sizes[source] ** 0.5 / both[source, state] * (2 if source[1] == "photo" else 1)
            for source, state in zip(sources, states, strict=True)
        ]
    )
    return np.asarray(weights / weights.sum())
