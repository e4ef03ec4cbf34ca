"""The choice of a model, on the tab Ask: what it is, saying yes to it, bringing it here, a look."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state import models
from vqa_state.errors import ModelError, VQAStateError
from vqa_state.models.address import Device, ModelAddress, Precision, Source
from vqa_state.models.approval import check_approved, is_approved
from vqa_state.models.availability import Standing, convert, standing
from vqa_state.models.hub.snapshots import download
from vqa_state.study.vision_check import CheckProgress, check_model
from vqa_state.web import arguments, job_watcher, widgets
from vqa_state.web.jobs import JobState, Snapshot, StopFlag, Work
from vqa_state.web.page import Page
from vqa_state.web.session import Desk
from vqa_state.web.tabs.ask.model_choices import list_offers, listed, server_alone, which_model
from vqa_state.web.tabs.ask.model_words import found_words, kind_words, progress_note
from vqa_state.web.view_data import note

__all__ = ["Parts", "about", "build", "listed", "wire"]

#: All kinds of work are watched by one line of the page, so they share a kind.
KIND = "preparing the model"

HINT = "or type hub:OWNER/NAME, folder:/path/to/model, or server:http://host:port/v1#MODEL"


@dataclass(frozen=True)
class Parts:
    """Components of the choice."""

    model: gr.Dropdown
    about: gr.HTML
    allow: gr.Button
    download: gr.Button
    convert: gr.Button
    offers: gr.Button
    check: gr.Button
    stop: gr.Button
    progress: gr.HTML
    device: gr.Dropdown
    precision: gr.Dropdown
    prompt: gr.Textbox


def build() -> Parts:
    """Draw the choice."""
    model = gr.Dropdown(
        listed(""), label="Model", info=HINT, elem_id="model", allow_custom_value=True
    )
    shown = widgets.note("model-about")
    with gr.Row():
        allow = gr.Button(
            "Allow this model", elem_id="model-allow", visible=False, scale=0, min_width=190
        )
        bring = gr.Button("Download", elem_id="model-download", visible=False, scale=0)
        old = gr.Button("Convert", elem_id="model-convert", visible=False, scale=0)
        offers = gr.Button(
            "Which models has it?", elem_id="model-offers", visible=False, scale=0, min_width=210
        )
        look = gr.Button("Check: does it see?", elem_id="model-check", scale=0, min_width=210)
        stop = gr.Button("Stop", elem_id="model-stop", visible=False, scale=0)
    progress = widgets.note("model-progress")
    with gr.Accordion("Advanced: how a local model runs, and its prompt", open=False):
        gr.Markdown("All of this can change answers, so other choices need other answers.")
        with gr.Row(equal_height=True):
            device = gr.Dropdown([one.value for one in Device], label="Device")
            precision = gr.Dropdown([one.value for one in Precision], label="Precision")
        prompt = gr.Textbox(
            label="Prompt",
            placeholder="{question} Answer yes or no.",
            info="with {question} where the question goes; empty: the model family's own",
            elem_id="model-prompt",
        )
    offered = (shown, allow, bring, old, offers, look, stop, progress)
    return Parts(model, *offered, device, precision, prompt)


def wire(parts: Parts, page: Page) -> list[Any]:
    """Connect the choice; return the events after which asking may cost something else."""
    told = [parts.about, parts.allow, parts.download, parts.convert, parts.offers]
    shown = [parts.progress, parts.check, parts.stop]
    follow = job_watcher.Watch(KIND, view).wire(page, shown, parts.stop)
    settings = [parts.device, parts.precision, parts.prompt]
    picked = page.on(parts.model.change, pick, [parts.model], [*told, *settings])
    for field in (parts.device.input, parts.precision.input, parts.prompt.blur):
        page.on(field, adjust, [parts.model, *settings], [parts.model])
    page.on(parts.allow.click, allow, [parts.model], told)
    page.on(parts.offers.click, list_offers, [parts.model], [parts.about, parts.model])
    ended = []
    starts = {
        parts.download: start_download,
        parts.convert: start_convert,
        parts.check: start_check,
    }
    for button, fn in starts.items():
        started = page.on(button.click, fn, [parts.model], [])
        ended.append(page.on(follow(started.success).then, about, [parts.model], told))
    follow(page.arrived.then)
    return [picked, *ended]


def pick(desk: Desk, pid: str, model: Any) -> Any:
    """What to show of a model that was picked or typed, and its settings."""
    name = arguments.text(model, "the model")
    address = _address(name)
    settings: tuple[Any, ...] = (Device.AUTO.value, Precision.AUTO.value, "")
    if address is not None:
        settings = (address.device.value, address.precision.value, address.prompt)
    return *about(desk, pid, name), *settings


def adjust(_desk: Desk, _pid: str, model: Any, device: Any, precision: Any, prompt: Any) -> Any:
    """The address with other settings."""
    name = arguments.text(model, "the model")
    address = _address(name)
    if address is None:
        return name
    changed = ModelAddress(
        address.source,
        address.where,
        address.model,
        address.revision,
        arguments.choice(device, Device, "the device"),
        arguments.choice(precision, Precision, "the precision"),
        arguments.text(prompt, "the prompt").strip(),
    )
    return str(changed)


def about(desk: Desk, _pid: str, model: Any) -> Any:
    """What the model is, and whether it must be allowed, downloaded, converted or named first."""
    name = arguments.text(model, "the model")
    if not name or name in models.names():
        return note(found_words(desk, name)), *_buttons()
    url = server_alone(name)
    if url is not None:
        shown, can_list = which_model(url)
        return shown, *_buttons(offers=can_list)
    try:
        address = ModelAddress.parse(name)
    except ModelError as error:
        return note(f"{error}.", "warn"), *_buttons()
    is_new = not is_approved(address)
    # A folder that only a file names is not looked into.
    unseen = is_new and address.source is Source.FOLDER
    stands = Standing.READY if unseen else standing(address)
    must_come = address.source is Source.HUB and stands is Standing.ABSENT
    is_old = stands is Standing.OLD_WEIGHTS
    lines = [kind_words(address, stands), found_words(desk, name)]
    return (
        note("\n".join(line for line in lines if line), "warn" if is_new or is_old else "plain"),
        *_buttons(allow=is_new, download=must_come and not is_new, convert=is_old and not is_new),
    )


def _buttons(
    *, allow: bool = False, download: bool = False, convert: bool = False, offers: bool = False
) -> tuple[gr.Button, ...]:
    """Which of the buttons are there, in the order of the page."""
    return tuple(gr.Button(visible=one) for one in (allow, download, convert, offers))


def allow(desk: Desk, pid: str, model: Any) -> Any:
    """Remember the user's yes."""
    models.choose(arguments.text(model, "the model"))
    return about(desk, pid, model)


