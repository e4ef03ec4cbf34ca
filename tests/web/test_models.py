"""The choice of a model in the app: what is shown of it, allowing, checking, trying another one."""

import contextlib
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from stand_ins import finished
from stub_server import Result, Stub

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError, NotApprovedError, VQAStateError
from vqa_state.models import Reply, presets
from vqa_state.models.hub.snapshots import DownloadProgress
from vqa_state.models.length_limit import FIELD
from vqa_state.models.vision_check import N_CALLS
from vqa_state.study.vision_check import CheckProgress
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web import job_watcher
from vqa_state.web.heatmap import heat_value
from vqa_state.web.jobs import JobState, Snapshot
from vqa_state.web.session import Desk
from vqa_state.web.tabs.ask import model, model_words
from vqa_state.web.tabs.ask import tab as ask
from vqa_state.web.tabs.recognizer import tab as recognizer
from vqa_state.web.tabs.recognizer import transfer
from vqa_state.web.view_data import image_card

SERVER = "server:http://127.0.0.1:9/v1#some"
STRANGE: list[Any] = [None, [], {}, True, 7, "nothing", "hub:..", "x" * 200_000]


def told(desk: Desk, pid: str, name: str) -> tuple[str, bool, bool]:
    """The text, and whether allowing and downloading are offered."""
    said, allow, download, *_ = model.about(desk, pid, name)
    return said["text"], bool(allow.visible), bool(download.visible)


def offered(desk: Desk, pid: str, name: str) -> list[str]:
    """Which buttons are there."""
    _, *buttons = model.about(desk, pid, name)
    names = ("allow", "download", "convert", "offers")
    return [one for one, button in zip(names, buttons, strict=True) if button.visible]


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
    changed = model.adjust(desk, pid, "folder:/m", "cpu", "bfloat16", " Look. {question} ", 8)
    assert changed == "folder:/m?device=cpu&precision=bfloat16&prompt=Look.%20%7Bquestion%7D"
    assert model.pick(desk, pid, changed)[-4:] == ("cpu", "bfloat16", "Look. {question}", 8)
    assert model.adjust(desk, pid, "embedded", "cpu", "auto", "", 8) == "embedded"
    longer = model.adjust(desk, pid, "folder:/m", "auto", "auto", "", 64)
    assert longer == "folder:/m?max_tokens=64"
    assert model.pick(desk, pid, longer)[-1] == 64
    for wrong in (0, 8.5, 5000, None, "many"):
        with pytest.raises(VQAStateError, match=r"whole number|number"):
            model.adjust(desk, pid, "folder:/m", "auto", "auto", "", wrong)
    with pytest.raises(VQAStateError, match=r"\{question\} once"):
        model.adjust(desk, pid, "folder:/m", "auto", "auto", "no slot", 8)


