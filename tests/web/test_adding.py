"""Pictures come in a few at a time: others get their turn, a stop keeps what is there."""

import io
import json
import shutil
import socket
import threading
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest
import uvicorn
from stand_ins import picture

from vqa_state.errors import ProjectError
from vqa_state.project import importing
from vqa_state.project.project import Project
from vqa_state.web.server import build_api
from vqa_state.web.session import Desk
from vqa_state.web.uploads import added_lines


@pytest.fixture
def pid(desk: Desk) -> str:
    """Id of a project without pictures; two files make a batch."""
    return desk.create("door", "open", "closed")


@pytest.fixture(autouse=True)
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importing, "_BATCH_FILES", 2)


@pytest.fixture
def address(desk: Desk) -> Iterator[str]:
    """Our own routes behind a real server: only such a one tells that a client is gone."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = uvicorn.Server(uvicorn.Config(build_api(desk), log_level="error"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        server.should_exit = True
        thread.join(20)


def zipped(n: int) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for number in range(n):
            archive.writestr(f"open/{number}.png", picture(number, dark=True))
    return packed.getvalue()


def label_one(desk: Desk, pid: str) -> None:
    with desk.changing(pid) as project:
        project.set_labels([next(iter(project.images))], -1)


def test_between_two_batches_others_get_the_project(desk: Desk, pid: str) -> None:
    told = []
    with ThreadPoolExecutor(1) as another:
        for line in added_lines(desk, pid, "all.zip", zipped(6)):
            told.append(json.loads(line))
            another.submit(label_one, desk, pid).result(5)
            assert len(Desk(desk.root).snapshot(pid).images) == told[-1]["done"]  # it is saved
    assert [(one["done"], one["of"]) for one in told] == [(2, 6), (4, 6), (6, 6)]
    labels = [image.label for image in desk.snapshot(pid).images.values()]
    assert labels == [-1, 1, 1, 1, 1, 1]


def test_a_client_that_goes_away_stops_the_adding_and_keeps_what_came(
    desk: Desk, pid: str, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    slowed(monkeypatch)
    url = f"{address}/projects/{pid}/upload?name=all.zip"
    with httpx.stream("POST", url, content=zipped(60)) as reply:
        assert json.loads(next(reply.iter_lines()))["done"] == 2
        assert len(desk.snapshot(pid).images) <= 6  # the line came at once, not at the end
    time.sleep(0.5)
    n_kept = len(desk.snapshot(pid).images)
    assert 2 <= n_kept <= 12
    time.sleep(0.5)
    assert len(desk.snapshot(pid).images) == n_kept


def slowed(monkeypatch: pytest.MonkeyPatch, seconds: float = 0.03) -> None:
    add = Project.add

    def slow(*arguments: Any) -> Any:
        time.sleep(seconds)
        return add(*arguments)

    monkeypatch.setattr(Project, "add", slow)


def test_a_fault_in_the_middle_is_a_refusal_and_no_broken_stream(
    desk: Desk, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    add = Project.add

    def full(project: Project, *arguments: Any) -> Any:
        if len(project.images) == 5:
            raise ProjectError("cannot write x (No space left on device)")
        return add(project, *arguments)

    monkeypatch.setattr(Project, "add", full)
    told = [json.loads(line) for line in added_lines(desk, pid, "all.zip", zipped(9))]
    assert [one["done"] for one in told] == [2, 4, 4]
    assert told[-1]["refused"] == [
        {"name": "all.zip", "reason": "cannot write x (No space left on device)"}
    ]
    assert len(desk.snapshot(pid).images) == 4


def test_a_project_that_goes_away_meanwhile_is_a_refusal(desk: Desk, pid: str) -> None:
    lines = added_lines(desk, pid, "all.zip", zipped(6))
    next(lines)
    shutil.rmtree(desk.root / pid)
    (last,) = lines
    assert "no such project" in json.loads(last)["refused"][0]["reason"]
    assert not (desk.root / pid).exists()


def test_no_page_waits_for_a_busy_project_to_name_it(desk: Desk, pid: str) -> None:
    with ThreadPoolExecutor(1) as another, desk.changing(pid) as project:
        assert another.submit(desk.listing).result(5) == {pid: "door"}
        project.name = "gate"
    assert desk.listing() == {pid: "gate"}
    (desk.root / pid / "project.json").write_text("{")
    assert desk.listing() == {pid: pid}
