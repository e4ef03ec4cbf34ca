"""What Optimize, Results and Recognizer do, as plain functions: no page, no server."""

from collections import deque
from dataclasses import replace
from typing import Any

import gradio as gr
import numpy as np
import pytest
from stand_ins import finished

from vqa_state.errors import VQAStateError
from vqa_state.project.split import Split
from vqa_state.questions.grid import Question
from vqa_state.search.objectives import Objective
from vqa_state.study import optimize as tuning
from vqa_state.study.collect import ask
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.arguments import RequestError
from vqa_state.web.heatmap import heat_value
from vqa_state.web.jobs import JobState
from vqa_state.web.session import Desk
from vqa_state.web.tabs import optimize
from vqa_state.web.tabs.recognizer import tab as recognizer
from vqa_state.web.tabs.results import leaderboard
from vqa_state.web.tabs.results import tab as results
from vqa_state.web.tabs.results.galleries import choose_question, choose_row

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


def show(desk: Desk, pid: str, missed_of: Any = "", answers_of: Any = "") -> dict[str, Any]:
    """What is shown, by name."""
    names = "note", "body", "missed", "good", "heat", "answers"
    return dict(zip(names, results.show(desk, pid, missed_of, answers_of), strict=True))


def test_a_cell_leads_to_images_answers_and_votes(desk: Desk, asked: str) -> None:
    shown = show(desk, asked)
    assert shown["good"].visible
    assert len(shown["heat"]["rows"]) == 8
    assert shown["heat"]["columns"] == ["door · open", "door · closed"]
    answers, _ = choose_question(desk, asked, {"question": "Is this door open?"})
    train = desk.snapshot(asked).labelled(Split.TRAIN)
    assert {card["image"] for card in answers["cards"]} == {image.id for image in train}
    assert all(sum(card["votes"]) == 6 for card in answers["cards"])


@pytest.mark.parametrize("data", [None, {}, {"question": "?"}, {"question": 3}, []])
def test_a_strange_cell_is_refused(desk: Desk, asked: str, data: Any) -> None:
    with pytest.raises(VQAStateError):
        choose_question(desk, asked, data)


def test_own_questions_stand_apart_with_the_state_that_yes_means(
    desk: Desk, asked: str, scripted: ScriptedModel
) -> None:
    own = Question("Is the door shut tight?", -1), Question("Is the door ajar?", 1)
    with desk.changing(asked) as project:
        project.grid = replace(project.grid, custom=own)
    deque(ask(desk.snapshot(asked), scripted), maxlen=0)
    heat = heat_value(desk.snapshot(asked))
    in_grid = [cell["question"] for row in heat["rows"] for cell in row["cells"]]
    assert len(in_grid) == 16
    assert not {question.text for question in own} & set(in_grid)
    assert [(one["title"], one["yes"]) for one in heat["own"]] == [
        ("Is the door ajar?", "open"),
        ("Is the door shut tight?", "closed"),
    ]
    assert all(one["cell"]["question"] == one["title"] for one in heat["own"])


def test_before_there_are_results_one_sentence_says_what_to_do(desk: Desk, pid: str) -> None:
    shown = show(desk, pid)
    assert "on the tab Ask" in shown["note"]["text"]
    assert not shown["body"].visible
    assert not shown["good"].visible
    assert shown["heat"] == {}


def test_with_answers_it_says_to_optimize(desk: Desk, asked: str) -> None:
    shown = show(desk, asked)
    assert "on the tab Optimize" in shown["note"]["text"]
    assert not shown["body"].visible


def test_a_row_leads_to_the_images_that_it_misses(desk: Desk, optimized: str) -> None:
    """Those of the test only after a look; nothing that the page tells makes up for one."""
    data = {"row_value": ["s_all", 16]}
    _, test, about = choose_row(desk, optimized, data, "")
    assert test == {}
    _, test, _ = choose_row(desk, optimized, data, about)  # says that it looked; nobody did
    assert test == {}
    *_, looked = leaderboard.look(desk, optimized)
    assert choose_row(desk, optimized, data, "")[1] == {}  # another page looked
    assert choose_row(desk, optimized, data, "of older results")[1] == {}
    train, test, _ = choose_row(desk, optimized, data, looked)
    (row,) = [row for row in found_rows(desk, optimized) if row.name.value == "s_all"]
    for shown, kind, missed in (
        (train, "training", row.train_missed),
        (test, "test", row.test_missed),
    ):
        assert [card["image"] for card in shown["cards"]] == [one.image_id for one in missed]
        assert f"{kind} images" in shown["title"]
        assert all(len(card["answers"]) == 16 for card in shown["cards"])
        for card, one in zip(shown["cards"], missed, strict=True):
            tie = one.n_for == one.n_against
            state = "open" if one.label < 0 else "closed"
            assert card["note"].endswith("unknown: a tie" if tie else f"taken for {state}")


def found_rows(desk: Desk, pid: str) -> Any:
    found = tuning.results(desk.snapshot(pid))
    assert found is not None
    return found.evaluation.rows


@pytest.mark.parametrize("data", [None, {}, {"row_value": []}, {"row_value": ["x"]}, {"index": 0}])
def test_a_strange_row_is_refused(desk: Desk, optimized: str, data: Any) -> None:
    with pytest.raises(RequestError):
        choose_row(desk, optimized, data, "")


def test_evidence_stays_while_what_it_is_about_does(desk: Desk, optimized: str) -> None:
    _, answers_of = choose_question(desk, optimized, {"question": "Is this door open?"})
    _, _, missed_of = choose_row(desk, optimized, {"row_value": ["s_all"]}, "")
    for about in ((missed_of, answers_of), ("", "")):  # chosen while this was on its way
        shown = show(desk, optimized, *about)
        assert shown["missed"] == shown["answers"] == gr.skip()


@pytest.mark.parametrize("change", ["label", "question", "everything"])
def test_evidence_goes_when_what_it_is_about_changes(
    desk: Desk, optimized: str, change: str
) -> None:
    _, answers_of = choose_question(desk, optimized, {"question": "Is this door open?"})
    _, _, missed_of = choose_row(desk, optimized, {"row_value": ["s_all"]}, "")
    with desk.changing(optimized) as project:
        if change == "label":
            project.set_labels([project.labelled(Split.TRAIN)[0].id], -1)
        elif change == "question":
            project.grid = replace(project.grid, switched_off=frozenset({"Is this door open?"}))
        else:
            project.remove(list(project.images))
    shown = show(desk, optimized, missed_of, answers_of)
    assert shown["missed"] == shown["answers"] == {}
    assert not shown["body"].visible


def test_another_choice_changes_the_rows_and_clears_their_evidence(
    desk: Desk, optimized: str
) -> None:
    _, answers_of = choose_question(desk, optimized, {"question": "Is this door open?"})
    _, _, missed_of = choose_row(desk, optimized, {"row_value": ["s_all"]}, "")
    recognizer.choose(desk, optimized, "s-")
    shown = show(desk, optimized, missed_of, answers_of)
    assert shown["missed"] == {}
    assert shown["answers"] == gr.skip()


def test_changed_labels_make_results_stale(desk: Desk, optimized: str) -> None:
    with desk.changing(optimized) as project:
        project.set_labels([project.labelled(Split.TRAIN)[0].id], None)
    assert "optimize again" in show(desk, optimized)["note"]["text"]


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
