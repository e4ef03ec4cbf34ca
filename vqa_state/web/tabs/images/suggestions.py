"""Part of Images: what the chosen recognizer says about images without a label."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.label_ranking import Suggestion
from vqa_state.project.project import Project
from vqa_state.study.collect import AskProgress
from vqa_state.study.suggest import ask_unlabelled, hints
from vqa_state.web import job_watcher, widgets
from vqa_state.web.jobs import JobState, Snapshot, StopFlag, Work
from vqa_state.web.page import Page
from vqa_state.web.recognizer_choice import found_and_assessed
from vqa_state.web.routes import MAX_UPLOAD
from vqa_state.web.session import Desk
from vqa_state.web.view_data import images_value, note

__all__ = ["Parts", "build", "grid_value", "wire"]

KIND = "suggesting labels"


@dataclass(frozen=True)
class Parts:
    """Components."""

    start: gr.Button
    stop: gr.Button
    progress: gr.HTML


@dataclass(frozen=True)
class Suggesting:
    """What the job reports.

    Attributes:
        asking: of the images without a label.
        found: only in the last report, the surest first.
    """

    asking: AskProgress
    found: tuple[Suggestion, ...] = ()


def build() -> Parts:
    """Draw it."""
    gr.Markdown(
        "Is a recognizer optimized? Then it can suggest labels for the other images, and you only "
        "look and accept."
    )
    with gr.Row():
        start = gr.Button("Suggest labels", elem_id="suggest-start", scale=0, min_width=170)
        stop = gr.Button("Stop", interactive=False, elem_id="suggest-stop", scale=0)
    return Parts(start, stop, widgets.note("suggest-progress"))


def wire(parts: Parts, page: Page, grid: gr.HTML) -> None:
    """Connect it; the grid shows the suggestions."""
    shown = [parts.progress, parts.start, parts.stop, grid]
    follow = job_watcher.Watch(KIND, view).wire(page, shown, parts.stop)
    started = page.on(parts.start.click, start, (), [])
    for trigger in (started.success, page.arrived.then):
        follow(trigger)
    for trigger in (grid.changed, grid.reload):
        page.on(trigger, tell, (), [parts.progress], trigger_mode="always_last")


def start(desk: Desk, pid: str) -> None:
    """Begin to ask about images without a label, or attach to what is running.

    Raises:
        NothingToSearchError: if there is no such image, or nothing to suggest with.
    """
    project = desk.snapshot(pid)
    if all(image.label is not None for image in project.images.values()):
        raise NothingToSearchError("every image has a label; add more pictures to suggest labels")
    if found_and_assessed(project)[0] is None:
        raise NothingToSearchError(
            "no recognizer fits the present answers and labels; optimize first, then it can "
            "suggest labels"
        )
    desk.jobs.start(pid, KIND, suggesting(desk, pid))


def suggesting(desk: Desk, pid: str) -> Work:
    """The work: ask the recognizer's questions about images without a label, then vote."""

    def work(stop: StopFlag) -> Iterator[Suggesting]:
        project = desk.snapshot(pid)
        found, assessed = found_and_assessed(project)
        if found is None:
            raise NothingToSearchError("answers or labels changed meanwhile; optimize first")
        asking: AskProgress | None = None
        for asking in ask_unlabelled(project, found, assessed, desk.model(project.model), stop):
            yield Suggesting(asking)
        if asking is not None:
            yield Suggesting(asking, hints(project, found, assessed).suggestions)

    return work


def view(desk: Desk, pid: str, snapshot: Snapshot | None) -> tuple[Any, ...]:
    """Progress, start, stop and the grid, which a running job leaves as it is."""
    alive = snapshot is not None and snapshot.state.alive
    grid = gr.skip() if snapshot is None or alive else grid_value(desk, pid)
    return _said(desk, pid, snapshot), *job_watcher.buttons(snapshot), grid


def tell(desk: Desk, pid: str) -> Any:
    """Progress alone: the grid shows already which suggestions are settled."""
    job = desk.jobs.get(pid, KIND)
    return _said(desk, pid, None if job is None else job.snapshot)


def _said(desk: Desk, pid: str, snapshot: Snapshot | None) -> Any:
    """Progress; once the job is over, how many suggestions are still open."""
    n_open = 0
    if snapshot is not None and not snapshot.state.alive:
        with desk.reading(pid) as project:
            n_open = len(_suggested(desk, pid, project))
    return _progress(snapshot, n_open)


def grid_value(desk: Desk, pid: str) -> Any:
    """The labelling grid, with what the last job suggests for images that have no label."""
    with desk.reading(pid) as project:
        return images_value(pid, project, MAX_UPLOAD, _suggested(desk, pid, project))


def _suggested(desk: Desk, pid: str, project: Project) -> dict[str, Suggestion]:
    job = desk.jobs.get(pid, KIND)
    report: Suggesting | None = None if job is None else job.snapshot.report
    found = () if report is None else report.found
    labels = {image.id: image.label for image in project.images.values()}
    return {one.image_id: one for one in found if labels.get(one.image_id, 0) is None}


def _progress(snapshot: Snapshot | None, n_open: int) -> Any:
    early = job_watcher.before_reports(snapshot, "Loading the model…")
    if snapshot is None or early is not None:
        return early
    report: Suggesting = snapshot.report
    if not snapshot.state.alive:
        return _done(report, n_open, stopped=snapshot.state is JobState.STOPPED)
    one = report.asking
    share = (one.n_calls - one.n_left) / max(1, one.n_calls)
    left = job_watcher.left(one.seconds_left)
    return note(f"Asking about images without a label{left}", share=share)


def _done(report: Suggesting, n_open: int, *, stopped: bool) -> Any:
    lines = ["Stopped. What was answered is kept; suggest again to go on."] if stopped else []
    if report.asking.n_failed:
        lines.append(f"{report.asking.n_failed:,} calls failed: {report.asking.last_failure}")
    lines.append(_found(len(report.found), n_open))
    return note("\n".join(lines), "warn" if stopped or report.asking.n_failed else "good")


def _found(n: int, n_open: int) -> str:
    """How many labels are suggested, and what to do with those that are still open."""
    if not n:
        return "No label is suggested: no vote is clear."
    if not n_open:
        return "Every suggested label is settled." if n > 1 else "The suggested label is settled."
    verb = "is" if n_open == 1 else "are"
    what = f"{n_open} {'label' if n_open == 1 else 'labels'} {verb} suggested"
    if n_open < n:
        what = f"{n_open} of {n} suggested labels {verb} still open"
    return (
        f"{what}, shown with a question mark. Choose images and press Y to accept; they become "
        "training images, since a label that came from a vote must not judge it."
    )
