"""The choice of a model in the app: what is shown of it, allowing, checking, trying another one."""

import contextlib
from pathlib import Path
from typing import Any

import pytest
from stand_ins import finished

from vqa_state import models
from vqa_state.answers import Answer
from vqa_state.errors import ModelError, NotApprovedError, VQAStateError
from vqa_state.jobs import JobState, Snapshot
from vqa_state.models.fake import ScriptedModel
from vqa_state.models.hub import DownloadProgress
from vqa_state.web.desk import Desk
from vqa_state.web.tabs import ask, model, recheck

SERVER = "server:http://127.0.0.1:9/v1#some"
STRANGE: list[Any] = [None, [], {}, True, 7, "nothing", "hub:..", "x" * 200_000]


def told(desk: Desk, pid: str, name: str) -> tuple[str, bool, bool]:
    """The text, and whether allowing and downloading are offered."""
    said, allow, download = model.about(desk, pid, name)
    return said["text"], bool(allow.visible), bool(download.visible)


@pytest.fixture(autouse=True)
def _own_home(data_home: Path) -> None:
    """No test sees what the person at this machine has allowed."""


def test_the_embedded_model_needs_no_yes(desk: Desk, pid: str) -> None:
    assert told(desk, pid, "embedded") == ("", False, False)


def test_a_server_must_be_allowed_and_is_named(desk: Desk, pid: str) -> None:
    text, allow, download = told(desk, pid, SERVER)
    assert "sent to 127.0.0.1:9" in text
    assert (allow, download) == (True, False)
    model.allow(desk, pid, SERVER)
    assert told(desk, pid, SERVER)[1] is False
    assert (SERVER, SERVER) in model.listed("")


def test_asking_a_model_that_was_not_allowed_is_refused(desk: Desk, pid: str) -> None:
    ask.start(desk, pid, SERVER)
    snapshot = finished(desk, pid, ask.KIND)
    assert snapshot.state is JobState.FAILED
    assert "never used on this machine" in snapshot.failure
    with pytest.raises(NotApprovedError):
        models.create(SERVER)


def test_a_model_of_the_hub_can_be_downloaded_once_it_is_allowed(
    desk: Desk, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "hub:Salesforce/blip-vqa-base"
    assert told(desk, pid, name)[1:] == (True, False)
    text, *_ = told(desk, pid, name)
    assert "Not on this disk yet" in text
    assert "BSD-3-Clause" in text
    model.allow(desk, pid, name)
    assert told(desk, pid, name)[1:] == (False, True)
    steps = [DownloadProgress(0, 8_000_000), DownloadProgress(8_000_000, 8_000_000, 2.0)]
    monkeypatch.setattr(model, "download", lambda address, stop: iter(steps))
    model.start_download(desk, pid, name)
    shown = model.view(desk, pid, finished(desk, pid, model.KIND))
    assert "on this disk now" in shown[0]["text"]
    running = Snapshot(JobState.RUNNING, report=DownloadProgress(2_000_000, 8_000_000, 1.0))
    note = model.view(desk, pid, running)[0]
    assert "2 of 8 MB, about 3 s left" in note["text"]
    assert note["share"] == 0.25


def test_only_the_hub_downloads(desk: Desk, pid: str) -> None:
    with pytest.raises(ModelError, match="only a model of the hub"):
        model.start_download(desk, pid, SERVER)


def test_settings_become_part_of_the_address(desk: Desk, pid: str) -> None:
    changed = model.adjust(desk, pid, "folder:/m", "cpu", "bfloat16", " Look. {question} ")
    assert changed == "folder:/m?device=cpu&precision=bfloat16&prompt=Look.%20%7Bquestion%7D"
    assert model.pick(desk, pid, changed)[3:] == ("cpu", "bfloat16", "Look. {question}")
    assert model.adjust(desk, pid, "embedded", "cpu", "auto", "") == "embedded"
    with pytest.raises(VQAStateError, match=r"\{question\} once"):
        model.adjust(desk, pid, "folder:/m", "auto", "auto", "no slot")


@pytest.mark.parametrize("strange", STRANGE)
def test_strange_models_are_told_in_words(desk: Desk, pid: str, strange: Any) -> None:
    with contextlib.suppress(VQAStateError):  # no other error comes through
        assert isinstance(model.about(desk, pid, strange)[0]["text"], str)


def test_a_check_says_what_it_found_and_what_asking_takes(
    desk: Desk, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    blind = ScriptedModel(lambda image, question: Answer("yes"), name="blind")
    monkeypatch.setitem(models._factories, "blind", lambda: blind)
    model.start_check(desk, pid, "blind")
    note = model.view(desk, pid, finished(desk, pid, model.KIND))[0]
    assert note["tone"] == "bad"
    assert "may drop the image" in note["text"]
    text = told(desk, pid, "blind")[0]
    assert "may drop the image" in text
    assert "1,536 calls, 0 are in the store; about" in text


def test_a_recognizer_is_tried_on_another_model(
    desk: Desk, optimized: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = ScriptedModel(lambda image, question: Answer("no"), name="other", fingerprint="o/1")
    monkeypatch.setitem(models._factories, "other", lambda: other)
    looks = desk.snapshot(optimized).test_looks
    recheck.start(desk, optimized, "other")
    note = recheck.view(desk, optimized, finished(desk, optimized, recheck.KIND))[0]
    assert note["tone"] == "warn"
    assert "test images on the other model" in note["text"]
    assert desk.snapshot(optimized).test_looks == looks + 1
    assert desk.snapshot(optimized).model == "scripted"


def test_one_click_optimizes_again_for_the_other_model(
    desk: Desk, optimized: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from stand_ins import finished, says

    other = ScriptedModel(says, name="other", fingerprint="o/1")
    monkeypatch.setitem(models._factories, "other", lambda: other)
    recheck.start_again(desk, optimized, "other")
    snapshot = finished(desk, optimized, recheck.KIND)
    assert snapshot.state is JobState.DONE, snapshot.failure
    assert "of the other model now" in recheck.view(desk, optimized, snapshot)[0]["text"]
    assert desk.snapshot(optimized).fingerprint == "o/1"


def test_without_a_recognizer_there_is_nothing_to_try(desk: Desk, pid: str) -> None:
    with pytest.raises(VQAStateError):
        recheck.start(desk, pid, "embedded")
