"""All questions about all images: what goes together, what goes the slow way, what fails alone."""

import time
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

from PIL.Image import Image

from vqa_state.models._base import Failure
from vqa_state.models.chat.prefix_cache import (
    N_TOKENS,
    Prefix,
    Said,
    generate_plain,
    generate_suffixes,
    join_inputs,
    on_device,
    read_prefix,
)
from vqa_state.models.chat.prefix_check import Check
from vqa_state.models.chat.prompt import ChatPrompt, SeenImage
from vqa_state.models.local.batching import BatchSize
from vqa_state.models.local.exclusive_access import Turns
from vqa_state.models.local.loading import failure_of
from vqa_state.models.local.runtime import Runtime

__all__ = ["ChatAsker", "Outcome"]

#: Number of the image, number of the question, what came.
Outcome = tuple[int, int, Said | Failure]

#: What processors and models raise for an image that they cannot take, or for want of memory.
_REFUSALS = (ValueError, RuntimeError, ArithmeticError, LookupError, MemoryError)


@dataclass(frozen=True, slots=True)
class _Row:
    """A question about an image that was read: where both stand, and the ids behind the prefix."""

    image: int
    place: int
    question: int
    ids: tuple[int, ...]


class ChatAsker:
    """Asks one model; may be shared by threads.

    A prefix or the answers to one chunk of questions hold the model at a time.
    """

    def __init__(self, model: Any, prompt: ChatPrompt, runtime: Runtime, check: Check) -> None:
        """Keep what belongs together.

        Args:
            model: of transformers.
            prompt: its own.
            runtime: that it was loaded for.
            check: which ways are open.
        """
        self._model = model
        self._prompt = prompt
        self._is_fast = not check.slow_because
        self._cuts = check.cuts
        self._n_behind = check.n_behind
        self._batch = BatchSize(runtime) if check.joins else BatchSize(runtime, largest=1)
        self._turns = Turns([model])
        text = model.config.get_text_config()
        self._limit: int | None = getattr(text, "max_position_embeddings", None)

    def until(self, stop: Callable[[], bool]) -> "ChatAsker":
        """The same for a caller who may give up: then `said` raises `Stopped`."""
        own = copy(self)
        own._turns = self._turns.until(stop)
        return own

    def said(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Outcome]:
        """Every pair once."""
        start = 0
        while questions and start < len(images):
            stop = min(start + self._batch.size, len(images))
            yield from self._some(images, range(start, stop), questions)
            start = stop

    def _some(
        self, images: Sequence[Image], numbers: Sequence[int], questions: Sequence[str]
    ) -> Iterator[Outcome]:
        alike: dict[object, dict[int, SeenImage]] = {}
        for number in numbers:
            image = images[number].convert("RGB")
            try:
                seen = self._prompt.see(image)
            except _REFUSALS as error:
                yield from _all_fail([number], questions, error)
                continue
            if self._is_fast and seen.head:
                alike.setdefault(seen.form, {})[number] = seen
                continue
            for position, question in enumerate(questions):
                yield number, position, self._slowly(image, seen, question)
        for group in alike.values():
            yield from self._together(group, questions)

    def _slowly(self, image: Image, seen: SeenImage, question: str) -> Said | Failure:
        try:
            if self._cuts and seen.head:
                inputs = self._prompt.inputs(seen, self._prompt.ids(seen, question))
            else:
                inputs = self._prompt.plain(image, question)
            if failure := self._refused(inputs["input_ids"][0].tolist(), seen):
                return failure
            with self._turns.take():
                return generate_plain(self._model, on_device(self._model, inputs))
        except _REFUSALS as error:
            return failure_of(error)

    def _together(self, group: dict[int, SeenImage], questions: Sequence[str]) -> Iterator[Outcome]:
        """Images whose inputs have the same shapes are read in one go."""
        import torch

        began = time.monotonic()
        problem: Exception | None = None
        try:
            prefix = self._read(list(group.values()))
        except _REFUSALS as error:
            problem = error.with_traceback(None)  # which would hold the device's memory
        if isinstance(problem, torch.OutOfMemoryError) and len(group) > 1:
            self._batch.too_large()
            for number, seen in group.items():
                yield from self._together({number: seen}, questions)
        elif problem is not None:
            yield from _all_fail(group, questions, problem)
        else:
            seconds = time.monotonic() - began
            yield from self._behind(prefix, group, questions, seconds)

    def _read(self, group: Sequence[SeenImage]) -> Prefix:
        length = len(group[0].head) + self._n_behind
        inputs = [
            self._prompt.inputs(one, one.inputs["input_ids"][0, :length].tolist()) for one in group
        ]
        with self._turns.take():
            joined = on_device(self._model, join_inputs(inputs))
            return read_prefix(self._model, joined, self._prompt.image_token)

    def _behind(
        self,
        prefix: Prefix,
        group: dict[int, SeenImage],
        questions: Sequence[str],
        seconds: float,
    ) -> Iterator[Outcome]:
        rows: list[_Row] = []
        for place, (number, seen) in enumerate(group.items()):
            start = prefix.ids[place].tolist()
            for position, question in enumerate(questions):
                ids = self._prompt.ids(seen, question)
                if failure := self._refused(ids, seen):
                    yield number, position, failure
                elif ids[: len(start)] != start or len(ids) == len(start):
                    # Its first letters melt into the words before it.
                    yield number, position, self._alone(seen, ids)
                else:
                    rows.append(_Row(number, place, position, tuple(ids[len(start) :])))
        for chunk in prefix.chunks([row.ids for row in rows]):
            began = time.monotonic()
            outcomes = list(self._chunk(prefix, [rows[n] for n in chunk]))
            seconds += time.monotonic() - began
            yield from outcomes
        self._batch.record(len(group), seconds)

    def _alone(self, seen: SeenImage, ids: Sequence[int]) -> Said | Failure:
        try:
            with self._turns.take():
                inputs = on_device(self._model, self._prompt.inputs(seen, ids))
                return generate_plain(self._model, inputs)
        except _REFUSALS as error:
            return failure_of(error)

    def _chunk(self, prefix: Prefix, rows: Sequence[_Row]) -> Iterator[Outcome]:
        import torch

        problem: Exception | None = None
        try:
            with self._turns.take():
                places, ids = [row.place for row in rows], [row.ids for row in rows]
                said = generate_suffixes(self._model, prefix, places, ids)
        except _REFUSALS as error:
            problem = error.with_traceback(None)
        if problem is None:
            yield from ((row.image, row.question, one) for row, one in zip(rows, said, strict=True))
        elif isinstance(problem, torch.OutOfMemoryError) and len(rows) > 1:
            for part in (rows[: len(rows) // 2], rows[len(rows) // 2 :]):
                yield from self._chunk(prefix, part)
        else:
            yield from ((row.image, row.question, failure_of(problem)) for row in rows)

    def _refused(self, ids: Sequence[int], seen: SeenImage) -> Failure | None:
        if seen.head and self._prompt.image_token in ids[len(seen.head) + 1 :]:
            return Failure("the question holds a word that the model takes for an image; reword it")
        if self._limit is not None and len(ids) + N_TOKENS > self._limit:
            return Failure(
                f"image and question have {len(ids)} tokens, the model reads "
                f"{self._limit - N_TOKENS}; shorten the question or make the image smaller"
            )
        return None


def _all_fail(
    images: Sequence[int] | dict[int, SeenImage], questions: Sequence[str], error: Exception
) -> Iterator[Outcome]:
    yield from ((image, n, failure_of(error)) for image in images for n in range(len(questions)))
