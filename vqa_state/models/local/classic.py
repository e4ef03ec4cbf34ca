"""What the classic VQA models share: asking a network every question about every image.

A network sees an image once for all its questions. Questions are never padded: those of the same
number of tokens go through together, in blocks of a fixed number of rows, the last one filled up
by repeating a row. A matrix product of other shape rounds differently; with a fixed shape an
answer has the same digits whatever is asked beside it.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from PIL.Image import Image

from vqa_state.answers.answer import Answer
from vqa_state.images.converting import as_rgb
from vqa_state.models._base import Failure, Reply
from vqa_state.models.address import Device
from vqa_state.models.local.batching import BatchSize
from vqa_state.models.local.exclusive_access import Turns, till_stopped
from vqa_state.models.local.loading import failure_of
from vqa_state.models.local.runtime import Runtime, folder_digest

if TYPE_CHECKING:
    from torch import Tensor
    from torch.nn import Module

__all__ = ["Network", "Outcome", "Said", "TorchImageModel", "fingerprint_of"]

_DEVICES = {Device.CPU: "the processor", Device.CUDA: "the graphics card"}


@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """What a network says to one question about one image.

    Attributes:
        tokens: of the answer, without start and end; of a classifier the number of its label.
        logits: (n_tokens,), of the first step, or (n_labels,).
    """

    tokens: tuple[int, ...]
    logits: "Tensor"


#: Numbers of the image and of the question, and what came out.
Outcome = tuple[int, int, Said | Failure]


class Network(Protocol):
    """A network in two parts: what it sees, and what it says to questions about that."""

    n_rows: int
    """Questions that go through together."""

    max_tokens: int
    """Of a question."""

    @property
    def steps(self) -> Sequence["Module"]:
        """Modules that `say` calls again and again: a stop may come before each call."""
        ...

    def see(self, images: Sequence[Image]) -> Sequence[Any]:
        """What all questions about an image need of it, for each image (RGB)."""
        ...

    def read(self, question: str) -> list[int]:
        """The tokens of a question, its prompt around it."""
        ...

    def say(self, seen: Any, tokens: "Tensor") -> list[Said]:
        """Answer questions of one length, int64 (n_rows, length), about what was seen."""
        ...

    def answer(self, said: Said) -> Answer:
        """The text, and how sure it is."""
        ...


class TorchImageModel:
    """A model around a network. May be shared by threads."""

    def __init__(self, network: Network, name: str, runtime: Runtime, fingerprint: str) -> None:
        self.name = name
        self.fingerprint = fingerprint
        where = _DEVICES.get(runtime.device, "the GPU")
        self.notes: tuple[str, ...] = (f"It runs on {where} in {runtime.precision}.",)
        self._network = network
        self._runtime = runtime
        self._batch = BatchSize(runtime)
        self._turns = Turns(network.steps)  # taken for one block, never held for a reply

    def answer(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Reply]:
        """Ask every question about every image; what the model cannot take fails alone."""
        for image, question, said in self.generations(images, questions):
            outcome = said if isinstance(said, Failure) else self._answer(said)
            yield Reply(image, question, outcome)

    def answer_until(
        self, images: Sequence[Image], questions: Sequence[str], stop: Callable[[], bool]
    ) -> Iterator[Reply]:
        """As `answer`; `stop` is asked before every forward pass."""
        own = copy(self)
        own._turns = self._turns.until(stop)
        return till_stopped(own.answer(images, questions))

    def _answer(self, said: Said) -> Answer | Failure:
        if said.logits.isfinite().all():
            return self._network.answer(said)
        return Failure(f"the model's numbers overflow in {self._runtime.precision}; use float32")

    def generations(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Outcome]:
        """The tokens and first-step logits behind `answer`, to compare ways and models by.

        Yields:
            (number of the image, number of the question, `Said` or a `Failure`), every pair once,
            those of a block of questions as soon as it is through.
        """
        if not questions or not images:
            return
        tokens = [self._network.read(question) for question in questions]
        fitting = []
        for question, row in enumerate(tokens):
            if len(row) <= self._network.max_tokens:
                fitting.append(question)
            else:
                failure = self._too_long(len(row))
                yield from ((image, question, failure) for image in range(len(images)))
        blocks = _blocks(tokens, fitting, self._network.n_rows)
        for image, seen in self._all_seen(images) if blocks else ():
            if isinstance(seen, Failure):
                yield from ((image, question, seen) for question in fitting)
            else:
                yield from self._about(image, seen, tokens, blocks)

    def _too_long(self, n_tokens: int) -> Failure:
        return Failure(
            f"the question has {n_tokens} tokens, and this model reads at most "
            f"{self._network.max_tokens}; ask a shorter one"
        )

    def _all_seen(self, images: Sequence[Image]) -> Iterator[tuple[int, Any]]:
        """(number of the image, what is seen in it, or a `Failure`)."""
        start = 0
        while start < len(images):
            batch = [as_rgb(image) for image in images[start : start + self._batch.size]]
            try:
                seen = self._seen(batch)
            except RuntimeError as error:
                if _no_memory(error) and len(batch) > 1:
                    self._batch.too_large()
                    continue
                if len(batch) > 1:  # one of them is to blame
                    seen = [self._seen_alone(image) for image in batch]
                else:
                    seen = [failure_of(error)]
            yield from enumerate(seen, start)
            start += len(batch)

    def _seen(self, batch: Sequence[Image]) -> Sequence[Any]:
        with self._turns.take():
            began = time.perf_counter()
            seen = self._network.see(batch)
            _wait_for(self._runtime.device)
            self._batch.record(len(batch), time.perf_counter() - began)
        return seen

    def _seen_alone(self, image: Image) -> Any:
        try:
            return self._seen([image])[0]
        except RuntimeError as error:
            return failure_of(error)

    def _about(
        self,
        image: int,
        seen: Any,
        tokens: Sequence[Sequence[int]],
        blocks: Sequence[Sequence[int]],
    ) -> Iterator[Outcome]:
        import torch

        for number, block in enumerate(blocks):
            rows = [tokens[question] for question in block]
            rows += [rows[-1]] * (self._network.n_rows - len(rows))
            try:
                with self._turns.take():
                    said = self._network.say(seen, torch.tensor(rows))
            except RuntimeError as error:
                failure = failure_of(error)
                for rest in blocks[number:]:
                    yield from ((image, question, failure) for question in rest)
                return
            for question, one in zip(block, said, strict=False):  # the rest only fills up
                yield image, question, one


def _blocks(
    tokens: Sequence[Sequence[int]], fitting: Sequence[int], n_rows: int
) -> list[list[int]]:
    """Numbers of questions of one length each, at most `n_rows` together."""
    groups: dict[int, list[int]] = {}
    for question in fitting:
        groups.setdefault(len(tokens[question]), []).append(question)
    return [
        group[start : start + n_rows]
        for group in groups.values()
        for start in range(0, len(group), n_rows)
    ]


def _wait_for(device: Device) -> None:
    """Until it has done what it was given; else a clock would only time the giving."""
    import torch

    if device is Device.CUDA:
        torch.cuda.synchronize()
    elif device is Device.MPS:
        torch.mps.synchronize()


def _no_memory(error: RuntimeError) -> bool:
    import torch

    return isinstance(error, torch.OutOfMemoryError)


def fingerprint_of(family: str, folder: Path, runtime: Runtime, template: str, way: str) -> str:
    """All that can change an answer.

    Args:
        family: and the version of our code for it.
        folder: of the model; its path is not part of it.
        runtime: device and precision.
        template: the prompt.
        way: how an answer is decoded.

    Raises:
        ModelError: if a file cannot be read.
    """
    import transformers

    # The library's processors and networks change between its minor releases.
    release = ".".join(transformers.__version__.split(".")[:2])
    return (
        f"{family}; files {folder_digest(folder)}; {runtime}; prompt {template!r}; {way}; "
        f"transformers {release}"
    )
