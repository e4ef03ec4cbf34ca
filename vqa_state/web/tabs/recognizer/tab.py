"""Last stretch: choose a recognizer, take it with you, try it on a new picture."""

from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import quote

import gradio as gr
import numpy as np

from vqa_state.errors import (
    NothingToSearchError,
    ProjectError,
    RecognizerError,
    VQAStateError,
)
from vqa_state.recognizer.recognizer import Recognizer
from vqa_state.search.objectives import Objective
from vqa_state.study.assess import Assessment
from vqa_state.study.optimize import refresh
from vqa_state.votes.rules import VoteKind
from vqa_state.web import arguments, try_recognizer, widgets
from vqa_state.web.page import Page
from vqa_state.web.recognizer_choice import found_and_assessed, taken_from, taken_recognizer
from vqa_state.web.session import Desk
from vqa_state.web.tabs.optimize import HINTS
from vqa_state.web.tabs.recognizer import transfer
from vqa_state.web.view_data import download, note, unfolding

__all__ = ["Parts", "build", "wire"]

#: Instead of an objective: nothing is chosen.
ALL = "all"

SMALL = {"video": {"width": 640, "height": 480}}


@dataclass(frozen=True)
class Parts:
    """Components of the tab."""

    tab: gr.Tab
    objective: gr.Radio
    vote: gr.Radio
    coverage: gr.Slider
    early: gr.Checkbox
    about: gr.HTML
    link: gr.HTML
    verdict: gr.HTML
    camera: gr.Image
    seen: gr.HTML
    other: transfer.Parts


def build(tab: gr.Tab) -> Parts:
    """Draw the tab."""
    choices = [(f"{one.value} – {hint}", one.value) for one, hint in HINTS.items()]
    choices.append(("all – every question, nothing chosen", ALL))
    objective = gr.Radio(choices, label="Recognizer", elem_id="objective")
    vote, coverage, early = _counting()
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
    other = transfer.build()
    return Parts(
        tab, objective, vote, coverage, early, about, link, verdict, camera, seen, other
    )  # fmt: skip


