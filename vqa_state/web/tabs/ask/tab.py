"""Third stretch: ask a model every question about every copy of every image."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.errors import ModelError, NothingToSearchError, ProjectError
from vqa_state.images.augmentation import Augmentation, AugmentationKind
from vqa_state.models.address import ModelAddress
from vqa_state.study.collect import AskProgress, ask, plan
from vqa_state.study.latency import Estimate, estimate, keep_pace
from vqa_state.study.vision_check import CheckProgress
from vqa_state.web import arguments, job_watcher, next_step, widgets
from vqa_state.web.jobs import JobState, Snapshot, StopFlag, Work
from vqa_state.web.model_notes import look_first, look_note, with_told
from vqa_state.web.page import Page
from vqa_state.web.session import Desk
from vqa_state.web.tabs.ask import model
from vqa_state.web.tabs.ask.model_words import preset_of
from vqa_state.web.view_data import duration, note

__all__ = ["Parts", "build", "wire"]

KIND = "asking"
KINDS = [
    ("colour shift, as in the paper", AugmentationKind.RGB_SHIFT.value),
    ("noise", AugmentationKind.GAUSSIAN_NOISE.value),
]


@dataclass(frozen=True)
class Parts:
    """Components of the tab."""

    tab: gr.Tab
    choice: model.Parts
    kind: gr.Radio
    amount: gr.Slider
    n_copies: gr.Slider
    cost: gr.HTML
    start: gr.Button
    stop: gr.Button
    progress: gr.HTML


def build(tab: gr.Tab) -> Parts:
    """Draw the tab."""
    choice = model.build()
    with gr.Accordion("Advanced: copies of each image", open=False):
        gr.Markdown(
            "The model sees slightly changed copies of each image, and all of them vote. "
            "Other copies need other answers."
        )
        with gr.Row(equal_height=True):
            kind = gr.Radio(KINDS, label="Change")
            amount = gr.Slider(0.01, 1.0, step=0.01, label="Amount, as a share of full scale")
            n_copies = gr.Slider(1, 24, step=1, label="Copies of each image")
    cost = widgets.note("cost")
    with gr.Row():
        start = gr.Button(
            "Ask the model", variant="primary", elem_id="ask-start", scale=0, min_width=170
        )
        stop = gr.Button("Stop", interactive=False, elem_id="ask-stop", scale=0, min_width=170)
    progress = widgets.note("ask-progress")
    return Parts(tab, choice, kind, amount, n_copies, cost, start, stop, progress)


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab."""
    settings = [parts.kind, parts.amount, parts.n_copies]
    shown = [parts.progress, parts.start, parts.stop]
    follow = job_watcher.Watch(KIND, view).wire(page, shown, parts.stop)
    follow(parts.tab.select)
    chosen = parts.choice.model
    page.fill(show, [chosen, *settings, parts.cost])
    for event in model.wire(parts.choice, page):
        page.on(event.then, costs, [chosen], [parts.cost])
    page.on(parts.tab.select, costs, [chosen], [parts.cost], queue=False)
    for field in (parts.kind.input, parts.amount.release, parts.n_copies.release):
        page.change(field, augment, [*settings, chosen], [parts.cost], trigger_mode="always_last")
    started = page.on(parts.start.click, start, [chosen], [])
    for trigger in (started.success, page.arrived.then):
        page.then_road(page.on(follow(trigger).then, costs, [chosen], [parts.cost]))


def show(desk: Desk, pid: str) -> Any:
    """Model, settings of the copies, and what asking costs."""
    with desk.reading(pid) as project:
        copies = project.augmentation
        name = project.model
    return (
        gr.Dropdown(model.listed(name), value=name),
        copies.kind.value,
        copies.amount,
        copies.n_copies,
        costs(desk, pid),
    )


def costs(desk: Desk, pid: str, chosen: Any = None) -> Any:
    """What asking the chosen model will cost, before it starts; None: the project's model."""
    project = desk.snapshot(pid)
    name = project.model if chosen is None else arguments.text(chosen, "the model")
    try:
        cost = estimate(project, desk.fingerprint(project, name))
    except (NothingToSearchError, ProjectError):
        return note("There is nothing to ask yet: label images, divide them, and give questions.")
    what = cost.plan
    product = (
        f"{what.n_images:,} images × {what.n_copies} copies × {what.n_questions:,} questions "
        f"= {what.n_calls:,} calls"
    )
    if not what.n_to_ask:
        return note(f"{product}; all of them are answered.", "good")
    asked = f"{what.n_stored:,} are answered, {what.n_to_ask:,} are to be asked."
    return note("\n".join([f"{product}; {asked}", *_takes(cost, name)]))


