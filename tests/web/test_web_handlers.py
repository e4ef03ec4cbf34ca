"""What the tabs do, as plain functions: no page, no server."""

from typing import Any

import gradio as gr
import numpy as np
import pytest

from vqa_state.errors import NothingToSearchError, ProjectError, VQAStateError
from vqa_state.jobs import JobState, Snapshot
from vqa_state.models.fake import ScriptedModel
from vqa_state.scores import Objective
from vqa_state.splits import Split
from vqa_state.web import header, road, watching
from vqa_state.web.checks import RequestError
from vqa_state.web.desk import Desk
from vqa_state.web.tabs import ask, images, optimize, questions, recognizer, results

STRANGE: list[Any] = [None, "text", [], {}, True, float("nan"), float("inf"), 1e300, -1]


def updated(component: Any) -> Any:
    """The value that a handler gave a component."""
    return component.value if hasattr(component, "value") else component


def finished(desk: Desk, pid: str, kind: str) -> Snapshot:
    job = desk.jobs.get(pid, kind)
    assert job is not None
    return job.join(120)


# ---- header --------------------------------------------------------------------------------


def test_a_new_project_asks_about_its_thing_already(desk: Desk) -> None:
    pid = header.create(desk, "fridge", "open", "closed")
    assert desk.listing() == {pid: "fridge"}
    assert len(desk.snapshot(pid).questions()) == 16


@pytest.mark.parametrize(
    "fields", [("", "a", "b"), ("x", "a", "A"), ("x", "", "b"), (None, None, None), ([], {}, 1)]
)
def test_a_project_without_names_is_refused(desk: Desk, fields: Any) -> None:
    with pytest.raises(VQAStateError):
        header.create(desk, *fields)
    assert desk.listing() == {}


def test_no_user_text_becomes_a_path(desk: Desk) -> None:
    pid = header.create(desk, "../../evil", "<b>open</b>", "closed")
    assert [path.name for path in desk.root.iterdir()] == [pid]
    assert pid.isalnum()


def test_the_page_opens_the_project_of_its_address(desk: Desk, pid: str) -> None:
    opened, chooser, _, _, _ = header.arrival(desk, pid, None)
    assert (opened, updated(chooser)) == (pid, pid)
    for other in (None, "", "..", "nothing"):
        opened, _, _, said, tabs = header.arrival(desk, other, None)
        assert opened == ""
        assert "Choose a project" in said["text"]
        assert not tabs.visible


def test_a_damaged_project_is_listed_and_explained(desk: Desk, pid: str) -> None:
    (desk.root / pid / "project.json").write_text("{")
    fresh = Desk(desk.root)
    assert fresh.listing() == {pid: pid}
    with pytest.raises(ProjectError, match="damaged"):
        fresh.snapshot(pid)


# ---- the line of the road ------------------------------------------------------------------


def test_the_road_always_says_the_next_step(desk: Desk, request: pytest.FixtureRequest) -> None:
    empty = header.create(desk, "door", "open", "closed")
    assert "Images" in road.show(desk, empty)["text"]
    pid = request.getfixturevalue("pid")
    assert "16 images labelled · 16 questions · 0 of 1,536 answers" in road.show(desk, pid)["text"]
    assert "Ask" in road.show(desk, pid)["text"]
    request.getfixturevalue("asked")
    assert "Optimize" in road.show(desk, pid)["text"]
    request.getfixturevalue("optimized")
    assert "recognizer" in road.show(desk, pid)["text"]


# ---- images --------------------------------------------------------------------------------


def test_dividing_keeps_both_states_on_both_sides(desk: Desk, pid: str) -> None:
    value, said = images.divide(desk, pid, 0.25, 7, True)
    assert said["text"].splitlines()[:2] == ["Train: 2 open, 2 closed", "Test: 6 open, 6 closed"]
    assert {item["split"] for item in value["items"]} == {"train", "test"}
    assert desk.snapshot(pid).seed == 7


@pytest.mark.parametrize("strange", STRANGE)
def test_strange_shares_and_seeds_change_nothing(desk: Desk, pid: str, strange: Any) -> None:
    before = desk.snapshot(pid)
    for share, seed in ((strange, 0), (0.5, strange)):
        with pytest.raises(VQAStateError):
            images.divide(desk, pid, share, seed, True)
    assert desk.snapshot(pid).images == before.images
    assert desk.snapshot(pid).seed == before.seed