def _counting() -> tuple[gr.Radio, gr.Slider, gr.Checkbox]:
    paper = VoteKind.PAPER.value
    vote = gr.Radio(
        [paper], value=paper, label="Kind of vote", elem_id="vote",
        info="Others than the paper's are learned by Assess on Results.",
    )  # fmt: skip
    with gr.Row(equal_height=True):
        coverage = gr.Slider(
            0.05, 1, value=1, step=0.05, label="Share of images that shall get a verdict",
            elem_id="coverage", info="Below 1, doubtful images get “unknown”; needs Assess.",
        )  # fmt: skip
        early = gr.Checkbox(
            label="Stop asking early", elem_id="early",
            info="As soon as the rest cannot change the verdict, when trying a picture here.",
        )  # fmt: skip
    return vote, coverage, early


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab."""
    shown = [parts.objective, parts.about, parts.link, parts.verdict]
    page.fill(show, shown)
    page.refresh(parts.tab, show, shown)
    counting = [parts.vote, parts.coverage, parts.early]
    page.fill(votes, counting)
    page.refresh(parts.tab, votes, counting)
    chosen = page.on(parts.objective.input, choose, [parts.objective], shown[1:])
    page.on(chosen.success, votes, (), counting)
    for field, fn in ((parts.vote, take_vote), (parts.early, take_early)):
        taken = page.on(field.input, fn, [field], shown)
        page.on(taken.success, votes, (), counting)
    # The slider is not filled anew: it may be on its way further, under a finger or an arrow key.
    page.on(
        parts.coverage.release, take_coverage, [parts.coverage], shown, trigger_mode="always_last"
    )
    transfer.wire(parts.other, page)
    page.on(parts.camera.change, see, [parts.objective, parts.camera], [parts.seen])


def show(desk: Desk, pid: str) -> Any:
    """Choice, what it is, its link, and a place to try it."""
    with desk.reading(pid) as project:
        chosen = project.chosen
        value = ALL if project.all_questions else chosen.value
    return value, *_shown(desk, pid, chosen)


def choose(desk: Desk, pid: str, objective: Any) -> Any:
    """Remember the choice; what it is, its link, and a place to try it."""
    chosen = None if objective == ALL else arguments.choice(objective, Objective, "the objective")
    with desk.changing(pid) as project:
        project.all_questions = chosen is None
        project.chosen = chosen or project.chosen
        chosen = project.chosen
    return _shown(desk, pid, chosen)


def votes(desk: Desk, pid: str) -> Any:
    """The kinds of vote that there are, and what was taken."""
    taken = desk.taken(pid)
    try:
        _, assessed = found_and_assessed(desk.snapshot(pid))
    except (NothingToSearchError, ProjectError):
        assessed = None
    kinds = [VoteKind.PAPER] if assessed is None else list(assessed.votes)
    names = [_name(kind, assessed) for kind in {**dict.fromkeys(kinds), taken.vote: None}]
    share = 1.0 if taken.coverage is None else taken.coverage
    is_open = not taken.all_questions
    return (
        gr.Radio(names, value=taken.vote.value, interactive=is_open),
        gr.Slider(value=share, interactive=is_open),
        taken.stop_early,
    )


def _name(kind: VoteKind, assessed: Assessment | None) -> tuple[str, str]:
    best = assessed is not None and assessed.recommendation.kind is kind
    return f"{kind.value} ★ recommended" if best else kind.value, kind.value


def take_vote(desk: Desk, pid: str, vote: Any) -> Any:
    """Remember the kind of vote, unless all are asked; what `show` gives."""
    taken = taken_from(vote, 1)
    with desk.changing(pid) as project:
        project.vote = project.vote if project.all_questions else taken.vote
    return show(desk, pid)


def take_coverage(desk: Desk, pid: str, coverage: Any) -> Any:
    """Remember the share of verdicts, unless all are asked; what `show` gives."""
    taken = taken_from(VoteKind.PAPER.value, coverage)
    with desk.changing(pid) as project:
        project.coverage = project.coverage if project.all_questions else taken.coverage
    return show(desk, pid)


def take_early(desk: Desk, pid: str, early: Any) -> Any:
    """Remember whether trying it stops early; what `show` gives."""
    desk.stop_early(pid, taken_from(VoteKind.PAPER.value, 1, early).stop_early)
    return show(desk, pid)


def see(desk: Desk, pid: str, objective: Any, frame: Any) -> Any:
    """The verdict on a picture of the camera; nothing when it was put away."""
    if not isinstance(frame, np.ndarray):
        return {}
    try:
        return {"verdict": _seen(desk, pid, objective, frame)}
    except VQAStateError as error:
        return {"failure": str(error)}


def _seen(desk: Desk, pid: str, objective: Any, frame: Any) -> Any:
    """By the choice that this page shows, as its download is."""
    taken = replace(desk.taken(pid), all_questions=objective == ALL)
    chosen = desk.snapshot(pid).chosen.value if taken.all_questions else objective
    return try_recognizer.of_picture(desk, pid, chosen, frame, taken)


def _shown(desk: Desk, pid: str, chosen: Objective) -> tuple[Any, Any, Any]:
    taken = desk.taken(pid)
    place = {"project": pid, "objective": chosen.value}
    place |= {"query": query} if (query := taken.query(asking=True)) else {}
    none: tuple[Any, Any] = note(""), {}
    project = desk.snapshot(pid)
    try:
        if refresh(project) is None:
            return note(
                "There is no recognizer for these answers and labels: optimize first."
            ), *none
        recognizer = taken_recognizer(project, chosen, taken)
    except (NothingToSearchError, ProjectError) as error:
        return note(f"There is no recognizer yet: {error}."), *none
    except RecognizerError as error:
        return note(f"{error}", "bad"), *none
    href = f"/projects/{quote(pid)}/recognizers/{quote(chosen.value)}.json"
    href += taken.query(asking=False)
    return _about(recognizer), download(href, "Download the recognizer (JSON)"), place


def _of_new_images(recognizer: Recognizer) -> str:
    part = recognizer.incomplete
    if part is None:
        return "for new images, see the test images on Results."
    return (
        f"these {part.n_images} of {part.n_labelled} have all their answers. Until the others have "
        "theirs, the test stays closed."
    )


def _about(recognizer: Recognizer) -> Any:
    train, n_copies = recognizer.scores.train, recognizer.copies.n_copies
    n_questions = len(recognizer.questions)
    questions = "1 question" if n_questions == 1 else f"{n_questions} questions"
    lines = [
        f"{questions} about {n_copies} copies of an image: {recognizer.calls_per_image} calls to "
        f"the model “{recognizer.model.name}”.",
        f"It recognizes {train.n_recognized} of the {train.n_images} training images"
        f"{', none of which chose' if recognizer.origin is None else ' that chose'} its questions; "
        f"{_of_new_images(recognizer)}",
    ]
    if recognizer.origin is None:
        lines.append(
            "Its answers are counted by the paper's vote. The kind of vote and the share of "
            "verdicts above wait until a set of questions is chosen again."
        )
    if recognizer.vote is not VoteKind.PAPER:
        lines.append(f"Answers are counted by the vote “{recognizer.vote.value}”.")
    if recognizer.abstain.coverage is not None:
        lines.append(
            f"It says “unknown” below a sureness of {recognizer.abstain.min_sureness:.2f}, so that "
            f"about {recognizer.abstain.coverage:.0%} of new images get a verdict."
        )
        careful = recognizer.abstain.out_of_bag
        lines += [] if careful is None else [careful.sentence()]
    if recognizer.origin is not None and not recognizer.origin.finished:
        lines.append("Its search was stopped before the end.")
    texts = [question.text for question in recognizer.questions]
    return unfolding("\n".join(lines), f"its {questions}", texts)
