"""What the tabs do, as plain functions: no page, no server."""

import json
from typing import Any

import gradio as gr
import pytest
from stand_ins import finished

from vqa_state.errors import NothingToSearchError, ProjectError, VQAStateError
from vqa_state.study.latency import read_pace
from vqa_state.study.vision_check import first_look
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web import header, job_watcher, next_step
from vqa_state.web.arguments import RequestError
from vqa_state.web.jobs import JobState
from vqa_state.web.session import Desk
from vqa_state.web.tabs import questions
from vqa_state.web.tabs.ask import tab as ask
from vqa_state.web.tabs.images import tab as images

STRANGE: list[Any] = [None, "text", [], {}, True, float("nan"), float("inf"), 1e300, -1]


def updated(component: Any) -> Any:
    """The value that a handler gave a component."""
    return component.value if hasattr(component, "value") else component


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


def test_a_damaged_project_opens_as_a_sentence_without_tabs(desk: Desk, pid: str) -> None:
    (desk.root / pid / "project.json").write_text("{")
    open_pid, _, _, said, tabs = header.arrival(Desk(desk.root), pid, "ask")
    assert open_pid == ""
    assert "cannot be opened" in said["text"]
    assert "damaged" in said["text"]
    assert tabs.visible is False


# ---- the line of the road ------------------------------------------------------------------


def test_the_road_always_says_the_next_step(desk: Desk, request: pytest.FixtureRequest) -> None:
    empty = header.create(desk, "door", "open", "closed")
    assert "Images" in next_step.show(desk, empty)["text"]
    pid = request.getfixturevalue("pid")
    assert (
        "16 images labelled · 16 questions · 0 of 1,536 answers"
        in next_step.show(desk, pid)["text"]
    )
    assert "Ask" in next_step.show(desk, pid)["text"]
    request.getfixturevalue("asked")
    assert "Optimize" in next_step.show(desk, pid)["text"]
    request.getfixturevalue("optimized")
    assert "recognizer" in next_step.show(desk, pid)["text"]


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


def seen(desk: Desk, pid: str, axis: str) -> str:
    """What a page sends that has just been filled."""
    return json.dumps([json.loads(questions.show(desk, pid)[-1])[axis]])


@pytest.mark.parametrize("axis", EDITS)
def test_each_field_changes_its_part_of_the_grid_and_is_shown_again(
    desk: Desk, pid: str, axis: str
) -> None:
    value, n_questions = EDITS[axis]
    before = list(map(updated, questions.show(desk, pid)[:7]))
    questions.edit(axis, desk, pid, seen(desk, pid, axis), value)
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
    said, _ = questions.edit(
        "wordings", desk, pid, seen(desk, pid, "wordings"), "door\nwater | in sink"
    )
    assert "{article}" in said["text"]
    assert len(desk.snapshot(pid).questions()) == 16


@pytest.mark.parametrize("axis", EDITS)
def test_a_field_that_is_only_passed_through_takes_nothing_back(
    desk: Desk, pid: str, axis: str
) -> None:
    """Another window changed it meanwhile; this one shows what was there before."""
    old = seen(desk, pid, axis)
    questions.edit(axis, desk, pid, old, EDITS[axis][0])
    questions.edit(axis, desk, pid, old, json.loads(old)[0])
    assert len(desk.snapshot(pid).questions()) == EDITS[axis][1]


def test_what_another_window_wrote_is_not_written_over(desk: Desk, pid: str) -> None:
    old = seen(desk, pid, "wordings")
    questions.edit("wordings", desk, pid, old, "door\ncooler")
    said, grid = questions.edit("wordings", desk, pid, old, "door\nfridge")
    assert "another window" in said["text"]
    assert "update" in grid["__type__"]
    assert len(desk.snapshot(pid).grid.wordings) == 2
    assert str(desk.snapshot(pid).grid.wordings[1]) == "cooler"


def test_a_page_goes_on_typing_faster_than_it_is_answered(desk: Desk, pid: str) -> None:
    """The project has what the page sent before the last, or before what could not be used."""
    typed = ["door", "door\na", "door\nab", "door\nab | in", "door\nab | in {article} c"]
    for n, value in enumerate(typed[1:], 1):
        questions.edit("wordings", desk, pid, json.dumps(typed[:n]), value)
    assert str(desk.snapshot(pid).grid.wordings[1]) == "ab | in {article} c"