# ---- questions -----------------------------------------------------------------------------


EDITS = {
    "wordings": ("door\nwater | in {article} sink", 32),
    "positive": ("open\najar", 24),
    "negative": ("", 8),
    "forms": (["is"], 8),
    "articles": (["a", "this"], 8),
    "own_positive": ("Can I walk through?", 17),
    "own_negative": ("Is it locked?\nIs it shut?", 18),
}


@pytest.mark.parametrize("axis", EDITS)
def test_each_field_changes_its_part_of_the_grid_and_is_shown_again(
    desk: Desk, pid: str, axis: str
) -> None:
    value, n_questions = EDITS[axis]
    before = list(map(updated, questions.show(desk, pid)[:7]))
    questions.edit(axis, desk, pid, pid, value)
    assert len(desk.snapshot(pid).questions()) == n_questions
    after = list(map(updated, questions.show(desk, pid)[:7]))
    at = list(questions.AXES).index(axis)
    assert after[at] == value
    assert after[:at] + after[at + 1 :] == before[:at] + before[at + 1 :]


@pytest.mark.parametrize("axis", EDITS)
def test_nothing_is_kept_before_the_fields_are_filled(desk: Desk, pid: str, axis: str) -> None:
    before = desk.snapshot(pid).grid
    questions.edit(axis, desk, pid, "", [] if axis in ("forms", "articles") else "")
    assert desk.snapshot(pid).grid == before


def test_a_mistake_is_said_and_nothing_is_lost(desk: Desk, pid: str) -> None:
    said, _ = questions.edit("wordings", desk, pid, pid, "door\nwater | in sink")
    assert "{article}" in said["text"]
    assert len(desk.snapshot(pid).questions()) == 16


def test_a_double_is_dropped_and_said(desk: Desk, pid: str) -> None:
    _, value = questions.edit("wordings", desk, pid, pid, "door\ndoor")
    assert len(value["dropped"]) == 16


def test_questions_are_switched_off_and_on(desk: Desk, pid: str) -> None:
    text = "Is this door open?"
    questions.switch(desk, pid, {"off": [text, "no such question", 7, None]})
    assert desk.snapshot(pid).grid.switched_off == (text,)
    value = questions.show(desk, pid)[-2]
    shown = {row["text"]: row["on"] for group in value["groups"] for row in group["questions"]}
    assert shown.pop(text) is False
    assert all(shown.values())
    questions.switch(desk, pid, {"off": []})
    assert desk.snapshot(pid).grid.switched_off == ()


@pytest.mark.parametrize("data", [None, [], {}, {"off": None}, {"off": "all"}, 3])
def test_strange_switches_are_refused(desk: Desk, pid: str, data: Any) -> None:
    with pytest.raises(RequestError):
        questions.switch(desk, pid, data)


@pytest.mark.parametrize("strange", [3, {"a": 1}, True, "x" * 200_000])
@pytest.mark.parametrize("axis", EDITS)
def test_strange_fields_change_nothing(desk: Desk, pid: str, axis: str, strange: Any) -> None:
    before = desk.snapshot(pid).grid
    with pytest.raises(RequestError):
        questions.edit(axis, desk, pid, pid, strange)
    assert desk.snapshot(pid).grid == before


# ---- ask -----------------------------------------------------------------------------------


def test_the_cost_is_known_before(desk: Desk, pid: str) -> None:
    said = ask.costs(desk, pid)["text"]
    assert "16 images × 6 copies × 16 questions = 1,536 calls" in said
    assert "1,536 are to be asked" in ask.augment(desk, pid, "rgb-shift", 0.1, 6)["text"]
    assert "= 512 calls" in ask.augment(desk, pid, "gaussian-noise", 0.2, 2)["text"]
    assert desk.snapshot(pid).augmentation.n_copies == 2


@pytest.mark.parametrize("strange", STRANGE)
def test_strange_copies_change_nothing(desk: Desk, pid: str, strange: Any) -> None:
    for values in ((strange, 0.1, 6), ("rgb-shift", strange, 6), ("rgb-shift", 0.1, strange)):
        with pytest.raises(RequestError):
            ask.augment(desk, pid, *values)
    assert desk.snapshot(pid).augmentation.n_copies == 6


