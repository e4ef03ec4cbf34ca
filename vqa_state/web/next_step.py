"""The line above the tabs: how far the open project is, and what comes next."""

from typing import Any

from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.study.collect import AskPlan, plan
from vqa_state.study.optimize import is_optimized
from vqa_state.web.session import Desk
from vqa_state.web.view_data import note

__all__ = ["cost", "show"]


def show(desk: Desk, pid: str) -> Any:
    """Where the project stands, in one line, and the next step."""
    project = desk.snapshot(pid)
    n_labelled = sum(image.label is not None for image in project.images.values())
    n_questions = len(project.grid.build().questions)
    costs = cost(project)
    answers = f"{costs.n_stored:,} of {costs.n_calls:,} answers" if costs else "no answers"
    line = f"{_counted(n_labelled, 'image')} labelled · {_counted(n_questions, 'question')}"
    return note(f"{line} · {answers}\nNext: {_next(project, n_labelled, n_questions, costs)}")


def cost(project: Project) -> AskPlan | None:
    """What asking costs; None while there is nothing to ask."""
    try:
        return plan(project, project.fingerprint or "")
    except (NothingToSearchError, ProjectError):
        return None


def _next(project: Project, n_labelled: int, n_questions: int, costs: AskPlan | None) -> str:
    n_undecided = sum(i.label is not None and i.split is None for i in project.images.values())
    if not project.images:
        return "add pictures of both states, on the tab Images."
    if len({image.label for image in project.images.values()} - {None}) < 2:
        return "label images of both states, on the tab Images."
    if n_undecided:
        verb = "is" if n_undecided == 1 else "are"
        return (
            f"{n_undecided} labelled {verb} on no side yet; divide into train and test on Images."
        )
    if not n_questions:
        return "say what the thing is called, on the tab Questions."
    if not project.labelled(Split.TRAIN):
        return "put labelled images on the train side, on the tab Images."
    if costs is None or costs.n_to_ask:
        return "ask the model, on the tab Ask."
    if not is_optimized(project):
        return "choose the questions, on the tab Optimize."
    n_open = sum(image.label is None for image in project.images.values())
    if n_open:
        verb = "has" if n_open == 1 else "have"
        return (
            f"look at the results, and take the recognizer with you. {n_open:,} of the images "
            f"{verb} no label yet: Images can suggest them."
        )
    return "look at the results, and take the recognizer with you."


def _counted(n: int, noun: str) -> str:
    return f"{n:,} {noun}" if n == 1 else f"{n:,} {noun}s"