def test_what_was_cut_off_is_shown_apart_on_ask_on_the_heatmap_and_beside_answers(
    desk: Desk, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    thinks = ScriptedModel(lambda *_: Answer("", at_limit=True), name="thinks")
    monkeypatch.setitem(models._factories, "thinks", lambda: thinks)
    ask.start(desk, pid, "thinks")
    snapshot = finished(desk, pid, ask.KIND)
    text = ask.costs(desk, pid, "thinks")["text"]
    assert "No clear answer (cut off): " in text
    assert f"in the app: “{FIELD}”), 8 now" in text
    note = ask.view(desk, pid, snapshot)[0]
    assert "No clear answer (cut off): " in note["text"]
    project = desk.snapshot(pid)
    cells = [cell for row in heat_value(project)["rows"] for cell in row["cells"] if cell]
    assert {cell["cut_off"] for cell in cells} == {1.0}
    question = project.questions()[0].text
    card = image_card(project, next(iter(project.images)), [question])
    assert card["answers"] == [[question, "(empty) – no clear answer (cut off) × 6"]]


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
    assert "s here, and each question about it" in text
    assert "MB of memory" in text
    again = Desk(desk.root)  # after a restart, it is known from this machine's own file
    assert "may drop the image" in told(again, pid, "blind")[0]
    cost = ask.costs(desk, pid, "blind")["text"]
    assert "1,536 are to be asked" in cost
    assert "That takes about" in cost
    assert "A process with the model in it takes" in cost
    assert "whether the model sees" not in cost


def test_a_check_hears_the_stop_within_a_call(
    desk: Desk, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(models._factories, "hanging", Hanging)
    for start, kind in ((model.start_check, model.KIND), (ask.start, ask.KIND)):
        start(desk, pid, "hanging")
        job = desk.jobs.get(pid, kind)
        assert job is not None
        assert Hanging.hangs.wait(10)
        Hanging.hangs.clear()
        began = time.monotonic()
        job_watcher.Watch(kind, ask.view).stop(desk, pid)
        assert job.join(10).state is JobState.STOPPED
        assert time.monotonic() - began < 1


class Hanging:
    """Hangs in every call, and gives up when it is told to."""

    name, fingerprint, notes = "hanging", "hanging/1", ()
    hangs = threading.Event()

    def answer(self, images: Any, questions: Any) -> Iterator[Reply]:
        raise AssertionError("it cannot be stopped so")

    def answer_until(self, images: Any, questions: Any, stop: Any) -> Iterator[Reply]:
        self.hangs.set()
        until = time.monotonic() + 30
        while not stop() and time.monotonic() < until:
            time.sleep(0.01)
        yield from ()


# ---- before a run --------------------------------------------------------------------------


def test_asking_a_new_model_looks_first_and_tells_what_to_know(
    desk: Desk, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    blind = ScriptedModel(lambda image, question: Answer("yes"), name="blind", fingerprint="b/1")
    blind.notes = ("It goes the slow way.",)
    monkeypatch.setitem(models._factories, "blind", lambda: blind)
    cost = ask.costs(desk, pid, "blind")["text"]
    assert f"up to {N_CALLS} calls, once, to see whether the model sees" in cost
    assert "not known here yet: Check measures it" in cost
    ask.start(desk, pid, "blind")
    note = ask.view(desk, pid, finished(desk, pid, ask.KIND))[0]
    assert "1,536 of 1,536 answered" in note["text"]  # the user is told, and it goes on
    assert "may drop the image" in note["text"]
    assert "It goes the slow way." in note["text"]
    assert note["tone"] == "warn"
    timing = 2 * (1 + 16)
    assert len(blind.asked) == N_CALLS + 1536 + timing
    ask.start(desk, pid, "blind")  # all is answered: nothing is looked at, nothing is told
    note = ask.view(desk, pid, finished(desk, pid, ask.KIND))[0]
    assert (note["tone"], "may drop" in note["text"]) == ("good", False)
    assert len(blind.asked) == N_CALLS + 1536 + timing


def test_a_look_is_shown_while_it_lasts(desk: Desk, pid: str) -> None:
    running = Snapshot(JobState.RUNNING, report=CheckProgress(6, 24, seconds=3.0))
    for view in (ask.view, transfer.view):
        note = view(desk, pid, running)[0]
        assert note["text"] == (
            "Looking whether the model sees: 6 of at most 24 calls, at most 9 s left"
        )
        assert note["share"] == 0.25


def test_the_cost_of_a_preset_tells_its_weights(desk: Desk, pid: str) -> None:
    cost = ask.costs(desk, pid, "hub:Salesforce/blip-vqa-base?precision=bfloat16")["text"]
    assert "weights alone take 1,540 MB" in cost
    assert "weights alone" not in ask.costs(desk, pid, "hub:lesforce/blip-vqa-base")["text"]


# ---- presets, servers, old weights ---------------------------------------------------------


def test_only_the_preset_itself_is_described_as_one(desk: Desk, pid: str) -> None:
    assert "BSD-3-Clause" in told(desk, pid, "hub:Salesforce/blip-vqa-base@v2")[0]
    text = told(desk, pid, "hub:lesforce/blip-vqa-base")[0]
    assert "BSD-3-Clause" not in text
    assert "see its page" in text


def test_a_preset_tells_what_it_needs(
    desk: Desk, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = presets.Preset("hub:a/b", "A", 2000, "free", ("json", "no_such_package"))
    monkeypatch.setattr(model_words, "PRESETS", (one,))
    text = told(desk, pid, "hub:a/b")[0]
    assert "wants a GPU" in text
    assert "pip install no_such_package." in text


def test_what_was_never_allowed_is_not_downloaded(desk: Desk, pid: str) -> None:
    for start in (model.start_download, model.start_convert):
        with pytest.raises(NotApprovedError):
            start(desk, pid, "hub:evil/model")
    assert desk.jobs.get(pid, model.KIND) is None


def test_a_server_is_asked_for_its_models_by_a_click_only(desk: Desk, pid: str) -> None:
    def listing(call: Any, handler: Any) -> Result:
        return Result({"object": "list", "data": [{"id": "tiny"}, {"id": "b c"}]})

    with Stub(listing) as stub:
        name = f"server:{stub.url}"
        assert offered(desk, pid, name) == ["offers"]
        assert f"Which model of {stub.url}" in told(desk, pid, name)[0]
        assert not stub.calls
        said, dropdown = model.list_offers(desk, pid, name)
        assert len(stub.calls) == 1
    assert "tiny, b%20c" in said["text"]
    values = [value for _, value in dropdown.choices]
    assert values[:2] == [f"{name}#tiny", f"{name}#b%20c"]
    assert "embedded" in values
    assert offered(desk, pid, f"{name}#tiny") == ["allow"]
    with pytest.raises(ModelError):
        model.list_offers(desk, pid, name)  # it is gone
    with pytest.raises(ModelError, match="only a server"):
        model.list_offers(desk, pid, "hub:a/b")


def test_a_server_that_cannot_be_one_is_not_asked(desk: Desk, pid: str) -> None:
    for url in ("ftp://x", "http://user:SECRET@host/v1", "http://", "http://h/v1?device=cpu"):
        assert offered(desk, pid, f"server:{url}") == []
        assert "SECRET" not in told(desk, pid, f"server:{url}")[0]


def test_old_weights_are_told_and_converted(desk: Desk, pid: str, tmp_path: Path) -> None:
    import torch

    (tmp_path / "config.json").write_text('{"model_type": "ofa"}')
    torch.save({"encoder.embed_tokens.weight": torch.ones(3, 2)}, tmp_path / "pytorch_model.bin")
    name = f"folder:{tmp_path}"
    assert offered(desk, pid, name) == ["allow"]
    model.allow(desk, pid, name)
    assert offered(desk, pid, name) == ["convert"]
    assert "press Convert" in told(desk, pid, name)[0]
    model.start_convert(desk, pid, name)
    note = model.view(desk, pid, finished(desk, pid, model.KIND))[0]
    assert note["text"] == "Converted: it can be used now."
    assert offered(desk, pid, name) == []
    model.start_convert(desk, pid, name)
    note = model.view(desk, pid, finished(desk, pid, model.KIND))[0]
    assert "to convert on this disk" in note["text"]


def test_a_downloaded_ofa_must_be_converted_not_downloaded_again(
    desk: Desk, pid: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "hub:OFA-Sys/OFA-base"
    (tmp_path / "config.json").write_text('{"model_type": "ofa"}')
    monkeypatch.setattr("vqa_state.models.opening.cached_folder", lambda address: tmp_path)
    model.allow(desk, pid, name)
    assert offered(desk, pid, name) == ["download"]
    (tmp_path / "pytorch_model.bin").write_bytes(b"weights")
    assert offered(desk, pid, name) == ["convert"]
    assert "Not on this disk" not in told(desk, pid, name)[0]


def test_a_recognizer_is_tried_on_another_model(
    desk: Desk, optimized: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = ScriptedModel(lambda image, question: Answer("no"), name="other", fingerprint="o/1")
    monkeypatch.setitem(models._factories, "other", lambda: other)
    looks = desk.snapshot(optimized).test_looks
    transfer.start(desk, optimized, "other")
    note = transfer.view(desk, optimized, finished(desk, optimized, transfer.KIND))[0]
    assert note["tone"] == "warn"
    assert "test images on the other model" in note["text"]
    assert "may drop the image" in note["text"]
    assert desk.snapshot(optimized).test_looks == looks + 1
    assert desk.snapshot(optimized).model == "scripted"


def test_what_the_tab_would_download_is_tried(
    desk: Desk, optimized: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    other = ScriptedModel(
        lambda image, question: asked.append(question) or Answer("no"),
        name="other",
        fingerprint="o/1",
    )
    monkeypatch.setitem(models._factories, "other", lambda: other)
    recognizer.choose(desk, optimized, "all")
    transfer.start(desk, optimized, "other")
    assert finished(desk, optimized, transfer.KIND).state is JobState.DONE
    every = {question.text for question in desk.snapshot(optimized).grid.build().questions}
    assert set(asked) >= every  # and what the look whether it sees asks


def test_one_click_optimizes_again_for_the_other_model(
    desk: Desk, optimized: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from stand_ins import finished, says

    other = ScriptedModel(says, name="other", fingerprint="o/1")
    monkeypatch.setitem(models._factories, "other", lambda: other)
    transfer.start_again(desk, optimized, "other")
    snapshot = finished(desk, optimized, transfer.KIND)
    assert snapshot.state is JobState.DONE, snapshot.failure
    assert "of the other model now" in transfer.view(desk, optimized, snapshot)[0]["text"]
    assert desk.snapshot(optimized).fingerprint == "o/1"


def test_without_a_recognizer_there_is_nothing_to_try(desk: Desk, pid: str) -> None:
    with pytest.raises(VQAStateError):
        transfer.start(desk, pid, "embedded")
