"""Part of Optimize: a button that searches although training images lack answers.

It is there only where answers are missing, and says how many images the search would see. The page
sends back what its button said, so that nobody agrees to another part than the one that was shown.
"""

from dataclasses import dataclass
from typing import Any

import gradio as gr

from vqa_state.answers.completeness import Completeness
from vqa_state.errors import MissingAnswersError, NothingToSearchError, ProjectError
from vqa_state.project.project import Project
from vqa_state.study.answer_tables import read_tables
from vqa_state.web.session import Desk

__all__ = ["Parts", "advice", "answers_of", "build", "require_agreed", "require_whole", "show"]


@dataclass(frozen=True)
class Parts:
    """Components; `offered` holds what the button offers, "4 of 6"."""

    start: gr.Button
    offered: gr.Textbox


def build() -> Parts:
    """Draw it beside the button that searches on all images."""
    start = gr.Button(
        "Optimize on a part", visible=False, elem_id="optimize-part", scale=0, min_width=280
    )
    return Parts(start, gr.Textbox(visible=False))


def show(desk: Desk, pid: str) -> tuple[Any, str]:
    """The button with the part that it offers; hidden where there is nothing to agree to."""
    answers = answers_of(desk.snapshot(pid))
    if answers is None or not answers.part_is_searchable:
        return gr.Button(visible=False), ""
    words = f"Optimize on {answers.part} images"
    return gr.Button(words, visible=True), answers.part


def answers_of(project: Project) -> Completeness | None:
    """How far the project is answered; None if it was never asked, or has no question."""
    try:
        return read_tables(project).answers
    except (NothingToSearchError, ProjectError):
        return None


def advice(answers: Completeness | None) -> str:
    """What to do where training images lack answers; "" where none does."""
    if answers is None or answers.train.whole:
        return ""
    ask = f"{answers.train.lacks}. Ask the model for them on the tab Ask"
    if not answers.part_is_searchable:
        return f"{ask}, then optimize."
    return (
        f"{ask}, then optimize; or search on the {answers.train.n_complete} complete ones only: "
        "then the recognizer says so, and the test stays closed."
    )


def require_whole(project: Project) -> None:
    """Do nothing unless training images lack answers.

    Raises:
        MissingAnswersError: if some do; it says what to do.
    """
    said = advice(answers_of(project))
    if said:
        raise MissingAnswersError(said)


def require_agreed(project: Project, offered: object) -> None:
    """Do nothing if the part that a page offered is what a search would see now.

    Raises:
        MissingAnswersError: if it is another one by now.
    """
    answers = answers_of(project)
    now = "" if answers is None else answers.part
    if offered != now:
        raise MissingAnswersError(
            f"meanwhile {now or 'no'} training images have all their answers; open this "
            "tab again, and it says what can be searched"
        )
