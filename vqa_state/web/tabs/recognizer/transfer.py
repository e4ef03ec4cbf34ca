"""The chosen recognizer on another model, on the tab Recognizer: what is lost, and what then."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.recognizer.recognizer import Recognizer
from vqa_state.study.collect import AskProgress, ask
from vqa_state.study.optimize import OptimizeProgress, optimize
from vqa_state.study.transfer import Rechecked, recheck
from vqa_state.study.vision_check import CheckProgress
from vqa_state.web import arguments, job_watcher, widgets
from vqa_state.web.jobs import JobState, Snapshot, StopFlag, Work
from vqa_state.web.model_notes import look_first, look_note, with_told
from vqa_state.web.page import Page
from vqa_state.web.recognizer_choice import taken_recognizer
from vqa_state.web.session import Desk
from vqa_state.web.tabs.ask.model import HINT, listed
from vqa_state.web.tabs.optimize import PROVING
from vqa_state.web.view_data import note

__all__ = ["Parts", "build", "wire"]

#: Re-checking and tuning again are one stretch of work after the other, watched by one line.
KIND = "trying another model"


@dataclass(frozen=True)
class Parts:
    """Components of this part of the tab."""

    model: gr.Dropdown
    start: gr.Button
    again: gr.Button
    stop: gr.Button
    progress: gr.HTML


def build() -> Parts:
    """Draw it, folded away."""
    with gr.Accordion("The same questions on another model", open=False, elem_id="recheck"):
        gr.Markdown(
            "Which questions work depends on the model. This asks the recognizer's questions on "
            "another one about your labelled images and shows what is lost. It looks at the test "
            "images, and the look is counted."
        )
        model = gr.Dropdown(
            listed(""),
            value=None,
            label="Other model",
            info=f"pick one, {HINT}; allow it on Ask first",
            allow_custom_value=True,
            elem_id="recheck-model",
        )
        with gr.Row():
            start = gr.Button("Re-check on it", elem_id="recheck-start", scale=0, min_width=170)
            again = gr.Button(
                "Optimize again for it", elem_id="recheck-again", scale=0, min_width=200
            )
            stop = gr.Button("Stop", interactive=False, elem_id="recheck-stop", scale=0)
        progress = widgets.note("recheck-progress")
    return Parts(model, start, again, stop, progress)


def wire(parts: Parts, page: Page) -> None:
    """Connect it."""
    shown = [parts.progress, parts.start, parts.again, parts.stop]
    follow = job_watcher.Watch(KIND, view).wire(page, shown, parts.stop)
    for button, fn in ((parts.start, start), (parts.again, start_again)):
        started = page.on(button.click, fn, [parts.model], [])
        page.then_road(follow(started.success))
    follow(page.arrived.then)


def start(desk: Desk, pid: str, model: Any) -> None:
    """Begin to re-check the recognizer that the tab would download."""
    name = arguments.text(model, "the other model")
    project = desk.snapshot(pid)
    recognizer = taken_recognizer(project, project.chosen, desk.taken(pid))
    desk.jobs.start(pid, KIND, rechecking(desk, pid, recognizer, name))


def start_again(desk: Desk, pid: str, model: Any) -> None:
    """Begin to ask and optimize anew, on the other model; it becomes the project's."""
    desk.jobs.start(pid, KIND, tuning(desk, pid, arguments.text(model, "the other model")))


def rechecking(desk: Desk, pid: str, recognizer: Recognizer, name: str) -> Work:
    """The work: look at the model, ask the recognizer's questions, compare."""

    def work(flag: StopFlag) -> Iterator[AskProgress | CheckProgress | Rechecked]:
        desk.telling.forget(pid, KIND)
        loaded = desk.model(name)
        yield from look_first(desk.telling, pid, KIND, loaded, flag)
        for step in recheck(recognizer, desk.snapshot(pid), loaded, flag):
            if isinstance(step, Rechecked):
                with desk.changing(pid) as project:
                    project.test_looks += 1
            yield step

    return work


def tuning(desk: Desk, pid: str, name: str) -> Work:
    """The work: the whole road from questions to recognizers, on another model."""

    def work(flag: StopFlag) -> Iterator[AskProgress | CheckProgress | OptimizeProgress]:
        desk.telling.forget(pid, KIND)
        loaded = desk.model(name)
        with desk.changing(pid) as project:
            project.model, project.fingerprint = loaded.name, loaded.fingerprint
        yield from look_first(desk.telling, pid, KIND, loaded, flag)
        yield from ask(desk.snapshot(pid), loaded, flag)
        if not flag():
            yield from optimize(desk.snapshot(pid), flag)

    return work


def view(desk: Desk, pid: str, snapshot: Snapshot | None) -> tuple[Any, Any, Any, Any]:
    """Progress with what is to be known of the model, both beginnings and stop."""
    start, stop = job_watcher.buttons(snapshot)
    shown = with_told(_progress(snapshot), desk.telling(pid, KIND))
    return shown, start, start, stop


def _progress(snapshot: Snapshot | None) -> Any:
    early = job_watcher.before_reports(snapshot, "Loading the model…")
    if snapshot is None or early is not None:
        return early
    if snapshot.state is JobState.STOPPED:
        return note("Stopped. What was answered is kept.", "warn")
    report: AskProgress | CheckProgress | OptimizeProgress | Rechecked = snapshot.report
    if isinstance(report, CheckProgress):
        return look_note(report)
    if isinstance(report, Rechecked):
        return _found(report)
    if snapshot.state is JobState.DONE:
        return note("Done: the recognizers are of the other model now. See Results.", "good")
    if isinstance(report, AskProgress):
        words = f"Asking {report.n_calls:,} questions{job_watcher.left(report.seconds_left)}"
        return note(words, share=(report.n_calls - report.n_left) / max(1, report.n_calls))
    if report.proving:
        return note(PROVING)
    left = job_watcher.left(report.seconds_left)
    return note(f"Choosing questions{left}", share=report.generation / max(1, report.total))


def _found(report: Rechecked) -> Any:
    lines = [side.sentence for side in report.sides]
    lines += [report.says] if report.says else []
    return note("\n".join(lines), "warn" if any(side.lost for side in report.sides) else "good")
