"""The choice of a model, on the tab Ask: what it is, saying yes to it, bringing it here, a look."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

import gradio as gr

from vqa_state import models
from vqa_state.asking import plan
from vqa_state.checking import CheckProgress, ModelCheck, check_model
from vqa_state.errors import ModelError, NothingToSearchError, ProjectError, VQAStateError
from vqa_state.jobs import JobState, Snapshot, StopFlag, Work
from vqa_state.models.address import Device, ModelAddress, Precision, Source
from vqa_state.models.approval import approved, is_approved
from vqa_state.models.hub import DownloadProgress, download, is_cached
from vqa_state.models.presets import PRESETS
from vqa_state.models.sight import Sight
from vqa_state.web import checks, watching, widgets
from vqa_state.web.desk import Desk
from vqa_state.web.page import Page
from vqa_state.web.views import duration, note

__all__ = ["Parts", "about", "build", "listed", "wire"]

#: Both kinds of work are watched by one line of the page, so they share a kind.
KIND = "preparing the model"

HINT = "or type hub:OWNER/NAME, folder:/path/to/model, or server:http://host:port/v1#MODEL"


@dataclass(frozen=True)
class Parts:
    """Components of the choice."""

    model: gr.Dropdown
    about: gr.HTML
    allow: gr.Button
    download: gr.Button
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
        look = gr.Button("Check: does it see?", elem_id="model-check", scale=0, min_width=210)
        stop = gr.Button("Stop", elem_id="model-stop", interactive=False, scale=0)
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
    return Parts(model, shown, allow, bring, look, stop, progress, device, precision, prompt)


def wire(parts: Parts, page: Page) -> None:
    """Connect the choice."""
    told = [parts.about, parts.allow, parts.download]
    shown = [parts.progress, parts.check, parts.stop]
    follow = watching.Watch(KIND, view).wire(page, shown, parts.stop)
    settings = [parts.device, parts.precision, parts.prompt]
    page.on(parts.model.change, pick, [parts.model], [*told, *settings])
    for field in (parts.device.input, parts.precision.input, parts.prompt.blur):
        page.on(field, adjust, [parts.model, *settings], [parts.model])
    page.on(parts.allow.click, allow, [parts.model], told)
    for button, fn in ((parts.download, start_download), (parts.check, start_check)):
        started = page.on(button.click, fn, [parts.model], [])
        page.on(follow(started.success).then, about, [parts.model], told)
    follow(page.arrived.then)


def listed(current: str) -> list[tuple[str, str]]:
    """Titles and names: what is usable, the project's own, then the presets."""
    own = [(name, name) for name in (*models.names(), *approved())]
    known = {name for _, name in own}
    if current and current not in known:
        own.append((current, current))
    presets = [
        (f"{one.title} ({one.address})", one.address)
        for one in PRESETS
        if one.address not in known and one.address != current
    ]
    return own + presets


def pick(desk: Desk, pid: str, model: Any) -> Any:
    """What to show of a model that was picked or typed, and its settings."""
    name = checks.text(model, "the model")
    address = _address(name)
    settings: tuple[Any, ...] = (Device.AUTO.value, Precision.AUTO.value, "")
    if address is not None:
        settings = (address.device.value, address.precision.value, address.prompt)
    return *about(desk, pid, name), *settings


def adjust(_desk: Desk, _pid: str, model: Any, device: Any, precision: Any, prompt: Any) -> Any:
    """The address with other settings."""
    name = checks.text(model, "the model")
    address = _address(name)
    if address is None:
        return name
    changed = ModelAddress(
        address.source,
        address.where,
        address.model,
        address.revision,
        checks.choice(device, Device, "the device"),
        checks.choice(precision, Precision, "the precision"),
        checks.text(prompt, "the prompt").strip(),
    )
    return str(changed)


def about(desk: Desk, pid: str, model: Any) -> Any:
    """What the model is, and whether it must be allowed or downloaded first."""
    name = checks.text(model, "the model")
    if not name or name in models.names():
        return note(_told(desk, pid, name)), gr.Button(visible=False), gr.Button(visible=False)
    try:
        address = ModelAddress.parse(name)
    except ModelError as error:
        return note(f"{error}.", "warn"), gr.Button(visible=False), gr.Button(visible=False)
    is_new = not is_approved(address)
    must_come = address.source is Source.HUB and not is_cached(address)
    lines = [_kind(address, must_come), _told(desk, pid, name)]
    return (
        note("\n".join(line for line in lines if line), "warn" if is_new else "plain"),
        gr.Button(visible=is_new),
        gr.Button(visible=must_come and not is_new),
    )


