"""Who waits for a model that somebody else uses; which numbers a graphics card gets."""

import threading
import time

import pytest

from vqa_state.errors import ModelError
from vqa_state.models.address import Device, ModelAddress, Precision
from vqa_state.models.hub.snapshots import cached_folder
from vqa_state.models.local.exclusive_access import Stopped, Turns
from vqa_state.models.local.runtime import choose_runtime


@pytest.fixture
def busy():
    """A model that another caller does not give back before the test is over."""
    turns, taken, over = Turns(), threading.Event(), threading.Event()

    def hold():
        with turns.take():
            taken.set()
            over.wait(20)

    holder = threading.Thread(target=hold)
    holder.start()
    taken.wait(20)
    yield turns
    over.set()
    holder.join()


def test_a_stop_is_heard_while_somebody_else_has_the_model(busy):
    began = time.monotonic()
    with pytest.raises(Stopped), busy.until(lambda: time.monotonic() - began > 0.2).take():
        pytest.fail("the other still has it")
    assert 0.2 <= time.monotonic() - began < 1


def test_who_gives_up_leaves_the_model_to_the_others(busy):
    waiting = []

    def wait():
        with busy.take():
            waiting.append("had it")

    patient = threading.Thread(target=wait)
    patient.start()
    with pytest.raises(Stopped), busy.until(lambda: True).take():
        pytest.fail("the other still has it")
    assert not waiting
    assert busy.lock.locked()


def test_after_an_error_and_a_stop_the_model_is_free():
    turns = Turns()
    with pytest.raises(ValueError, match="inside"), turns.take():
        raise ValueError("inside")
    with pytest.raises(Stopped), turns.until(lambda: True).take():
        pytest.fail("it was stopped before")
    assert not turns.lock.locked()


@pytest.mark.parametrize(
    ("in_hardware", "chosen"), [(True, Precision.BFLOAT16), (False, Precision.FLOAT16)]
)
def test_a_card_that_only_emulates_bfloat16_gets_float16(monkeypatch, in_hardware, chosen):
    import torch

    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(
        torch.cuda,
        "is_bf16_supported",
        lambda including_emulation=True: including_emulation or in_hardware,
    )
    assert choose_runtime(Device.CUDA).precision is chosen


@pytest.mark.parametrize("address", ["hub:us/nothing", "hub:us/nothing@v2"])
def test_the_download_that_an_error_names_is_of_the_same_revision(monkeypatch, tmp_path, address):
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_CACHE", str(tmp_path))
    with pytest.raises(ModelError, match=f"models download {address}[.] "):
        cached_folder(ModelAddress.parse(f"{address}?precision=bfloat16"))