def _takes(cost: Estimate, name: str) -> list[str]:
    """Time, memory, and the look at a new model, in a sentence each."""
    lines = ["How long that takes is not known here yet: Check measures it."]
    if cost.seconds is not None:
        lines = [f"That takes about {duration(cost.seconds)}, by the pace measured here."]
    if cost.memory is not None:
        lines.append(f"A process with the model in it takes {cost.memory}.")
    elif (megabytes := _weights(name)) is not None:
        lines.append(f"Its weights alone take {megabytes:,} MB of memory in float32.")
    if cost.n_look:
        lines.append(
            f"Before them come up to {cost.n_look} calls, once, to see whether the model sees."
        )
    return lines


def _weights(name: str) -> int | None:
    """Megabytes of a preset's weights; None for all other models."""
    try:
        preset = preset_of(ModelAddress.parse(name))
    except ModelError:
        return None
    return None if preset is None else preset.megabytes()


def augment(
    desk: Desk, pid: str, kind: Any, amount: Any, n_copies: Any, model_chosen: Any = None
) -> Any:
    """Keep the settings of the copies; the new cost."""
    chosen = arguments.choice(kind, AugmentationKind, "the change")
    size, n = arguments.number(amount, "the amount"), arguments.integer(n_copies, "the copies")
    with desk.changing(pid) as project:
        project.augmentation = arguments.stated(lambda: Augmentation(chosen, size, n))
    return costs(desk, pid, model_chosen)


def start(desk: Desk, pid: str, chosen: Any) -> None:
    """Begin to ask, or attach to what is running."""
    name = arguments.text(chosen, "the model")
    plan(desk.snapshot(pid), "")  # what would fail in the job is refused at once
    desk.jobs.start(pid, KIND, asking(desk, pid, name))


def asking(desk: Desk, pid: str, name: str) -> Work:
    """The work: load the model, keep it as the project's, look at it, ask, see how fast it is."""

    def work(stop: StopFlag) -> Iterator[AskProgress | CheckProgress]:
        desk.telling.forget(pid, KIND)
        loaded = desk.model(name)
        with desk.changing(pid) as project:
            project.model, project.fingerprint = loaded.name, loaded.fingerprint
        if plan(desk.snapshot(pid), loaded.fingerprint).n_to_ask:
            yield from look_first(desk.telling, pid, KIND, loaded, stop)
        last: AskProgress | None = None
        for last in ask(desk.snapshot(pid), loaded, stop):
            yield last
        if last is not None and not last.stopped and not last.n_failed:
            keep_pace(desk.snapshot(pid), loaded, stop)

    return work


def view(desk: Desk, pid: str, snapshot: Snapshot | None) -> tuple[Any, Any, Any]:
    """Progress with what is to be known of the model, start and stop."""
    shown = note("") if _is_outdated(desk, pid, snapshot) else _progress(snapshot)
    return with_told(shown, desk.telling(pid, KIND)), *job_watcher.buttons(snapshot)


def _is_outdated(desk: Desk, pid: str, snapshot: Snapshot | None) -> bool:
    """Whether all that was asked is answered, but there is more to ask by now."""
    if snapshot is None or snapshot.state is not JobState.DONE or snapshot.report.n_failed:
        return False
    costs = next_step.cost(desk.snapshot(pid))
    return costs is None or costs.n_to_ask > 0


def _progress(snapshot: Snapshot | None) -> Any:
    early = job_watcher.before_reports(snapshot, "Loading the model…")
    if snapshot is None or early is not None:
        return early
    report: AskProgress | CheckProgress = snapshot.report
    if isinstance(report, CheckProgress):
        return look_note(report)
    answered = report.n_stored + report.n_asked
    lines = [_headline(snapshot.state, report)]
    lines.append(
        f"{answered:,} of {report.n_calls:,} answered ({report.n_stored:,} from the store, "
        f"{report.n_asked:,} asked now)"
    )
    if report.n_failed:
        lines.append(f"{report.n_failed:,} failed; the last one: {report.last_failure}")
    share = answered / report.n_calls if report.n_calls else 1.0
    return note("\n".join(lines), _tone(snapshot.state, report), share)


def _headline(state: JobState, report: AskProgress) -> str:
    if state is JobState.STOPPED:
        return "Stopped. What was answered is kept; ask again to go on."
    if state is JobState.DONE:
        if report.n_failed:
            return "Done, but some calls failed. Ask again: only these are asked."
        return "Done: every question is answered. Next: Optimize."
    return f"Asking{job_watcher.left(report.seconds_left)}"


def _tone(state: JobState, report: AskProgress) -> str:
    if state.alive:
        return "plain"
    return "good" if state is JobState.DONE and not report.n_failed else "warn"
