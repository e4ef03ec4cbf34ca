"""Last stretch: choose a recognizer, take it with you, try it on a new picture."""

from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

import gradio as gr
import numpy as np
from PIL import Image

from vqa_state.errors import (
    NothingToSearchError,
    ProjectError,
    RecognizerError,
    VQAStateError,
)
from vqa_state.recognizer import Recognizer
from vqa_state.scores import Objective
from vqa_state.tuning import recognizer_path, refresh
from vqa_state.web import checks, verdicts, widgets
from vqa_state.web.desk import Desk
from vqa_state.web.page import Page
from vqa_state.web.tabs import recheck
from vqa_state.web.tabs.optimize import HINTS
from vqa_state.web.views import download, note, unfolding

__all__ = ["Parts", "build", "wire"]

SMALL = {"video": {"width": 640, "height": 480}}


@dataclass(frozen=True)
class Parts:
    """Components of the tab."""

    tab: gr.Tab
    objective: gr.Radio
    about: gr.HTML
    link: gr.HTML
    verdict: gr.HTML
    camera: gr.Image
    seen: gr.HTML
    other: recheck.Parts


def build(tab: gr.Tab) -> Parts:
    """Draw the tab."""
    choices = [(f"{one.value} – {hint}", one.value) for one, hint in HINTS.items()]
    objective = gr.Radio(choices, label="Recognizer", elem_id="objective")
    about = widgets.note("about")
    link = widgets.note("download")
    gr.Markdown("### Try it on a picture")
    verdict = widgets.verdict("verdict")
    with gr.Accordion("Try it with the camera", open=False):
        camera = gr.Image(
            sources=["webcam"], type="numpy", label="Camera", show_label=False, elem_id="camera",
            webcam_options=gr.WebcamOptions(mirror=False, constraints=SMALL),
        )  # fmt: skip
        seen = widgets.verdict("camera-verdict")
    return Parts(tab, objective, about, link, verdict, camera, seen, recheck.build())


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab."""
    shown = [parts.objective, parts.about, parts.link, parts.verdict]
    page.fill(show, shown)
    page.refresh(parts.tab, show, shown)
    page.on(parts.objective.input, choose, [parts.objective], shown[1:])
    recheck.wire(parts.other, page)
    page.on(parts.camera.change, see, [parts.objective, parts.camera], [parts.seen])


def show(desk: Desk, pid: str) -> Any:
    """Choice, what it is, its link, and a place to try it."""
    with desk.reading(pid) as project:
        chosen = project.chosen
    return chosen.value, *_shown(desk, pid, chosen)


def choose(desk: Desk, pid: str, objective: Any) -> Any:
    """Remember the choice; what it is, its link, and a place to try it."""
    chosen = checks.choice(objective, Objective, "the objective")
    with desk.changing(pid) as project:
        project.chosen = chosen
    return _shown(desk, pid, chosen)


def see(desk: Desk, pid: str, objective: Any, frame: Any) -> Any:
    """The verdict on a picture of the camera; nothing when it was put away."""
    if not isinstance(frame, np.ndarray):
        return {}
    try:
        return {"verdict": verdicts.of_picture(desk, pid, objective, Image.fromarray(frame))}
    except VQAStateError as error:
        return {"failure": str(error)}


def _shown(desk: Desk, pid: str, chosen: Objective) -> tuple[Any, Any, Any]:
    place = {"project": pid, "objective": chosen.value}
    none: tuple[Any, Any] = note(""), {}
    project = desk.snapshot(pid)
    try:
        if refresh(project) is None:
            return note(
                "There is no recognizer for these answers and labels: optimize first."
            ), *none
        recognizer = Recognizer.load(recognizer_path(project, chosen))
    except (NothingToSearchError, ProjectError) as error:
        return note(f"There is no recognizer yet: {error}."), *none
    except RecognizerError as error:
        return note(f"{error}", "bad"), *none
    href = f"/projects/{quote(pid)}/recognizers/{quote(chosen.value)}.json"
    return _about(recognizer), download(href, "Download the recognizer (JSON)"), place


def _about(recognizer: Recognizer) -> Any:
    train, n_copies = recognizer.scores.train, recognizer.copies.n_copies
    n_questions = len(recognizer.questions)
    questions = "1 question" if n_questions == 1 else f"{n_questions} questions"
    lines = [
        f"{questions} about {n_copies} copies of an image: {recognizer.calls_per_image} calls to "
        f"the model “{recognizer.model.name}”.",
        f"It recognizes {train.n_recognized} of the {train.n_images} training images that chose "
        "its questions; for new images, see the test images on Results.",
    ]
    if not recognizer.origin.finished:
        lines.append("Its search was stopped before the end.")
    texts = [question.text for question in recognizer.questions]
    return unfolding("\n".join(lines), f"its {questions}", texts)
