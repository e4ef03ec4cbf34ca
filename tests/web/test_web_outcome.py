"""What Optimize, Results and Recognizer do, as plain functions: no page, no server."""

from typing import Any

import numpy as np
import pytest
from stand_ins import finished

from vqa_state.errors import VQAStateError
from vqa_state.jobs import JobState
from vqa_state.scores import Objective
from vqa_state.splits import Split
from vqa_state.web.checks import RequestError
from vqa_state.web.desk import Desk
from vqa_state.web.tabs import optimize, recognizer, results

# ---- optimize ------------------------------------------------------------------------------


def test_searches_are_shown_live_and_after_a_restart(desk: Desk, asked: str) -> None:
    optimize.start(desk, asked, *optimize.show(desk, asked))
    said, chart, _, _ = optimize.view(desk, asked, finished(desk, asked, optimize.KIND))
    assert said["tone"] == "good"
    _, kept, _, _ = optimize.view(Desk(desk.root), asked, None)
    for live, later in zip(chart["searches"], kept["searches"], strict=True):
        assert len(live["points"]) == 109  # 8 generations and the climbs after them
        assert list(map(list, later["points"])) == list(map(list, live["points"]))
        assert later["terms"] == live["terms"]


def test_every_setting_of_the_search_is_kept(desk: Desk, pid: str) -> None:
    numbers = (50, 3, 0.4, 0.3, 0.1, 4, 90.0, 0.2, 11)
    optimize.settle(desk, pid, *numbers)
    assert optimize.show(Desk(desk.root), pid) == numbers


@pytest.mark.parametrize("strange", [None, "5", [], {}, True, float("nan"), float("inf"), -1])
@pytest.mark.parametrize("at", range(9))
def test_strange_settings_change_nothing(desk: Desk, pid: str, at: int, strange: Any) -> None:
    before = optimize.show(desk, pid)
    numbers = list(before)
    numbers[at] = strange
    with pytest.raises(VQAStateError):
        optimize.settle(desk, pid, *numbers)
    assert optimize.show(desk, pid) == before


def test_optimizing_needs_answers(desk: Desk, pid: str) -> None:
    optimize.start(desk, pid, *optimize.show(desk, pid))
    snapshot = finished(desk, pid, optimize.KIND)
    assert snapshot.state is JobState.FAILED
    assert "ask the model" in optimize.view(desk, pid, snapshot)[0]["text"]


# ---- results -------------------------------------------------------------------------------


def test_a_cell_leads_to_images_answers_and_votes(desk: Desk, asked: str) -> None:
    cells = results.show(desk, asked)[1]
    assert len(cells["rows"]) == 8
    assert cells["columns"] == ["door · open", "door · closed"]
    shown = results.pick(desk, asked, {"question": "Is this door open?"})
    train = desk.snapshot(asked).labelled(Split.TRAIN)
    assert {card["image"] for card in shown["cards"]} == {image.id for image in train}
    assert all(sum(card["votes"]) == 6 for card in shown["cards"])


@pytest.mark.parametrize("data", [None, {}, {"question": "?"}, {"question": 3}, []])
def test_a_strange_cell_is_refused(desk: Desk, asked: str, data: Any) -> None:
    with pytest.raises(VQAStateError):
        results.pick(desk, asked, data)


def test_test_results_are_shown_on_demand_and_looks_are_counted(desk: Desk, optimized: str) -> None:
    shown = results.show(desk, optimized)
    assert list(shown[3].value["headers"]) == [
        "subset",
        "questions",
        "recognized",
        "R_ave",
        "R_invalid",
    ]
    assert not shown[6].visible
    assert desk.snapshot(optimized).test_looks == 0
    button, table, _ = results.look(desk, optimized)
    assert "once" in button.value
    assert table.visible
    assert Desk(desk.root).snapshot(optimized).test_looks == 1


def test_a_row_leads_to_the_images_that_it_misses(desk: Desk, optimized: str) -> None:
    for handler, side in ((results.missed_train, "train"), (results.missed_test, "test")):
        shown = handler(desk, optimized, {"row_value": ["best question", 1]})
        assert side in shown["title"]
        assert all(len(card["answers"]) == 1 for card in shown["cards"])


@pytest.mark.parametrize("data", [None, {}, {"row_value": []}, {"row_value": ["x"]}, {"index": 0}])
def test_a_strange_row_is_refused(desk: Desk, optimized: str, data: Any) -> None:
    with pytest.raises(RequestError):
        results.missed_train(desk, optimized, data)


def test_changed_labels_make_results_stale(desk: Desk, optimized: str) -> None:
    with desk.changing(optimized) as project:
        project.set_labels([project.labelled(Split.TRAIN)[0].id], None)
    said = results.show(desk, optimized)[0]
    assert "optimize" in said["text"]


# ---- recognizer ----------------------------------------------------------------------------


def test_each_objective_has_its_recognizer(desk: Desk, optimized: str) -> None:
    for objective in Objective:
        about, link, place = recognizer.choose(desk, optimized, objective.value)
        assert "questions" in about["text"] or "1 question" in about["text"]
        assert link["link"]["href"].startswith(f"/projects/{optimized}/recognizers/")
        assert place == {"project": optimized, "objective": objective.value}
    assert desk.snapshot(optimized).chosen is list(Objective)[-1]


@pytest.mark.parametrize("strange", [None, "s", 3, [], {}])
def test_a_strange_objective_is_refused(desk: Desk, optimized: str, strange: Any) -> None:
    with pytest.raises(RequestError):
        recognizer.choose(desk, optimized, strange)


def test_the_camera_is_tried(desk: Desk, optimized: str) -> None:
    dark = np.zeros((48, 64, 3), np.uint8)
    assert recognizer.see(desk, optimized, "s+", dark)["verdict"]["state_name"] == "open"
    assert recognizer.see(desk, optimized, "s+", None) == {}
    assert "must be one of" in recognizer.see(desk, optimized, "?", dark)["failure"]


def test_before_optimizing_there_is_no_link(desk: Desk, pid: str) -> None:
    _, about, link, place = recognizer.show(desk, pid)
    assert "optimize" in about["text"]
    assert "link" not in link
    assert place == {}
