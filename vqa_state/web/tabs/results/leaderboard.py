"""Part of Results: which recognizer to take, by one table; assess them, and look at the test."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.study.assess import Assessment, AssessProgress, Stage, assess
from vqa_state.study.latency import read_pace
from vqa_state.study.leaderboard import Standings, standings, standings_frame
from vqa_state.study.leaderboard_words import TABLE_NOTES
from vqa_state.web import job_watcher, widgets
from vqa_state.web.jobs import JobState, Snapshot, StopFlag, Work
from vqa_state.web.page import Page
from vqa_state.web.recognizer_choice import found_and_assessed
from vqa_state.web.session import Desk
from vqa_state.web.tabs.results import details
from vqa_state.web.tabs.results.galleries import results_digest
from vqa_state.web.view_data import note

__all__ = ["Parts", "build", "wire"]

KIND = "assessing"
N_SHOWN = 14
"""Components of a board, of which a running job changes none."""
FIRST = ("recognizer", "train", "out of bag", "test", "questions", "calls")
"""The columns that say which one to take."""
WORDS = (
    "Assess repeats the whole search on resamples of the training images, each time judging the "
    "images that it left out: what it keeps is what new images will see. It also fits other kinds "
    "of vote, and trains a rival without questions.",
    *TABLE_NOTES,
    "The test images chose nothing. Each look at them tempts to choose by them, so looks are "
    "counted.",
)


@dataclass(frozen=True)
class Parts:
    """Components; `looked` holds a digest of the results whose test side is shown."""

    advice: gr.HTML
    use: gr.Button
    used: gr.HTML
    start: gr.Button
    stop: gr.Button
    progress: gr.HTML
    table: gr.Dataframe
    look: gr.Button
    sentences: gr.HTML
    looked: gr.Textbox


@dataclass(frozen=True)
class Assessing:
    """What the job reports.

    Attributes:
        progress: of the core.
        seconds_left: of this stage; None while nobody can know.
    """

    progress: AssessProgress
    seconds_left: float | None


def build() -> Parts:
    """Draw it."""
    gr.Markdown("### Which one to take")
    advice = widgets.note("recommendation")
    use = gr.Button("Use it", elem_id="use-it", visible=False, scale=0)
    used = widgets.note("used")
    with gr.Row():
        start = gr.Button("Assess", variant="primary", elem_id="assess-start", scale=0)
        stop = gr.Button("Stop", interactive=False, elem_id="assess-stop", scale=0)
    progress = widgets.note("assess-progress")
    gr.Markdown("Choose a row to see the images that it does not recognize.")
    table = gr.Dataframe(
        interactive=False, elem_id="standings", show_label=False, visible=False, max_height=760,
        pinned_columns=1,
    )  # fmt: skip
    with gr.Accordion("What the words mean", open=False):
        gr.Markdown("\n".join(f"- {one}" for one in WORDS))
    look = gr.Button("Look at the test images", elem_id="look", scale=0, min_width=170)
    sentences = widgets.note("sentences")
    looked = gr.Textbox(visible=False)
    return Parts(
        advice, use, used, start, stop, progress, table, look, sentences, looked
    )  # fmt: skip


def wire(parts: Parts, page: Page, tab: gr.Tab, test_missed: gr.HTML, why: details.Parts) -> None:
    """Connect it. What draws the table anew hides its test columns, and all that a look showed.

    Args:
        parts: the components.
        page: with the open project.
        tab: that they stand on.
        test_missed: test images that the chosen row does not recognize.
        why: what is told of the same results further down.
    """
    board = [
        parts.advice, parts.use, parts.table, parts.look, parts.sentences, parts.looked,
        test_missed, *why.shown,
    ]  # fmt: skip
    shown = [parts.progress, parts.start, parts.stop, *board]
    follow = job_watcher.Watch(KIND, view).wire(page, shown, parts.stop)
    started = page.on(parts.start.click, start, (), [])
    for trigger in (started.success, page.arrived.then, tab.select):
        follow(trigger)
    page.on(parts.use.click, use, (), [parts.used])
    page.refresh(tab, forget, [parts.used])
    page.on(parts.look.click, look, (), [parts.look, parts.table, parts.sentences, parts.looked])


def start(desk: Desk, pid: str) -> None:
    """Begin to assess, or attach to what is running."""
    desk.snapshot(pid)
    desk.jobs.start(pid, KIND, assessing(desk, pid))


def assessing(desk: Desk, pid: str) -> Work:
    """The work, with the time that is left of each stage."""

    def work(stop: StopFlag) -> Iterator[Assessing]:
        stage: Stage | None = None
        began, first = 0.0, 0
        for progress in assess(desk.snapshot(pid), stop):
            if progress.stage is not stage:
                stage, began, first = progress.stage, time.monotonic(), progress.n_done
            n_done, elapsed = progress.n_done - first, time.monotonic() - began
            left = elapsed / n_done * (progress.n_total - progress.n_done) if n_done else None
            yield Assessing(progress, left)

    return work


def view(desk: Desk, pid: str, snapshot: Snapshot | None) -> tuple[Any, ...]:
    """Progress, start and stop, and the board, which a running job leaves as it is."""
    alive = snapshot is not None and snapshot.state.alive
    buttons = job_watcher.buttons(snapshot)
    if snapshot is not None and alive:
        return _progress(snapshot), *buttons, *[gr.skip()] * N_SHOWN
    failed = snapshot is not None and snapshot.state is JobState.FAILED
    said = note(f"Failed: {snapshot.failure}", "bad") if failed and snapshot else note("")
    return said, *buttons, *board(desk, pid)


def _progress(snapshot: Snapshot) -> Any:
    report: Assessing | None = snapshot.report
    if report is None:
        return note("Assessing…", share=0.0)
    one = report.progress
    share = one.n_done / max(one.n_total, 1)
    if snapshot.state is JobState.STOPPING:
        return note("Stopping… what came is kept.", share=share)
    left = job_watcher.left(report.seconds_left)
    words = f"{left} of this step" if left else ""
    text = f"Assessing, {one.stage.value}: {one.n_done:,} of {one.n_total:,}{words}"
    return note(text, share=share)


def board(desk: Desk, pid: str) -> tuple[Any, ...]:
    """Advice, its button, the table without test images, a look's button, and the reasons."""
    project = desk.snapshot(pid)
    try:
        found, assessed = found_and_assessed(project)
    except (NothingToSearchError, ProjectError):
        found, assessed = None, None
    unseen: tuple[Any, ...] = note(""), "", {}  # nothing of the test images
    if found is None:
        hidden = gr.Button(visible=False), gr.Dataframe(visible=False)
        return note(""), *hidden, _look_button(project, False), *unseen, *details.nothing()
    table = _standings(project, found, assessed)
    return (
        _advice(table, assessed),
        gr.Button(visible=assessed is not None),
        _frame(table, tested=False),
        _look_button(project, found.test is not None),
        *unseen,
        *details.show(pid, project, found, assessed),
    )


