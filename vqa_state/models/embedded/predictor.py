"""Runs the network: each picture and each question is encoded once, then all pairs are answered."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from PIL.Image import Image
from torch import Tensor

from vqa_state.models.embedded.network import N_VIEWS, VQANetwork
from vqa_state.models.embedded.pixels import normalise, to_square
from vqa_state.models.embedded.text import encode_questions, view_of
from vqa_state.models.embedded.vocabulary import ANSWERS, NO, YES
from vqa_state.models.embedded.weights import WEIGHTS, load_network

__all__ = ["MAX_IMAGES", "Predictor", "ReadQuestions"]

#: Images that go through the network together. Their number changes no digit of any answer
#: (measured, and tested in tests/models/embedded/test_model.py).
MAX_IMAGES = 8

#: Questions of each view are answered in blocks of this many, filled up with nothing. A matrix
#: product of few rows rounds differently; blocks of one shape give the same answer to a question
#: whatever is asked beside it.
_BLOCK = 8

#: Questions whose slots are kept, 2.5 kB each.
_MAX_CACHED = 4096


@dataclass(frozen=True, slots=True)
class ReadQuestions:
    """Questions as the network reads them, sorted by view.

    Attributes:
        blocks: each (n_views, `_BLOCK`, n_slots, width).
        places: of every question, in the order in which they were given, its block, its view and
            its row there.
    """

    blocks: tuple[Tensor, ...]
    places: tuple[tuple[int, int, int], ...]


class Predictor:
    """Answers with text and p_yes. May be used from several threads at once."""

    def __init__(self, path: Path = WEIGHTS) -> None:
        """Load the weights.

        Raises:
            ModelError: if they are missing or damaged.
        """
        self._network: VQANetwork = load_network(path)
        self._slots = lru_cache(_MAX_CACHED)(self._read_one)

    @torch.inference_mode()
    def read(self, questions: Sequence[str]) -> ReadQuestions:
        """Encode questions; those that were read before come from a cache."""
        filled = [0] * N_VIEWS
        places = []
        for question in questions:
            view = view_of(question, N_VIEWS)
            block, row = divmod(filled[view], _BLOCK)
            places.append((block, view, row))
            filled[view] += 1
        n_blocks = -(-max(filled) // _BLOCK)
        shape = self._network.read.slots.shape
        blocks = [torch.zeros(N_VIEWS, _BLOCK, *shape) for _ in range(n_blocks)]
        for question, (block, view, row) in zip(questions, places, strict=True):
            blocks[block][view, row] = self._slots(question)
        return ReadQuestions(tuple(blocks), tuple(places))

    @torch.inference_mode()
    def answer(
        self, images: Sequence[Image], questions: ReadQuestions
    ) -> list[list[tuple[str, float]]]:
        """For each image the answer to each question that `read` has read.

        An answer is a text and P(yes) / (P(yes) + P(no)). Give at most `MAX_IMAGES` at once: more
        take more memory and no less time.
        """
        pixels = torch.from_numpy(normalise(np.stack(list(map(to_square, images)))))
        memory = self._network.encode_images(pixels.contiguous(memory_format=torch.channels_last))
        answered = torch.stack(
            [
                self._network.answer(memory, block.expand(len(images), -1, -1, -1, -1))
                for block in questions.blocks
            ],
            dim=1,
        )  # (n_images, n_blocks, n_views, _BLOCK, n_answers)
        where = torch.tensor(questions.places).T
        logits = answered[:, where[0], where[1], where[2]]
        best = logits.argmax(dim=-1).tolist()
        difference = logits[..., YES] - logits[..., NO]
        yes = torch.sigmoid(difference / self._network.temperature).tolist()
        # Later digits than the sixth are the machine's, not the model's.
        return [
            [(ANSWERS[number], round(p_yes, 6)) for number, p_yes in zip(*row, strict=True)]
            for row in zip(best, yes, strict=True)
        ]

    def _read_one(self, question: str) -> Tensor:
        """The slots of one question, read alone, at its own length."""
        buckets = torch.from_numpy(encode_questions([question]))
        n_words = int((buckets[0, :, 0] > 0).sum())
        slots: Tensor = self._network.read(buckets[:, :n_words])[0]
        return slots
