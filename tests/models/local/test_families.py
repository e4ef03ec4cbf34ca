"""Which family a folder is of, what it lacks, and how it is opened."""

import json
import shutil

import pytest
from tiny_models import tiny_folder

from vqa_state import models
from vqa_state.errors import ModelError
from vqa_state.models.address import Device, Precision
from vqa_state.models.local.families import Family, family_of, missing_weights
from vqa_state.models.local.runtime import choose_runtime, folder_digest


def folder_with(tmp_path, **config):
    (tmp_path / "config.json").write_text(json.dumps(config))
    return tmp_path


@pytest.mark.parametrize(
    ("config", "family"),
    [
        ({"model_type": "vilt"}, Family.VILT),
        ({"model_type": "blip", "architectures": ["BlipForQuestionAnswering"]}, Family.BLIP),
        ({"model_type": "ofa"}, Family.OFA),
        ({"model_type": "idefics3"}, Family.CHAT),
        ({"model_type": "qwen3_vl"}, Family.CHAT),
        ({"model_type": "paligemma"}, Family.CHAT),
    ],
)
def test_the_configuration_tells_the_family(tmp_path, config, family):
    assert family_of(folder_with(tmp_path, **config)) is family


@pytest.mark.parametrize(
    "config",
    [
        {},
        {"model_type": "bert"},
        {"model_type": 7},
        # Loaded as an image-text-to-text model it would silently be the captioning class.
        {"model_type": "blip", "architectures": ["BlipForConditionalGeneration"]},
    ],
)
def test_other_models_are_refused_with_what_is_usable(tmp_path, config):
    with pytest.raises(ModelError, match="usable are BLIP and ViLT"):
        family_of(folder_with(tmp_path, **config))


def test_code_of_a_model_is_refused_by_name(tmp_path):
    folder = folder_with(tmp_path, model_type="internvl_chat", auto_map={"AutoModel": "x.Y"})
    with pytest.raises(ModelError, match="code of its own, which is refused"):
        family_of(folder)


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b"[" * 100_000, b" " * 10_000_001])
def test_a_damaged_configuration(tmp_path, content):
    (tmp_path / "config.json").write_bytes(content)
    with pytest.raises(ModelError, match="is damaged"):
        family_of(tmp_path)


def test_no_configuration(tmp_path):
    with pytest.raises(ModelError, match="holds no model"):
        family_of(tmp_path)


def test_what_weights_are_missing(tmp_path):
    assert missing_weights(tmp_path) == ["model.safetensors"]
    index = {"weight_map": {"a": "one.safetensors", "b": "two.safetensors"}}
    (tmp_path / "model.safetensors.index.json").write_text(json.dumps(index))
    (tmp_path / "one.safetensors").touch()
    assert missing_weights(tmp_path) == ["two.safetensors"]
    (tmp_path / "two.safetensors").touch()
    assert not missing_weights(tmp_path)


def test_a_folder_is_opened_by_its_address(data_home):
    name = models.choose(f"folder:{tiny_folder('blip')}")
    assert models.create(name).name == name


def test_old_weights_are_not_read_but_their_conversion_is_named(data_home, tmp_path):
    shutil.copytree(tiny_folder("vilt"), tmp_path / "old")
    (tmp_path / "old" / "model.safetensors").rename(tmp_path / "old" / "pytorch_model.bin")
    with pytest.raises(ModelError, match="models convert"):
        models.create(models.choose(f"folder:{tmp_path / 'old'}"))


def test_a_folder_without_weights_says_what_it_lacks(data_home, tmp_path):
    shutil.copytree(tiny_folder("vilt"), tmp_path / "half")
    (tmp_path / "half" / "model.safetensors").unlink()
    with pytest.raises(ModelError, match=r"lacks model\.safetensors"):
        models.create(models.choose(f"folder:{tmp_path / 'half'}"))
    with pytest.raises(ModelError, match="there is no folder"):
        models.create(models.choose(f"folder:{tmp_path / 'none'}"))


def test_the_runtime_is_chosen_for_this_machine():
    assert str(choose_runtime(Device.CPU)) == "cpu float32"
    assert choose_runtime(Device.CPU, Precision.BFLOAT16).precision is Precision.BFLOAT16
    with pytest.raises(ModelError, match="no fast float16"):
        choose_runtime(Device.CPU, Precision.FLOAT16)


def test_a_device_that_is_not_there(monkeypatch):
    import torch

    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ModelError, match=r"no device cuda; it has: .*cpu"):
        choose_runtime(Device.CUDA)


def test_the_digest_is_of_what_changes_answers(tmp_path):
    (tmp_path / "config.json").write_text("{}")
    before = folder_digest(tmp_path)
    (tmp_path / "README.md").write_text("words")
    assert folder_digest(tmp_path) == before
    (tmp_path / "tokenizer.json").write_text("{}")
    assert folder_digest(tmp_path) != before
