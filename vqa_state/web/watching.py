"""How a page watches a job: it follows while it is there, and looks again now and then.

The job lives on the server. Following is a stream of what to show; if the stream breaks (a
lost connection, another tab that starts a job), a timer finds out and shows the latest.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

from vqa_state.jobs import Job, Snapshot
from vqa_state.web.desk import Desk

__all__ = ["LOOK_AGAIN_SECONDS", "follow", "glance", "stop"]

LOOK_AGAIN_SECONDS = 2.0
PAUSE_SECONDS = 0.12
"""Between two updates, so that a fast job does not flood the page."""

View = Callable[[Desk, str, Snapshot | None], tuple[Any, ...]]


def follow(desk: Desk, pid: str, kind: str, view: View) -> Iterator[tuple[Any, ...]]:
    """What to show of the last job of this kind, until it ends; last, which state was shown."""
    job = desk.jobs.get(pid, kind)
    if job is None:
        yield (*view(desk, pid, None), "")
        return
    snapshot = job.snapshot
    yield (*view(desk, pid, snapshot), _seen(job, snapshot))
    while snapshot.state.alive:
        time.sleep(PAUSE_SECONDS)
        after = job.wait_change(snapshot.version)
        if after.version != snapshot.version:
            yield (*view(desk, pid, after), _seen(job, after))
        snapshot = after


def glance(desk: Desk, pid: str, kind: str, view: View, seen: Any) -> tuple[Any, ...] | None:
    """What to show now, or None if the page has seen it."""
    job = desk.jobs.get(pid, kind)
    if job is None:
        return None
    snapshot = job.snapshot
    now = _seen(job, snapshot)
    return None if now == seen else (*view(desk, pid, snapshot), now)


def stop(desk: Desk, pid: str, kind: str) -> None:
    """Ask the job of this kind to stop, if there is one."""
    job = desk.jobs.get(pid, kind)
    if job is not None:
        job.stop()


def _seen(job: Job, snapshot: Snapshot) -> str:
    return f"{id(job)}/{snapshot.version}"
