"""The app's models: one in memory at a time, and none after its yes was taken back."""

import gc
import threading
import weakref
from pathlib import Path

import pytest

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError, NotApprovedError
from vqa_state.models.address import ModelAddress
from vqa_state.models.approval import withdraw
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.model_cache import Shelf

SERVER = "server:http://127.0.0.1:9/v1#some"


@pytest.fixture(autouse=True)
def _own_home(data_home: Path) -> None:
    """No test sees what the person at this machine has allowed."""


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the models made, in order; "a", "b", "c" and "embedded" can be made."""
    names: list[str] = []

    def maker(name: str) -> models.Factory:
        def make() -> ScriptedModel:
            names.append(name)
            return ScriptedModel(lambda image, question: Answer("yes"), name=name)

        return make

    for name in ("a", "b", "c", "embedded"):
        monkeypatch.setitem(models._factories, name, maker(name))
    return names


def test_one_model_stays_and_the_small_one_beside_it(made: list[str]) -> None:
    shelf = Shelf()
    gone = weakref.ref(shelf.get("a"))
    assert shelf.get("a") is gone()
    shelf.get("embedded")
    assert shelf.get("a") is gone()
    assert made == ["a", "embedded"]
    shelf.get("b")
    gc.collect()
    assert gone() is None
    shelf.get("embedded")
    assert made == ["a", "embedded", "b"]


def test_a_model_that_still_works_is_not_loaded_twice(made: list[str]) -> None:
    shelf = Shelf()
    at_work = shelf.get("a")
    shelf.get("b")
    assert shelf.get("a") is at_work
    del at_work
    gc.collect()
    shelf.get("a")  # it is the one that is kept now
    assert made == ["a", "b"]


def test_a_model_that_loads_blocks_none_that_is_loaded(
    made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def slow() -> ScriptedModel:
        made.append("slow")
        begun.set()
        assert go_on.wait(30)
        return ScriptedModel(lambda image, question: Answer("yes"), name="slow")

    monkeypatch.setitem(models._factories, "slow", slow)
    shelf = Shelf()
    loaded = shelf.get("a")
    got: list[object] = []
    threads = [threading.Thread(target=lambda: got.append(shelf.get("slow"))) for _ in range(2)]
    for thread in threads:
        thread.start()
    assert begun.wait(10)
    quick = threading.Thread(target=lambda: got.append(shelf.get("a")))
    quick.start()
    quick.join(5)
    assert got == [loaded]
    go_on.set()
    for thread in threads:
        thread.join(10)
    assert made == ["a", "slow"]
    assert got[1] is got[2]


def test_a_yes_that_is_taken_back_ends_its_use() -> None:
    shelf = Shelf()
    models.choose(SERVER)
    shelf.get(SERVER)
    withdraw(ModelAddress.parse(SERVER))
    with pytest.raises(NotApprovedError):
        shelf.get(SERVER)
    assert shelf.loaded(SERVER) is None


def test_a_model_that_cannot_be_loaded_leaves_the_other(
    made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> ScriptedModel:
        raise ModelError("damaged")

    monkeypatch.setitem(models._factories, "broken", broken)
    shelf = Shelf()
    loaded = shelf.get("a")
    for _ in range(2):
        with pytest.raises(ModelError, match="damaged"):
            shelf.get("broken")
    assert shelf.loaded("a") is loaded
    assert shelf.loaded("broken") is None


def test_a_model_that_cannot_be_watched_is_kept_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Slotted:
        __slots__ = ()
        name, fingerprint, notes = "slotted", "slotted/1", ()

        def answer(self, images: object, questions: object) -> object:
            return iter(())

    monkeypatch.setitem(models._factories, "slotted", Slotted)
    shelf = Shelf()
    assert shelf.get("slotted") is shelf.get("slotted")