def _kind(address: ModelAddress, must_come: bool) -> str:
    if address.source is Source.SERVER:
        host = urlsplit(address.where).netloc
        return f"Every picture and question is sent to {host}. Allow it only if that is right."
    if address.source is Source.FOLDER:
        return "It is read from a folder of this machine; nothing leaves it."
    plain = f"{address.source}:{address.where}"
    preset = next((one for one in PRESETS if one.address == plain), None)
    words = "Not on this disk yet" if must_come else "On this disk"
    if preset is None:
        return f"{words}; see its page on the hub for its size and licence."
    needs = f"; it needs {', '.join(preset.needs)}" if preset.needs else ""
    gpu = "; on a processor it takes minutes an image" if preset.wants_gpu else ""
    remark = f"; {preset.remark}" if preset.remark else ""
    size = f"about {preset.megabytes() / 1000:.1f} GB of memory in float32"
    return f"{words}; {size}, licence {preset.licence}{needs}{gpu}{remark}."


def _told(desk: Desk, pid: str, name: str) -> str:
    """What a check has found, with the time that this project would take."""
    found = desk.check(name)
    if found is None:
        return ""
    lines = [found.sentence, *found.notes, f"This process takes {found.memory}."]
    if found.pace is not None:
        try:
            costs = plan(desk.snapshot(pid), found.fingerprint)
        except (NothingToSearchError, ProjectError):
            return "\n".join(lines)
        time_left = duration(found.pace.seconds(costs))
        lines.append(
            f"To ask: {costs.n_to_ask:,} calls, {costs.n_stored:,} are in the store; about "
            f"{time_left} on this machine."
        )
    return "\n".join(lines)


def allow(desk: Desk, pid: str, model: Any) -> Any:
    """Remember the user's yes."""
    models.choose(checks.text(model, "the model"))
    return about(desk, pid, model)


def start_download(desk: Desk, pid: str, model: Any) -> None:
    """Begin to bring a model of the hub here."""
    address = ModelAddress.parse(checks.text(model, "the model"))
    if address.source is not Source.HUB:
        raise ModelError("only a model of the hub can be downloaded: hub:OWNER/NAME")
    desk.jobs.start(pid, KIND, lambda flag: download(address, flag))


def start_check(desk: Desk, pid: str, model: Any) -> None:
    """Begin to load the model and show it pictures."""
    desk.jobs.start(pid, KIND, _checking(desk, checks.text(model, "the model")))


def _checking(desk: Desk, name: str) -> Work:
    def work(flag: StopFlag) -> Iterator[CheckProgress]:
        for report in check_model(desk.model(name), flag):
            if report.result is not None:
                desk.keep_check(name, report.result)
            yield report

    return work


def view(_desk: Desk, _pid: str, snapshot: Snapshot | None) -> tuple[Any, Any, Any]:
    """Progress, check and stop."""
    return _progress(snapshot), *watching.buttons(snapshot)


def _progress(snapshot: Snapshot | None) -> Any:
    if snapshot is None:
        return note("")
    if snapshot.state is JobState.FAILED:
        return note(f"Failed: {snapshot.failure}", "bad")
    report: CheckProgress | DownloadProgress | None = snapshot.report
    if snapshot.state is JobState.STOPPED:
        return note("Stopped. What came is kept.", "warn")
    if report is None:
        return note("Beginning…", share=0.0)
    if isinstance(report, DownloadProgress):
        return _downloaded(report, snapshot.state)
    if report.result is not None:
        return _checked(report.result)
    return note(
        f"Showing it pictures: {report.n_done} of {report.n_total} calls",
        share=report.n_done / report.n_total,
    )


def _downloaded(report: DownloadProgress, state: JobState) -> Any:
    if state is JobState.DONE:
        return note("It is on this disk now.", "good")
    left = report.seconds_left
    words = f"{report.n_bytes / 1e6:,.0f} of {report.total / 1e6:,.0f} MB"
    words += "" if left is None else f", about {duration(left)} left"
    return note(words, share=report.n_bytes / report.total if report.total else 0.0)


def _checked(found: ModelCheck) -> Any:
    tones = {Sight.TELLS: "good", Sight.SEES: "warn", Sight.BLIND: "bad", Sight.SILENT: "bad"}
    return note(found.sentence, tones[found.sight])


def _address(name: str) -> ModelAddress | None:
    """The address, or None for a registered name and for what is being typed."""
    if name in models.names():
        return None
    try:
        return ModelAddress.parse(name)
    except VQAStateError:
        return None
