"""Runs the network: every picture and every question through their own part once."""

import threading
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from PIL.Image import Image
from torch import Tensor

from vqa_state.embedded.network import VQANetwork
from vqa_state.embedded.pixels import normalise, to_square
from vqa_state.embedded.text import encode_questions
from vqa_state.embedded.vocabulary import ANSWERS, NO, YES
from vqa_state.embedded.weights import WEIGHTS, load_network

__all__ = ["MAX_IMAGES", "Predictor"]

#: Images that go through the network together. Their number changes no digit of any answer
#: (measured, and tested in tests/test_embedded.py).
MAX_IMAGES = 8

#: Questions are answered in blocks of this many, the last one filled up. A matrix product of fewer
#: than 16 rows rounds differently; blocks of one shape give the same answer to a question whatever
#: is asked beside it.
_BLOCK = 64

#: Questions whose slots are kept, 2.5 kB each.
_MAX_CACHED = 4096


class Predictor:
    """Answers with text and p_yes. May be used from several threads at once."""

    def __init__(self, path: Path = WEIGHTS) -> None:
        """Load the weights.

        Raises:
            ModelError: if they are missing or damaged.
        """
        self._network: VQANetwork = load_network(path)
        self._cache: OrderedDict[str, Tensor] = OrderedDict()
        self._lock = threading.Lock()

    @torch.inference_mode()
    def read(self, questions: Sequence[str]) -> Tensor:
        """What the network makes of questions: (n_questions, n_slots, width)."""
        return torch.stack([self._slots(question) for question in questions])

    @torch.inference_mode()
    def answer(self, images: Sequence[Image], slots: Tensor) -> list[list[tuple[str, float]]]:
        """For each image the answer to each question that `read` has read.

        An answer is a text and P(yes) / (P(yes) + P(no)). Give at most `MAX_IMAGES` at once: more
        take more memory and no less time.
        """
        pixels = torch.from_numpy(normalise(np.stack([to_square(image) for image in images])))
        memory = self._network.see(pixels.contiguous(memory_format=torch.channels_last))
        logits = torch.cat(
            [
                self._network.answer(memory, _filled(block).expand(len(images), -1, -1, -1))
                for block in torch.split(slots, _BLOCK)
            ],
            dim=1,
        )[:, : len(slots)]
        best = logits.argmax(dim=-1).tolist()
        yes = torch.sigmoid(logits[..., YES] - logits[..., NO]).tolist()
        # Later digits than the sixth are the machine's, not the model's.
        return [
            [(ANSWERS[number], round(p_yes, 6)) for number, p_yes in zip(*row, strict=True)]
            for row in zip(best, yes, strict=True)
        ]

    def _slots(self, question: str) -> Tensor:
        """The slots of one question, from the cache or read alone, at its own length."""
        with self._lock:
            if question in self._cache:
                self._cache.move_to_end(question)
                return self._cache[question]
        buckets = torch.from_numpy(encode_questions([question]))
        n_words = int((buckets[0, :, 0] > 0).sum())
        slots: Tensor = self._network.read(buckets[:, :n_words])[0]
        with self._lock:
            self._cache[question] = slots
            if len(self._cache) > _MAX_CACHED:
                self._cache.popitem(last=False)
        return slots


def _filled(block: Tensor) -> Tensor:
    """The block with zeros up to `_BLOCK` questions."""
    return torch.cat([block, block.new_zeros(_BLOCK - len(block), *block.shape[1:])])
