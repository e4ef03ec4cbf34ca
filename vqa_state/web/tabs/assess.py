"""Part of Results: what a recognizer is worth, what it costs, and which kind of vote to take."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import quote

import gradio as gr

from vqa_state.assessing import Assessment, AssessProgress, Stage, assess, assessment
from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.frontier_marks import marked_points
from vqa_state.jobs import JobState, Snapshot, StopFlag, Work
from vqa_state.pace import read_pace
from vqa_state.project import Project
from vqa_state.searches import Results
from vqa_state.standings import Standings, standings, standings_frame
from vqa_state.standings_words import TABLE_NOTE
from vqa_state.suggesting import hints
from vqa_state.web import trades, watching, widgets
from vqa_state.web.desk import Desk
from vqa_state.web.page import Page
from vqa_state.web.taken import found_and_assessed
from vqa_state.web.views import download, duration, image_card, note

__all__ = ["Parts", "build", "sentences", "wire"]

KIND = "assessing"
MAX_CARDS = 12
N_SHOWN = 8
"""Components of `Parts.shown`, of which a running job changes none."""


@dataclass(frozen=True)
class Parts:
    """Components; `shown` are in the order of `board`."""

    start: gr.Button
    stop: gr.Button
    progress: gr.HTML
    shown: tuple[Any, ...]
    use: gr.Button
    table: gr.Dataframe
    used: gr.HTML


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
    gr.Markdown(
        "### Which one to take\nAssess repeats the whole search on resamples of the training "
        "images, each time judging the images that it left out: what it keeps is what new images "
        "will see. It also fits other kinds of vote, and trains a rival without questions."
    )
    with gr.Row():
        start = gr.Button("Assess", variant="primary", elem_id="assess-start", scale=0)
        stop = gr.Button("Stop", interactive=False, elem_id="assess-stop", scale=0)
    progress = widgets.note("assess-progress")
    advice = widgets.note("recommendation")
    use = gr.Button("Use it", elem_id="use-it", visible=False, scale=0)
    used = widgets.note("used")
    table = gr.Dataframe(
        interactive=False, elem_id="standings", show_label=False, visible=False, max_height=760
    )
    gr.Markdown(TABLE_NOTE)
    with gr.Row():
        with gr.Column(min_width=300):
            gr.Markdown("#### What each further question buys")
            frontier = widgets.trade("frontier")
        with gr.Column(min_width=300):
            gr.Markdown("#### What abstaining buys, out of bag")
            curve = widgets.trade("coverage-curve")
    doubtful = widgets.evidence("doubtful")
    following = widgets.evidence("label-next")
    link = widgets.note("report-link")
    shown = (advice, use, table, frontier, curve, doubtful, following, link)
    return Parts(start, stop, progress, shown, use, table, used)


def wire(parts: Parts, page: Page, tab: gr.Tab, looked: Any) -> None:
    """Connect it; `looked` is the event of a counted look at the test images."""
    shown = [parts.progress, parts.start, parts.stop, *parts.shown]
    follow = watching.Watch(KIND, view).wire(page, shown, parts.stop)
    started = page.on(parts.start.click, start, (), [])
    for trigger in (started.success, page.arrived.then, tab.select):
        follow(trigger)
    page.on(parts.use.click, use, (), [parts.used])
    page.refresh(tab, forget, [parts.used])
    page.on(looked.success, tested, (), [parts.table])


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
    buttons = watching.buttons(snapshot)
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
    left = report.seconds_left
    words = "" if left is None else f", about {duration(left)} left of this step"
    text = f"Assessing, {one.stage.value}: {one.n_done:,} of {one.n_total:,}{words}"
    return note(text, share=share)


def board(desk: Desk, pid: str) -> tuple[Any, ...]:
    """Advice, its button, the table without test images, charts, cards, and the report's link."""
    project = desk.snapshot(pid)
    try:
        found, assessed = found_and_assessed(project)
    except (NothingToSearchError, ProjectError):
        found, assessed = None, None
    if found is None:
        hidden = gr.Button(visible=False), gr.Dataframe(visible=False)
        first = {"empty": "Optimize first, then assess."}
        return note(""), *hidden, first, first, {}, {}, note("")
    table = _standings(project, found, assessed)
    return (
        _advice(table, assessed),
        gr.Button(visible=assessed is not None),
        _frame(table, tested=False),
        *_charts(found, assessed),
        *_cards(pid, project, found, assessed),
        download(
            f"/projects/{quote(pid)}/report.html",
            "Keep a report that prints (HTML; it counts as a look at the test images)",
        ),
    )