def start_download(desk: Desk, pid: str, model: Any) -> None:
    """Begin to bring a model of the hub here."""
    address = ModelAddress.parse(arguments.text(model, "the model"))
    if address.source is not Source.HUB:
        raise ModelError("only a model of the hub can be downloaded: hub:OWNER/NAME")
    check_approved(address)
    desk.jobs.start(pid, KIND, lambda flag: download(address, flag))


def start_convert(desk: Desk, pid: str, model: Any) -> None:
    """Begin to write old weights as safetensors."""
    address = ModelAddress.parse(arguments.text(model, "the model"))
    check_approved(address)
    desk.jobs.start(pid, KIND, lambda _: _converting(address))


def _converting(address: ModelAddress) -> Iterator[str]:
    yield "Converting its weights…"
    convert(address)
    yield "Converted: it can be used now."


def start_check(desk: Desk, pid: str, model: Any) -> None:
    """Begin to load the model and show it pictures."""
    desk.jobs.start(pid, KIND, _checking(desk, arguments.text(model, "the model")))


def _checking(desk: Desk, name: str) -> Work:
    def work(flag: StopFlag) -> Iterator[CheckProgress]:
        for report in check_model(desk.model(name), flag):
            if report.result is not None:
                desk.keep_check(name, report.result)
            yield report

    return work


def view(_desk: Desk, _pid: str, snapshot: Snapshot | None) -> tuple[Any, Any, Any]:
    """Progress, check, and stop, which is there only while it can stop something."""
    start, _ = job_watcher.buttons(snapshot)
    can_stop = snapshot is not None and snapshot.state is JobState.RUNNING
    return progress_note(snapshot), start, gr.Button(visible=can_stop)


def _address(name: str) -> ModelAddress | None:
    """The address, or None for a registered name and for what is being typed."""
    if name in models.names():
        return None
    try:
        return ModelAddress.parse(name)
    except VQAStateError:
        return None
