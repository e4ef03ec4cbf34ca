"""Above the tabs: which project is open, and how a new one is made.

The open project stands in the address of the page (?p=…), so that a reload, a bookmark and a
second tab show the same one; choosing another project opens its address.
"""

from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.errors import VQAStateError
from vqa_state.web import arguments, widgets
from vqa_state.web.page import OPTIONS, message
from vqa_state.web.session import Desk
from vqa_state.web.view_data import note

__all__ = ["Parts", "build", "wire"]

CHOOSE = "Choose a project above, or make a new one."
MAKE = (
    "Make your first project: say what the thing is called and its two states, then add pictures "
    "of it. You will find out which yes/no questions recognize the state, and take them with you."
)
OPEN_JS = """(id) => {
  const address = new URL(window.location.href);
  // The field tells its value also when it is only left: that must not load the page anew.
  if (!id || id === address.searchParams.get('p')) return;
  address.searchParams.set('p', id);
  address.searchParams.delete('tab');
  window.location.assign(address);
}"""


@dataclass(frozen=True)
class Parts:
    """Components of the header."""

    project: gr.Dropdown
    new: gr.Accordion
    name: gr.Textbox
    positive: gr.Textbox
    negative: gr.Textbox
    create: gr.Button
    created: gr.Textbox
    pid: gr.Textbox
    road: gr.HTML


def build() -> Parts:
    """Draw the header."""
    with gr.Row(elem_id="header"):
        gr.Markdown("# VQA State", elem_id="title")
        project = gr.Dropdown([], label="Project", elem_id="project", scale=0, min_width=280)
    with gr.Accordion("New project", open=False, elem_id="new-project") as new:
        with gr.Row(equal_height=True):
            name = gr.Textbox(
                label="The thing", placeholder="refrigerator door", elem_id="new-name"
            )
            positive = gr.Textbox(label="One state", placeholder="open", elem_id="new-positive")
            negative = gr.Textbox(
                label="The other state", placeholder="closed", elem_id="new-negative"
            )
        create = gr.Button(
            "Create project", variant="primary", elem_id="create", scale=0, min_width=170
        )
    road = widgets.note("road")
    return Parts(
        project, new, name, positive, negative, create,
        created=gr.Textbox(visible=False), pid=gr.Textbox(visible=False), road=road,
    )  # fmt: skip


def wire(parts: Parts, desk: Desk, demo: gr.Blocks, tabs: gr.Tabs) -> Any:
    """Connect the header; return the event after which the open project is known."""

    def arrive(request: gr.Request) -> Any:
        return arrival(desk, request.query_params.get("p"), request.query_params.get("tab"))

    def make(name: Any, positive: Any, negative: Any) -> Any:
        try:
            return create(desk, name, positive, negative)
        except VQAStateError as error:
            raise message(error) from error

    parts.project.input(None, parts.project, None, js=OPEN_JS, **OPTIONS)
    fields = [parts.name, parts.positive, parts.negative]
    for trigger in (parts.create.click, parts.negative.submit):
        made = trigger(make, fields, parts.created, **OPTIONS)
        made.success(None, parts.created, None, js=OPEN_JS, **OPTIONS)
    shown = [parts.pid, parts.project, parts.new, parts.road, tabs]
    return demo.load(arrive, None, shown, queue=False, **OPTIONS)


def create(desk: Desk, name: Any, positive: Any, negative: Any) -> str:
    """Make a project of what was typed; its id."""
    thing = arguments.text(name, "the thing")
    return desk.create(
        thing, arguments.text(positive, "a state"), arguments.text(negative, "a state")
    )


def arrival(desk: Desk, pid: str | None, tab: str | None) -> Any:
    """What a page shows when it opens: pid, list of projects, new project, road, tabs."""
    listing = desk.listing()
    choices = [(name, key) for key, name in listing.items()]
    if pid in listing:
        chosen = gr.Dropdown(choices, value=pid)
        try:
            desk.snapshot(pid)
        except VQAStateError as error:
            said = note(f"This project cannot be opened: {error}.", "bad")
            return "", chosen, gr.Accordion(open=False), said, gr.Tabs(visible=False)
        return pid, chosen, gr.Accordion(open=False), gr.skip(), _tabs(tab)
    words = CHOOSE if listing else MAKE
    if pid:
        words = f"There is no such project here. {words}"
    chosen = gr.Dropdown(choices, value=None)
    return "", chosen, gr.Accordion(open=True), note(words), gr.Tabs(visible=False)


def _tabs(tab: str | None) -> gr.Tabs:
    return gr.Tabs(visible=True, selected=tab) if tab else gr.Tabs(visible=True)