def test_asking_answers_everything(desk: Desk, pid: str, scripted: ScriptedModel) -> None:
    ask.start(desk, pid, scripted.name)
    progress, start, stop = ask.view(desk, pid, finished(desk, pid, ask.KIND))
    assert "1,536 of 1,536 answered" in progress["text"]
    assert (progress["tone"], progress["share"]) == ("good", 1.0)
    assert (start.interactive, stop.interactive) == (True, False)
    assert "all of them are answered" in ask.costs(desk, pid)["text"]
    assert "Optimize" in road.show(desk, pid)["text"]


def test_asking_stops_and_goes_on(desk: Desk, pid: str, scripted: Any, gate: Any) -> None:
    gate.opened.clear()
    ask.start(desk, pid, "scripted")
    assert gate.reached.wait(10)
    ask.start(desk, pid, "scripted")  # a second page: attaches
    watching.Watch(ask.KIND, ask.view).stop(desk, pid)
    job = desk.jobs.get(pid, ask.KIND)
    assert job is not None
    assert "Stopping" in ask.view(desk, pid, job.snapshot)[0]["text"]
    gate.opened.set()
    assert job.join(10).state is JobState.STOPPED
    assert "Stopped" in ask.view(desk, pid, job.snapshot)[0]["text"]
    n_before = len(scripted.asked)
    ask.start(desk, pid, "scripted")
    assert finished(desk, pid, ask.KIND).state is JobState.DONE
    assert len(scripted.asked) == 1536
    assert n_before < 1536


@pytest.mark.parametrize("model", ["no such model", None, 3, []])
def test_an_unknown_model_is_said(desk: Desk, pid: str, model: Any) -> None:
    try:
        ask.start(desk, pid, model)
    except VQAStateError:
        return
    snapshot = finished(desk, pid, ask.KIND)
    assert snapshot.state is JobState.FAILED
    assert "choose one of" in ask.view(desk, pid, snapshot)[0]["text"]


def test_there_must_be_something_to_ask(desk: Desk) -> None:
    pid = header.create(desk, "door", "open", "closed")
    with pytest.raises(NothingToSearchError):
        ask.start(desk, pid, "scripted")
    assert "nothing to ask" in ask.costs(desk, pid)["text"]


# ---- watching ------------------------------------------------------------------------------


def test_a_page_that_comes_later_follows_the_same_job(
    desk: Desk, pid: str, scripted: Any, gate: Any
) -> None:
    gate.opened.clear()
    ask.start(desk, pid, "scripted")
    assert gate.reached.wait(10)
    following = watching.Watch(ask.KIND, ask.view).follow(desk, pid)
    _, start, _, seen = next(following)
    assert not start.interactive
    gate.opened.set()
    *_, last = following
    assert "Done" in last[0]["text"]
    assert last[3] != seen
    watch = watching.Watch(ask.KIND, ask.view)
    assert watch.glance(desk, pid, last[3]) == gr.skip()
    assert watch.glance(desk, pid, seen)[0] == last[0]


def test_without_a_job_there_is_nothing_to_follow(desk: Desk, pid: str) -> None:
    (only,) = watching.Watch(ask.KIND, ask.view).follow(desk, pid)
    assert only[1].interactive
    assert watching.Watch(ask.KIND, ask.view).glance(desk, pid, "") == gr.skip()


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


# ---- ready cues ----------------------------------------------------------------------------


def test_ready_cues_become_questions_of_ones_own(desk: Desk, pid: str) -> None:
    before = len(desk.snapshot(pid).questions())
    positive, negative, said, _ = questions.add_cues(desk, pid)
    with desk.reading(pid) as project:
        added = [question.text for question in project.grid.custom]
    assert len(desk.snapshot(pid).questions()) == before + len(added)
    assert f"{len(added)} questions added" in str(updated(said))
    assert sorted([*positive.splitlines(), *negative.splitlines()]) == sorted(added)
    questions.add_cues(desk, pid)
    assert len(desk.snapshot(pid).questions()) == before + len(added)


def test_a_state_without_cues_is_told_so(desk: Desk) -> None:
    pid = header.create(desk, "shirt", "clean", "dirty")
    *_, said, _ = questions.add_cues(desk, pid)
    assert "No cue added" in str(updated(said))
    assert len(desk.snapshot(pid).questions()) == 16