def test_cues_can_be_changed_after_they_were_added(desk: Desk, pid: str) -> None:
    own, _, _, _, filled = questions.add_cues(desk, pid)
    known = json.dumps([json.loads(filled)["own_positive"]])
    said, _ = questions.edit("own_positive", desk, pid, known, own + "\nIs it warm?")
    assert said["text"] == ""
    assert "Is it warm?" in [question.text for question in desk.snapshot(pid).questions()]


def test_a_double_is_dropped_and_said(desk: Desk, pid: str) -> None:
    _, value = questions.edit("wordings", desk, pid, seen(desk, pid, "wordings"), "door\ndoor")
    assert len(value["dropped"]) == 16


def test_questions_are_switched_off_and_on(desk: Desk, pid: str) -> None:
    text = "Is this door open?"
    questions.switch(desk, pid, {"texts": [text, "no such question", 7, None], "on": False})
    assert desk.snapshot(pid).grid.switched_off == (text,)
    value = questions.show(desk, pid)[-2]
    shown = {row["text"]: row["on"] for group in value["groups"] for row in group["questions"]}
    assert shown.pop(text) is False
    assert all(shown.values())
    other = "Is this door closed?"
    questions.switch(desk, pid, {"texts": [other, other], "on": False})  # in another window
    assert set(desk.snapshot(pid).grid.switched_off) == {text, other}
    questions.switch(desk, pid, {"texts": [other, text], "on": True})
    assert desk.snapshot(pid).grid.switched_off == ()


@pytest.mark.parametrize(
    "data",
    [None, [], {}, {"texts": None, "on": True}, {"texts": [], "on": 1}, 3],
)
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
    assert "Optimize" in next_step.show(desk, pid)["text"]


def test_asking_stops_and_goes_on(desk: Desk, pid: str, scripted: Any, gate: Any) -> None:
    list(first_look(scripted))  # a new model would be shown some pictures first
    scripted.asked.clear()
    gate.opened.clear()
    ask.start(desk, pid, "scripted")
    assert gate.reached.wait(10)
    ask.start(desk, pid, "scripted")  # a second page: attaches
    job_watcher.Watch(ask.KIND, ask.view).stop(desk, pid)
    job = desk.jobs.get(pid, ask.KIND)
    assert job is not None
    assert "Stopping" in ask.view(desk, pid, job.snapshot)[0]["text"]
    gate.opened.set()
    assert job.join(10).state is JobState.STOPPED
    assert "Stopped" in ask.view(desk, pid, job.snapshot)[0]["text"]
    n_before = len(scripted.asked)
    ask.start(desk, pid, "scripted")
    assert finished(desk, pid, ask.KIND).state is JobState.DONE
    timing = 2 * (1 + 16)  # one question, then all, about two copies: how fast the model is
    assert len(scripted.asked) == 1536 + timing  # nothing was paid for twice
    assert n_before < 1536
    assert read_pace(desk.snapshot(pid)) is not None


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
    following = job_watcher.Watch(ask.KIND, ask.view).follow(desk, pid)
    _, start, _, seen = next(following)
    assert not start.interactive
    gate.opened.set()
    *_, last = following
    assert "Done" in last[0]["text"]
    assert last[3] != seen
    watch = job_watcher.Watch(ask.KIND, ask.view)
    assert watch.glance(desk, pid, last[3]) == gr.skip()
    assert watch.glance(desk, pid, seen)[0] == last[0]


def test_without_a_job_there_is_nothing_to_follow(desk: Desk, pid: str) -> None:
    (only,) = job_watcher.Watch(ask.KIND, ask.view).follow(desk, pid)
    assert only[1].interactive
    assert job_watcher.Watch(ask.KIND, ask.view).glance(desk, pid, "") == gr.skip()


# ---- ready cues ----------------------------------------------------------------------------


def test_ready_cues_become_questions_of_ones_own(desk: Desk, pid: str) -> None:
    before = len(desk.snapshot(pid).questions())
    positive, negative, said, *_ = questions.add_cues(desk, pid)
    with desk.reading(pid) as project:
        added = [question.text for question in project.grid.custom]
    assert len(desk.snapshot(pid).questions()) == before + len(added)
    assert f"{len(added)} questions added" in str(updated(said))
    assert sorted([*positive.splitlines(), *negative.splitlines()]) == sorted(added)
    questions.add_cues(desk, pid)
    assert len(desk.snapshot(pid).questions()) == before + len(added)


def test_a_state_without_cues_is_told_so(desk: Desk) -> None:
    pid = header.create(desk, "shirt", "clean", "dirty")
    _, _, said, *_ = questions.add_cues(desk, pid)
    assert "No cue added" in str(updated(said))
    assert len(desk.snapshot(pid).questions()) == 16
