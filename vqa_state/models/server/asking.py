"""All pairs of one call to a server's model: some open at once, image after image."""

import asyncio
import base64
import io
import queue
from collections import deque
from collections.abc import Iterable, Sequence
from itertools import product
from time import monotonic
from typing import TYPE_CHECKING, Any

from PIL import Image

from vqa_state.answers.answer import Answer
from vqa_state.images.converting import as_rgb
from vqa_state.models._base import Failure, Reply
from vqa_state.models.server.call import Caller
from vqa_state.models.server.faults import Fault, Reach

if TYPE_CHECKING:
    from openai import AsyncOpenAI

__all__ = ["MAX_SIDE", "MIN_SIDE", "Asking", "data_url"]

#: Sides of an image that is sent, in pixels: what servers read in full, and what none refuses.
MIN_SIDE, MAX_SIDE = 32, 1024

#: Seconds between two looks whether the replies are being read.
_LOOK = 0.05


class Asking:
    """Puts a `Reply` for every pair into a queue, each pair once, as they come.

    The image stands before the question, so a server that keeps prefixes reads it once. Who does
    not read the replies is not asked on for.
    """

    def __init__(
        self,
        caller: Caller,
        prompt: str,
        images: Sequence[Image.Image],
        questions: Sequence[str],
        replies: "queue.SimpleQueue[Reply | None]",
    ) -> None:
        self._caller, self._images, self._replies = caller, images, replies
        self._texts = [prompt.replace("{question}", question) for question in questions]
        self._left = deque(product(range(len(images)), range(len(questions))))
        self._open: dict[asyncio.Task[Answer | Fault], tuple[int, int]] = {}
        self._dropped: list[asyncio.Task[Answer | Fault]] = []
        self._encoded = (-1, "")

    async def run(self, client: "AsyncOpenAI") -> None:
        """Until every pair has its reply; cancelled, it cancels the calls in flight."""
        self._caller.pace.pause()
        try:
            while await self._fill(client):
                done, _ = await asyncio.wait(self._open, return_when=asyncio.FIRST_COMPLETED)
                self._settle(done)
        finally:
            tasks = [*self._open, *self._dropped]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _fill(self, client: "AsyncOpenAI") -> bool:
        """Open as many calls as the server is good for; False if nothing is open or left."""
        doubt = self._caller.doubt
        size = 1 if doubt.n_failed else self._caller.pace.size
        while self._left and len(self._open) < size:
            while self._replies.qsize() > 2 * size:
                await asyncio.sleep(_LOOK)
            place = doubt.place(len(self._left))
            pair = self._left[place]
            del self._left[place]
            self._open[asyncio.create_task(self._caller.ask(client, self._content(*pair)))] = pair
        return bool(self._open)

    def _content(self, image: int, question: int) -> list[dict[str, Any]]:
        if self._encoded[0] != image:  # once an image, for all its questions
            self._encoded = (image, data_url(self._images[image]))
        return [
            {"type": "image_url", "image_url": {"url": self._encoded[1]}},
            {"type": "text", "text": self._texts[question]},
        ]

    def _settle(self, done: Iterable[asyncio.Task[Answer | Fault]]) -> None:
        hopeless = None
        for task in done:
            pair, outcome = self._open.pop(task), task.result()
            if isinstance(outcome, Answer):
                self._replies.put(Reply(*pair, outcome))
                if self._left:  # with fewer open, the time says less
                    self._caller.pace.answered(monotonic())
            else:
                self._fail(pair, outcome)
                hopeless = outcome if outcome.reach is Reach.ALL else hopeless
        if hopeless is not None:
            for pair in (*self._open.values(), *self._left):
                self._fail(pair, hopeless)
            self._dropped = list(self._open)
            self._open.clear()
            self._left.clear()

    def _fail(self, pair: tuple[int, int], fault: Fault) -> None:
        self._replies.put(Reply(*pair, Failure(fault.sentence, fault.reach is Reach.ALL)))


def data_url(image: Image.Image) -> str:
    """The pixels alone as a PNG in a URL, neither side below `MIN_SIDE` or above `MAX_SIDE`."""
    scale = min(1.0, MAX_SIDE / max(image.size))
    width, height = (max(MIN_SIDE, round(side * scale)) for side in image.size)
    pixels = as_rgb(image)
    if (width, height) == pixels.size:
        pixels = pixels.copy()
    else:
        pixels = pixels.resize((width, height), Image.Resampling.BICUBIC)
    pixels.info = {}  # a colour profile or a note is nobody's business
    out = io.BytesIO()
    pixels.save(out, "PNG")
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()