def use(desk: Desk, pid: str) -> Any:
    """Take the recommended vote; coverage and stopping early stay as they were chosen."""
    _, assessed = found_and_assessed(desk.snapshot(pid))
    if assessed is None:
        raise NothingToSearchError("images, labels or questions changed; optimize and assess again")
    kind = assessed.recommendation.kind
    desk.take(pid, replace(desk.taken(pid), vote=kind))
    return note(f"Taken: the vote by “{kind.value}”. Recognizer shows it and writes it.", "good")


def tested(desk: Desk, pid: str) -> Any:
    """The table with test images, after a look that was counted."""
    project = desk.snapshot(pid)
    found, assessed = found_and_assessed(project)
    if found is None or found.test is None or not project.test_looks:
        raise NothingToSearchError("look at the test images first; the button counts it")
    return _frame(_standings(project, found, assessed), tested=True)


def sentences(project: Project, found: Results) -> str:
    """The comparisons on the test images, corrected for how many they are."""
    return "\n".join(_standings(project, found, assessment(project, found)).sentences)


def forget(_desk: Desk, _pid: str) -> Any:
    """What a choice said is not said again when the tab is opened anew."""
    return note("")


def _standings(project: Project, found: Results, assessed: Assessment | None) -> Standings:
    return standings(project.chosen, found, assessed, read_pace(project))


def _advice(table: Standings, assessed: Assessment | None) -> Any:
    tone = "plain" if assessed is None else "warn" if table.warnings else "good"
    return note("\n".join(one for one in (table.recommendation, *table.warnings) if one), tone)


def _frame(table: Standings, *, tested: bool) -> Any:
    frame = standings_frame(table)
    own = [name for name in frame.columns if tested or not str(name).startswith("test")]
    return gr.Dataframe(frame[own], visible=True)


def _charts(found: Results, assessed: Assessment | None) -> tuple[Any, Any]:
    texts = [question.text for question in found.train.questions]
    points = () if assessed is None else assessed.frontier
    curve = () if assessed is None else assessed.curves.get(assessed.recommendation.kind, ())
    return (
        trades.frontier_value(points, marked_points(found), texts),
        trades.coverage_value(curve),
    )


def _cards(
    pid: str, project: Project, found: Results, assessed: Assessment | None
) -> tuple[Any, Any]:
    """Training images whose label is doubtful, and which image to label next."""
    hinted = hints(project, found, assessed)
    subset = found.searches[project.chosen].subset
    texts = [found.train.questions[position].text for position in subset]
    states = [project.states.positive, project.states.negative]

    def evidence(title: str, ones: Any) -> Any:
        cards = [
            image_card(project, one.image_id, texts) | {"note": one.reason(*states)}
            for one in ones[:MAX_CARDS]
        ]
        return {"project": pid, "states": states, "title": title, "cards": cards}

    n_unasked = hinted.n_unasked
    doubtful = evidence("Possibly mislabelled", hinted.doubtful) if hinted.doubtful else {}
    if not hinted.next and not n_unasked:
        return doubtful, {}
    title = "Label next: the vote on these is the closest"
    if n_unasked:
        title = (
            f"{title}. {n_unasked} images without a label lack answers; "
            "“Suggest labels” on Images asks about them"
        )
    return doubtful, evidence(title, hinted.next)
