"""What pages say of jobs: no more than is still so, how long it takes, and that a stop is heard."""

from dataclasses import replace
from typing import Any

import pytest
from stand_ins import finished

from vqa_state.project.split import Split
from vqa_state.questions.grid import Question
from vqa_state.search.objectives import Objective
from vqa_state.study.optimize import optimize as deep_optimize
from vqa_state.web import next_step
from vqa_state.web.jobs import JobState, Snapshot
from vqa_state.web.session import Desk
from vqa_state.web.tabs import optimize
from vqa_state.web.tabs.ask import model
from vqa_state.web.tabs.ask import tab as ask
from vqa_state.web.tabs.recognizer import transfer


def test_what_was_done_with_other_labels_is_not_called_done(desk: Desk, asked: str) -> None:
    optimize.start(desk, asked, *optimize.show(desk, asked))
    snapshot = finished(desk, asked, optimize.KIND)
    assert "take the recognizer" in next_step.show(desk, asked)["text"]
    with desk.changing(asked) as project:
        first = project.labelled(Split.TRAIN)[0]
        project.set_labels([first.id], -(first.label or 0))
    said, chart, _, _ = optimize.view(desk, asked, snapshot)
    assert "changed since" in said["text"]
    assert not any(search["points"] for search in chart["searches"])
    assert "on the tab Optimize" in next_step.show(desk, asked)["text"]


def test_asking_is_not_called_done_when_there_is_more_to_ask(desk: Desk, asked: str) -> None:
    ask.start(desk, asked, "scripted")
    snapshot = finished(desk, asked, ask.KIND)
    assert "every question is answered" in ask.view(desk, asked, snapshot)[0]["text"]
    with desk.changing(asked) as project:
        project.grid = replace(project.grid, custom=(Question("Is it ajar?", 1),))
    assert ask.view(desk, asked, snapshot)[0]["text"] == ""


def test_a_search_says_how_long_it_takes_and_a_proof_that_it_ends(desk: Desk, asked: str) -> None:
    steps = list(deep_optimize(desk.snapshot(asked)))
    early, late = replace(steps[4], seconds=2.0), steps[-1]
    assert early.seconds_left == 2.0 / 4 * (early.total - 4)
    assert late.proving
    for state, step, words in [
        (JobState.RUNNING, early, "about 52 s left"),
        (JobState.STOPPING, early, "Stopping at generation 4"),
        (JobState.RUNNING, late, "It ends by itself"),
        (JobState.STOPPING, late, "Stopping at"),
    ]:
        points = {objective: [] for objective in Objective}
        snapshot = Snapshot(state, report=optimize.Searching(step, points))
        assert words in optimize.view(desk, asked, snapshot)[0]["text"]


@pytest.mark.parametrize("view", [ask.view, transfer.view, optimize.view, model.view])
def test_a_stop_is_shown_before_the_work_has_said_anything(
    desk: Desk, asked: str, view: Any
) -> None:
    assert "Stopping" in view(desk, asked, Snapshot(JobState.STOPPING))[0]["text"]
    assert "Stopped" in view(desk, asked, Snapshot(JobState.STOPPED))[0]["text"]
