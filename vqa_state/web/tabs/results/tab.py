"""Fifth stretch: which recognizer to take, how good it is, where it fails, and why."""

from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.project.project import Project
from vqa_state.project.searches import Results, search_path
from vqa_state.search.objectives import Objective
from vqa_state.web import widgets
from vqa_state.web.heatmap import heat_value, questions_digest
from vqa_state.web.page import Page
from vqa_state.web.recognizer_choice import found_and_assessed
from vqa_state.web.session import Desk
from vqa_state.web.tabs.results import details, leaderboard
from vqa_state.web.tabs.results.galleries import choose_question, choose_row, results_digest
from vqa_state.web.view_data import note

__all__ = ["Parts", "build", "wire"]


@dataclass(frozen=True)
class Parts:
    """Components of the tab.

    `missed_of` and `answers_of` hold a digest of what the evidence of the same name is about.
    """

    tab: gr.Tab
    note: gr.HTML
    body: gr.Column
    worth: leaderboard.Parts
    missed: gr.HTML
    test_missed: gr.HTML
    missed_of: gr.Textbox
    good: gr.Accordion
    heatmap: gr.HTML
    answers: gr.HTML
    answers_of: gr.Textbox
    why: details.Parts


def build(tab: gr.Tab) -> Parts:
    """Draw the tab: what to take first, then the test, then where it fails, then why."""
    said = widgets.note("results-note")
    with gr.Column(visible=False) as body:
        worth = leaderboard.build()
        missed = widgets.evidence("train-missed")
        test_missed = widgets.evidence("test-missed")
    with gr.Accordion(
        "Which questions are good", open=False, visible=False, elem_id="good-questions"
    ) as good:
        gr.Markdown(
            "Right answers among the valid ones, in %, on the training images. Hatched: more than "
            "20 % of the answers are invalid. Choose a cell to see what the model said."
        )
        cells = widgets.heatmap("heatmap")
        answers = widgets.evidence("question-answers")
    why = details.build()
    missed_of, answers_of = gr.Textbox(visible=False), gr.Textbox(visible=False)
    return Parts(
        tab, said, body, worth, missed, test_missed, missed_of, good, cells, answers, answers_of,
        why,
    )  # fmt: skip


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab."""
    shown = [
        parts.note, parts.body, parts.missed, parts.good, parts.heatmap, parts.answers,
    ]  # fmt: skip
    for trigger in (page.arrived.then, parts.tab.select):
        page.on(trigger, show, [parts.missed_of, parts.answers_of], shown, queue=False)
    page.on_data(parts.heatmap.pick, choose_question, (), [parts.answers, parts.answers_of])
    page.on_data(
        parts.worth.table.select, choose_row, [parts.worth.looked],
        [parts.missed, parts.test_missed, parts.missed_of],
    )  # fmt: skip
    leaderboard.wire(parts.worth, page, parts.tab, parts.test_missed, parts.why)


def show(desk: Desk, pid: str, missed_of: Any, answers_of: Any) -> Any:
    """All but what is assessed. Evidence goes when what it is about changed.

    Evidence that a quick hand chose while this was on its way is not known here yet, and stays.
    """
    project = desk.snapshot(pid)
    heat = heat_value(project)
    try:
        found, assessed = found_and_assessed(project)
        said = _said(project, found, was_asked=bool(heat))
    except (NothingToSearchError, ProjectError) as error:
        found, assessed, said = None, None, note(f"No results yet: {error}.", "warn")
    return (
        said,
        gr.Column(visible=found is not None),
        _kept(missed_of, results_digest(project, found, assessed)),
        gr.Accordion(visible=bool(heat)),
        heat,
        _kept(answers_of, questions_digest(project) if heat else ""),
    )


def _kept(about: Any, now: str) -> Any:
    """Evidence about what is there now stays; there is none to clear if it is about nothing."""
    return gr.skip() if about in ("", None, now) else {}


def _said(project: Project, found: Results | None, *, was_asked: bool) -> Any:
    """What is to be done before there are results, or what they lack."""
    if found is None:
        return note(_missing(project, was_asked=was_asked), "warn")
    n_left_out = found.evaluation.n_left_out_train + found.evaluation.n_left_out_test
    if not n_left_out:
        return note("")
    images = "1 image is" if n_left_out == 1 else f"{n_left_out} images are"
    return note(f"{images} left out, because answers are missing.", "warn")


def _missing(project: Project, *, was_asked: bool) -> str:
    if not was_asked:
        return "No results yet: ask the model on the tab Ask, then optimize."
    if any(search_path(project, one).exists() for one in Objective):
        return "Images, labels or questions changed since the last search: optimize again."
    return "No results yet: choose the questions on the tab Optimize."
