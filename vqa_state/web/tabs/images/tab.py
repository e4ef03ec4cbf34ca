"""First stretch: add pictures, label them, divide them into train and test."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import gradio as gr

from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.study.collect import plan
from vqa_state.web import arguments, widgets
from vqa_state.web.page import Page
from vqa_state.web.session import Desk
from vqa_state.web.tabs.images import suggestions as suggest
from vqa_state.web.view_data import note

__all__ = ["Parts", "build", "wire"]


@dataclass(frozen=True)
class Parts:
    """Components of the tab."""

    tab: gr.Tab
    grid: gr.HTML
    share: gr.Slider
    seed: gr.Number
    afresh: gr.Checkbox
    sure: gr.Checkbox
    split: gr.Button
    note: gr.HTML
    suggest: suggest.Parts


def build(tab: gr.Tab) -> Parts:
    """Draw the tab."""
    grid = widgets.label_grid("labels")
    suggested = suggest.build()
    with gr.Accordion("Divide into train and test", open=True, elem_id="divide"):
        gr.Markdown(
            "Training images choose the questions; test images only say how good the choice is. "
            "Each state is divided on its own, and look-alikes stay together."
        )
        with gr.Row(equal_height=True):
            share = gr.Slider(0.1, 0.9, 0.5, step=0.05, label="Share for training")
            seed = gr.Number(0, label="Seed of the split and of the copies", precision=0, minimum=0)
            afresh = gr.Checkbox(False, label="Divide again those that have a side already")
        sure = gr.Checkbox(
            False, label="Ask everything again with the new seed", visible=False, elem_id="new-seed"
        )
        split = gr.Button("Divide", variant="primary", elem_id="split", scale=0, min_width=170)
        said = widgets.note("split-note")
    return Parts(tab, grid, share, seed, afresh, sure, split, said, suggested)


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab."""
    shown = [parts.grid, parts.seed, parts.note]
    page.fill(show, shown)
    for trigger in (parts.grid.uploaded, parts.grid.changed):
        page.change(trigger, tell, (), [parts.note], trigger_mode="always_last")
    page.change(parts.grid.reload, show, (), shown)
    inputs = [parts.share, parts.seed, parts.afresh, parts.sure]
    page.change(parts.split.click, divide_if_sure, inputs, [parts.grid, parts.note, parts.sure])
    suggest.wire(parts.suggest, page, parts.grid)


def show(desk: Desk, pid: str) -> Any:
    """Grid, seed and note."""
    with desk.reading(pid) as project:
        return suggest.grid_value(desk, pid), project.seed, _sides(project)


def tell(desk: Desk, pid: str) -> Any:
    """The note alone: the grid shows already what was done in it."""
    with desk.reading(pid) as project:
        return _sides(project)


def divide_if_sure(desk: Desk, pid: str, share: Any, seed: Any, afresh: Any, sure: Any) -> Any:
    """Divide; if a new seed would cost stored answers, say so first and show a box to tick."""
    project, number = desk.snapshot(pid), arguments.integer(seed, "the seed")
    n_lost = 0 if sure is True else _lost(project, desk.fingerprint(project, project.model), number)
    if n_lost:
        said = (
            f"Nothing is divided yet. Seed {number} makes other copies of the images, so "
            f"{n_lost:,} stored answers would no longer count, nor what was optimized with them.\n"
            f"To keep them, set the seed back to {project.seed}. To ask everything again, tick the "
            "box above and press Divide once more."
        )
        return gr.skip(), note(said, "warn"), gr.Checkbox(False, visible=True)
    return *divide(desk, pid, share, seed, afresh), gr.Checkbox(False, visible=False)


def _lost(project: Project, fingerprint: str, seed: int) -> int:
    """Stored answers that count now and would not with this seed."""
    if not 0 <= seed < 2**32:  # it is refused anyway
        return 0
    try:
        now, then = (plan(one, fingerprint) for one in (project, replace(project, seed=seed)))
    except (NothingToSearchError, ProjectError):  # no label or no question: nothing counts
        return 0
    return max(0, now.n_stored - then.n_stored)


def divide(desk: Desk, pid: str, share: Any, seed: Any, afresh: Any) -> Any:
    """Give labelled images a side; grid and note."""
    part = arguments.number(share, "the share for training")
    number = arguments.integer(seed, "the seed")
    with desk.changing(pid) as project:
        project.seed = number
        arguments.stated(lambda: project.assign_splits(train_share=part, afresh=afresh is True))
    return suggest.grid_value(desk, pid), tell(desk, pid)


def _sides(project: Project) -> Any:
    """How many of each state are on each side, what lacks, and which images look alike."""
    if not project.images:
        return note("")
    counts = {
        split: [sum(i.label == label for i in project.labelled(split)) for label in (1, -1)]
        for split in (Split.TRAIN, Split.TEST)
    }
    names = (project.states.positive, project.states.negative)
    lines = [
        f"{split.value.capitalize()}: "
        + ", ".join(f"{n} {name}" for n, name in zip(of_split, names, strict=True))
        for split, of_split in counts.items()
    ]
    warnings = []
    if any(n == 0 for of_split in counts.values() for n in of_split):
        warnings.append("Both states are needed on both sides: label more images, then divide.")
    astride = project.look_alikes_astride()
    if astride:
        warnings.append(f"{_groups(project, astride)}, on both sides, so the test flatters.")
    together = [group for group in project.look_alikes() if group not in astride]
    if together:
        lines.append(f"{_groups(project, together)}, kept on one side.")
    return note("\n".join([*lines, *warnings]), "warn" if warnings else "good")


def _groups(project: Project, groups: Sequence[Sequence[str]]) -> str:
    first = " and ".join(project.images[image_id].name for image_id in groups[0][:2])
    many = f"{len(groups)} groups of images look" if len(groups) > 1 else "A group of images looks"
    return f"{many} alike (such as {first})"
