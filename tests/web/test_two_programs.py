"""Two windows, two apps and a command at once: no label is lost, nothing is refused needlessly."""

import json
import shutil
from typing import Any

import pytest
from stand_ins import picture
from starlette.testclient import TestClient

from vqa_state.cli import making
from vqa_state.images import content_hash
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.web.security import LocalGuard
from vqa_state.web.server import build_api
from vqa_state.web.session import Desk


@pytest.fixture
def client(desk: Desk) -> TestClient:
    return TestClient(LocalGuard(build_api(desk)), base_url="http://127.0.0.1")


@pytest.fixture
def ids(desk: Desk, pid: str) -> list[str]:
    """Images whose label is open, by id."""
    return sorted(i for i, one in desk.snapshot(pid).images.items() if one.label == 1)


def marked(client: TestClient, pid: str, **content: Any) -> dict[str, Any]:
    reply = client.post(f"/projects/{pid}/marks", content=json.dumps(content))
    assert reply.status_code == 200, reply.text
    return dict(reply.json())


def label(client: TestClient, pid: str, image_id: str, value: Any, saw: Any) -> dict[str, Any]:
    return marked(client, pid, labels={image_id: value}, seen={"labels": {image_id: saw}})


def test_a_window_does_not_overwrite_a_label_that_it_never_showed(
    client: TestClient, desk: Desk, pid: str, ids: list[str]
) -> None:
    first, second = ids[:2]
    assert label(client, pid, first, -1, 1) == {}  # the one window
    content = {"labels": {first: None, second: -1}, "seen": {"labels": {first: 1, second: 1}}}
    said = marked(client, pid, **content)["refused"]  # the other, which still shows "open"
    name = desk.snapshot(pid).images[first].name
    assert said.startswith(f"{name} is labelled closed, in another window or program meanwhile")
    assert [desk.snapshot(pid).images[i].label for i in (first, second)] == [-1, -1]
    assert label(client, pid, first, -1, 1) == {}  # the same once more, as after a lost reply
    assert label(client, pid, first, None, -1) == {}


def test_nor_a_side(client: TestClient, desk: Desk, pid: str, ids: list[str]) -> None:
    one = ids[0]
    with desk.changing(pid) as project:
        project.set_splits([one], Split.UNUSED)
    said = marked(client, pid, splits={one: "test"}, seen={"splits": {one: "train"}})
    assert "is for unused, in another window" in said["refused"]
    assert desk.snapshot(pid).images[one].split is Split.UNUSED
    assert marked(client, pid, splits={one: "test"}) == {}  # a page that says nothing of it
    with desk.changing(pid) as project:
        project.set_splits([one], None)  # as taking the label away does
    assert marked(client, pid, splits={one: "train"}, seen={"splits": {one: "test"}}) == {}


def test_an_accepted_label_does_not_take_the_place_of_a_persons(
    client: TestClient, desk: Desk, pid: str, ids: list[str]
) -> None:
    one = ids[0]
    said = marked(
        client, pid, labels={one: -1}, accepted={one: True}, splits={one: "train"},
        seen={"labels": {one: None}, "splits": {one: None}},
    )  # fmt: skip
    assert "is labelled open" in said["refused"]
    image = desk.snapshot(pid).images[one]
    assert (image.label, image.accepted) == (1, False)


def test_marks_of_an_image_that_is_gone_do_not_cost_the_others(
    client: TestClient, desk: Desk, pid: str, ids: list[str]
) -> None:
    gone, kept = ids[:2]
    with Project.open(desk.root / pid).changing() as project:
        project.remove([gone])
    content = {"labels": {gone: -1, kept: -1}, "seen": {"labels": {gone: 1, kept: 1}}}
    assert "an image was removed" in marked(client, pid, **content)["refused"]
    assert desk.snapshot(pid).images[kept].label == -1
    reply = client.post(f"/projects/{pid}/marks", content=json.dumps({"labels": {gone: 1}}))
    assert reply.status_code == 400


def test_two_apps_and_a_command_see_each_others_changes(
    client: TestClient, desk: Desk, pid: str, ids: list[str], tmp_path: Any
) -> None:
    other, folder = Desk(desk.root), desk.root / pid
    other.snapshot(pid)
    label(client, pid, ids[0], -1, 1)
    with other.changing(pid) as project:
        assert project.images[ids[0]].label == -1
        project.set_labels([ids[1]], -1)
    making.label(folder, [ids[2]], state="closed")
    (tmp_path / "new.png").write_bytes(picture(99, dark=True))
    making.add(folder, [tmp_path / "new.png"], state="open")
    making.grid(folder, yes_positive=["Is it ajar?"])
    for one in (desk, other):
        seen = one.snapshot(pid)
        assert [seen.images[i].label for i in ids[:3]] == [-1, -1, -1]
        assert seen.images[content_hash(picture(99, dark=True))].label == 1
        assert [question.text for question in seen.grid.custom] == ["Is it ajar?"]


def test_a_project_that_another_program_removes_is_told(desk: Desk, pid: str) -> None:
    desk.snapshot(pid)
    shutil.rmtree(desk.root / pid)
    with pytest.raises(Exception, match="there is no such project here"), desk.changing(pid):
        pass
