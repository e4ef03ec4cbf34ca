"""Downloads from a hub on this machine: progress, a stop, going on, refusals, no network."""

import os
import threading
import time

import hub_stub
import pytest
from hub_stub import Hub
from tiny_models import tiny_folder

from vqa_state import models
from vqa_state.errors import ModelError
from vqa_state.models.address import ModelAddress
from vqa_state.models.hub import snapshots as hub_module
from vqa_state.models.hub.download import wanted
from vqa_state.models.hub.snapshots import cached_folder, download, is_cached

ADDRESS = ModelAddress.parse("hub:us/tiny-vilt")


@pytest.fixture
def hub(monkeypatch, tmp_path, data_home):
    """Serves a tiny ViLT; the cache is empty."""
    folder = tiny_folder("vilt")
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    files |= {"flax_model.msgpack": b"x" * 100, "onnx/model.safetensors": b"y"}
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_CACHE", str(tmp_path / "cache"))
    with Hub({"us/tiny-vilt": files, "us/closed": files}, gated={"us/closed"}) as running:
        monkeypatch.setenv("HF_ENDPOINT", running.url)
        monkeypatch.setenv("HF_HUB_DISABLE_XET", "1")
        yield running


def test_a_model_comes_here_once_and_can_be_used(hub):
    assert not is_cached(ADDRESS)
    with pytest.raises(ModelError, match=r"not on this disk; download it .*folder:/path/to/it"):
        cached_folder(ADDRESS)
    reports = list(download(ADDRESS))
    assert reports[-1].n_bytes == reports[-1].total > 0
    assert [one.n_bytes for one in reports] == sorted(one.n_bytes for one in reports)
    assert is_cached(ADDRESS)
    assert "flax_model.msgpack" not in hub.downloads
    assert models.create(models.choose(str(ADDRESS))).name == str(ADDRESS)
    n_downloads = len(hub.downloads)
    list(download(ADDRESS))
    assert len(hub.downloads) == n_downloads


class Stop:
    """Says so from `at` on: a time by the clock, None while nobody has stopped."""

    at = None

    def now(self):
        self.at = self.at or time.monotonic()

    def __call__(self):
        return self.at is not None


def test_a_stop_ends_it_within_a_second_and_the_next_goes_on(hub):
    hub.models["us/tiny-vilt"]["model.safetensors"] += b" " * 8_000_000
    hub.pause = 0.05
    stop = Stop()
    last = None
    for report in download(ADDRESS, stop):
        last = report
        if "model.safetensors" in hub.downloads:
            stop.now()
    assert time.monotonic() - stop.at < 1
    assert last.stopped
    assert not is_cached(ADDRESS)
    hub.pause = 0.0
    assert not list(download(ADDRESS))[-1].stopped


def test_a_stop_ends_it_within_a_second_while_the_hub_says_nothing(hub, monkeypatch):
    stop, end = Stop(), threading.Event()

    def silent(self, name):
        stop.now()
        end.wait(30)

    monkeypatch.setattr(hub_stub.Handler, "_info", silent)
    (last,) = download(ADDRESS, stop)
    assert time.monotonic() - stop.at < 1
    assert last.stopped
    end.set()


def test_weights_come_last_and_old_ones_only_alone():
    sizes = dict.fromkeys(
        ["a.safetensors", "config.json", "pytorch_model.bin", "vocab.txt", "onnx/b.json", "x.py"], 1
    )
    assert wanted(sizes) == ["config.json", "vocab.txt", "a.safetensors"]
    del sizes["a.safetensors"]
    assert wanted(sizes) == ["config.json", "vocab.txt", "pytorch_model.bin"]


@pytest.mark.parametrize(
    ("name", "says"),
    [("us/closed", "accept its licence"), ("us/nothing", "no model us/nothing")],
)
def test_refusals_are_told_in_words(hub, name, says):
    with pytest.raises(ModelError, match=says):
        list(download(ModelAddress.parse(f"hub:{name}")))


def test_without_network_the_error_says_so(hub, monkeypatch):
    monkeypatch.setenv("HF_ENDPOINT", "http://127.0.0.1:9")
    with pytest.raises(ModelError, match="check the network"):
        list(download(ADDRESS))


def test_a_child_that_is_killed_is_an_early_end(hub, monkeypatch):
    monkeypatch.setattr(hub_module.sys, "executable", "/bin/true")
    if not os.path.exists("/bin/true"):  # noqa: PTH110
        monkeypatch.setattr(hub_module.sys, "executable", "/usr/bin/true")
    with pytest.raises(ModelError, match="ended early"):
        list(download(ADDRESS))
