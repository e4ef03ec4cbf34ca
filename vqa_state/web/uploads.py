"""Adding pictures over HTTP: a stream of JSON lines, one for each few pictures.

Nobody else waits longer for the project than these few take, and what a line tells is saved. A
page that goes away ends the adding with the pictures at work.
"""

import asyncio
import json
from collections.abc import AsyncIterator, Iterator
from typing import Any

from starlette.concurrency import iterate_in_threadpool

from vqa_state.errors import VQAStateError
from vqa_state.project.importing import Batch, Refused, added_in_batches
from vqa_state.web import view_data
from vqa_state.web.session import Desk

__all__ = ["added_lines", "with_breaths"]

BREATH_SECONDS = 0.02
"""Between two batches: a lock is not fair, so those that wait for it get a moment."""


def added_lines(desk: Desk, pid: str, name: str, data: bytes) -> Iterator[str]:
    """Add a picture or a ZIP file; a JSON line after each batch.

    The answer has begun by then, so a fault (a full disk, a project that is gone) is the last line,
    which refuses the file with its sentence.
    """
    batch = Batch(0, 1)
    try:
        for batch in added_in_batches(lambda: desk.changing(pid), name, data):
            yield _line(batch)
    except (VQAStateError, OSError) as error:
        yield _line(Batch(batch.n_done, batch.n_files, refused=(Refused(name, str(error)),)))


async def with_breaths(lines: Iterator[str]) -> AsyncIterator[str]:
    """The lines, made beside the event loop; a response that is given up asks for no more."""
    async for line in iterate_in_threadpool(lines):
        yield line
        await asyncio.sleep(BREATH_SECONDS)


def _line(batch: Batch) -> str:
    told: dict[str, Any] = {
        "done": batch.n_done,
        "of": batch.n_files,
        "added": [view_data.image_row(image) for image in batch.added],
        "known": [{"name": one.name, "row": view_data.image_row(one.image)} for one in batch.known],
        "refused": [{"name": one.name, "reason": one.reason} for one in batch.refused],
    }
    return json.dumps(told) + "\n"
