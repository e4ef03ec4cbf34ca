"""A fingerprint changes with all that can change an answer, and with nothing else."""

import json
import shutil

import pytest
import torch
from model_zoo import CPU, chat_folder, ofa_folder
from safetensors.torch import load_file, save_file
from tiny_models import tiny_folder

from vqa_state.models.address import Device, Precision
from vqa_state.models.chat.model import ChatModel
from vqa_state.models.local.blip import BlipModel
from vqa_state.models.local.ofa.model import OfaModel
from vqa_state.models.local.runtime import Runtime
from vqa_state.models.local.vilt import ViltModel
from vqa_state.models.server.model import ServerModel

FAMILIES = {
    "blip": (BlipModel, lambda home: tiny_folder("blip")),
    "vilt": (ViltModel, lambda home: tiny_folder("vilt")),
    "idefics3": (ChatModel, lambda home: chat_folder("idefics3", home)),
    "ofa": (OfaModel, ofa_folder),
}


@pytest.fixture(scope="module", params=FAMILIES)
def family(request, tmp_path_factory):
    kind, folder = FAMILIES[request.param]
    return kind, folder(tmp_path_factory.mktemp("home"))


def copied(folder, target):
    return shutil.copytree(folder, target, ignore=shutil.ignore_patterns("*.bin"))


def test_another_place_and_name_change_nothing(family, tmp_path):
    kind, folder = family
    moved = copied(folder, tmp_path / "moved")
    assert kind(moved, "other", CPU).fingerprint == kind(folder, "one", CPU).fingerprint


def test_weights_change_it(family, tmp_path):
    kind, folder = family
    changed = copied(folder, tmp_path / "changed")
    weights = load_file(changed / "model.safetensors")
    name = next(key for key, value in weights.items() if value.is_floating_point())
    weights[name] = weights[name] + torch.full_like(weights[name], 0.001)
    save_file(weights, changed / "model.safetensors", {"format": "pt"})
    assert kind(changed, "one", CPU).fingerprint != kind(folder, "one", CPU).fingerprint


def test_precision_and_prompt_change_it(family):
    kind, folder = family
    half = Runtime(Device.CPU, Precision.BFLOAT16)
    prints = {
        kind(folder, "one", CPU).fingerprint,
        kind(folder, "one", half).fingerprint,
        kind(folder, "one", CPU, prompt="Look closely. {question}").fingerprint,
    }
    assert len(prints) == 3


@pytest.mark.parametrize("family_name", ["blip", "vilt", "idefics3"])
def test_preprocessing_changes_it(family_name, tmp_path):
    kind, folder = FAMILIES[family_name]
    changed = copied(folder(tmp_path), tmp_path / "changed")
    (file,) = (p for p in changed.glob("*processor_config.json") if "image_mean" in p.read_text())
    content = json.loads(file.read_text())
    settings = content.get("image_processor", content)
    settings["image_mean"] = [0.4, 0.4, 0.4]
    file.write_text(json.dumps(content))
    one = kind(folder(tmp_path), "one", CPU).fingerprint
    assert kind(changed, "one", CPU).fingerprint != one


def test_a_servers_address_model_and_prompt_change_it_and_its_key_does_not(monkeypatch):
    url = "http://127.0.0.1:9/v1"
    one = ServerModel(url, "m", "server:x").fingerprint
    assert ServerModel("http://127.0.0.1:8/v1", "m", "server:x").fingerprint != one
    assert ServerModel(url, "n", "server:x").fingerprint != one
    assert ServerModel(url, "m", "server:x", "Look. {question}").fingerprint != one
    monkeypatch.setenv("VQA_STATE_KEYS", "127.0.0.1:9=secret")
    assert ServerModel(url, "m", "server:x").fingerprint == one