def look(desk: Desk, pid: str) -> tuple[Any, ...]:
    """The table with its test columns, and what they say; the look is counted."""
    with desk.changing(pid) as project:
        found, assessed = found_and_assessed(project)
        if found is None or found.test is None:
            raise NothingToSearchError("there are no test results yet; optimize first")
        project.test_looks += 1
        table = _standings(project, found, assessed)
        return (
            _look_button(project, True),
            _frame(table, tested=True),
            note("\n".join(table.sentences)),
            results_digest(project, found, assessed),
        )


def use(desk: Desk, pid: str) -> Any:
    """Take the recommended vote, which ends asking all; coverage stays as it was chosen."""
    _, assessed = found_and_assessed(desk.snapshot(pid))
    if assessed is None:
        raise NothingToSearchError("images, labels or questions changed; optimize and assess again")
    kind = assessed.recommendation.kind
    with desk.changing(pid) as project:
        ended = f" with the questions of {project.chosen.value}, no longer all"
        instead = ended if project.all_questions else ""
        project.vote, project.all_questions = kind, False
    said = f"Taken: the vote by “{kind.value}”{instead}. Recognizer shows it and writes it."
    return note(said, "good")


def forget(_desk: Desk, _pid: str) -> Any:
    """What a choice said is not said again when the tab is opened anew."""
    return note("")


def _standings(project: Project, found: Results, assessed: Assessment | None) -> Standings:
    return standings(project.chosen, found, assessed, read_pace(project))


def _advice(table: Standings, assessed: Assessment | None) -> Any:
    tone = "plain" if assessed is None else "warn" if table.warnings else "good"
    return note("\n".join(one for one in (table.recommendation, *table.warnings) if one), tone)


def _frame(table: Standings, *, tested: bool) -> Any:
    """How good, then what it costs, then the rest; a narrow page shows the first columns."""
    frame = standings_frame(table)
    names = [*FIRST, *(name for name in frame.columns if name not in FIRST)]
    own = [name for name in names if tested or not str(name).startswith("test")]
    return gr.Dataframe(frame[own], visible=True)


def _look_button(project: Project, possible: bool) -> Any:
    n = project.test_looks
    times = "not yet looked at" if not n else "looked at once" if n == 1 else f"looked at {n} times"
    return gr.Button(f"Look at the test images ({times})", interactive=possible)
