"""How a page watches a job: it follows while it is there, and looks again now and then.

The job lives on the server. Following is a stream of what to show; if the stream breaks (a
lost connection, another tab that starts a job), a timer finds out and shows the latest.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.web.jobs import Job, JobState, Snapshot
from vqa_state.web.page import Page
from vqa_state.web.session import Desk
from vqa_state.web.view_data import Value, duration, note

__all__ = ["Watch", "before_reports", "buttons", "left"]

LOOK_AGAIN_SECONDS = 2.0
PAUSE_SECONDS = 0.12
"""Between two updates, so that a fast job does not flood the page."""

View = Callable[[Desk, str, Snapshot | None], tuple[Any, ...]]
Follow = Callable[[Any], Any]


@dataclass(frozen=True)
class Watch:
    """A kind of job, and what a page shows of it. Nothing here changes a job but `stop`."""

    kind: str
    view: View

    def wire(self, page: Page, shown: Sequence[Any], stop: gr.Button) -> Follow:
        """Connect the button, and a timer; return what follows the job from an event on.

        Args:
            page: with the open project.
            shown: components, in the order of the view.
            stop: the button that asks the job to stop.
        """
        seen, timer = gr.Textbox(visible=False), gr.Timer(LOOK_AGAIN_SECONDS)
        watched = [*shown, seen]
        page.on(stop.click, self.stop, (), [], queue=False)
        # Past the queue: its streams open and close with every call, and may miss a quick one.
        page.on(timer.tick, self.glance, [seen], watched, queue=False)
        return lambda trigger: page.follow(trigger, self.follow, watched)

    def follow(self, desk: Desk, pid: str) -> Iterator[tuple[Any, ...]]:
        """What to show of the last job, until it ends; last, which state was shown."""
        job = desk.jobs.get(pid, self.kind)
        if job is None:
            yield (*self.view(desk, pid, None), "")
            return
        snapshot = job.snapshot
        yield (*self.view(desk, pid, snapshot), _seen(job, snapshot))
        while snapshot.state.alive:
            time.sleep(PAUSE_SECONDS)
            after = job.wait_change(snapshot.version)
            if after.version != snapshot.version:
                yield (*self.view(desk, pid, after), _seen(job, after))
            snapshot = after

    def glance(self, desk: Desk, pid: str, seen: Any) -> Any:
        """What to show now, or nothing new if the page has seen it."""
        job = desk.jobs.get(pid, self.kind)
        if job is None:
            return gr.skip()
        snapshot = job.snapshot
        now = _seen(job, snapshot)
        return gr.skip() if now == seen else (*self.view(desk, pid, snapshot), now)

    def stop(self, desk: Desk, pid: str) -> None:
        """Ask the job to stop, if there is one."""
        job = desk.jobs.get(pid, self.kind)
        if job is not None:
            job.stop()


def buttons(snapshot: Snapshot | None) -> tuple[gr.Button, gr.Button]:
    """What starts the job, usable while none is alive, and what stops it."""
    alive = snapshot is not None and snapshot.state.alive
    can_stop = snapshot is not None and snapshot.state is JobState.RUNNING
    return gr.Button(interactive=not alive), gr.Button(interactive=can_stop)


def before_reports(snapshot: Snapshot | None, beginning: str) -> Value | None:
    """What is said whatever the work reports: nothing yet, failed, stopping, or just begun.

    None where its report speaks.
    """
    if snapshot is None:
        return note("")
    if snapshot.state is JobState.FAILED:
        return note(f"Failed: {snapshot.failure}", "bad")
    if snapshot.state is JobState.STOPPING:
        return note("Stopping…")
    if snapshot.report is None:
        return note(beginning, share=0.0) if snapshot.state.alive else note("Stopped.", "warn")
    return None


def left(seconds: float | None) -> str:
    """How long it takes from now on, to be put behind what is being done; "" if not known."""
    return "" if seconds is None else f", about {duration(seconds)} left"


def _seen(job: Job, snapshot: Snapshot) -> str:
    return f"{id(job)}/{snapshot.version}"
