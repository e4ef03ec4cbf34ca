"""The same image makes the same numbers with and without torchvision, or the fingerprint tells."""

import importlib.metadata

import pytest
from model_zoo import CPU
from tiny_models import tiny_folder
from transformers import AutoImageProcessor, AutoProcessor

from vqa_state.models.chat.loading import load_chat
from vqa_state.models.chat.model import ChatModel
from vqa_state.models.local import image_processors
from vqa_state.models.local.blip import BlipModel
from vqa_state.models.local.image_processors import image_class, load_images, use_pillow
from vqa_state.models.local.runtime import folder_digest
from vqa_state.models.local.vilt import ViltModel

KINDS = {"blip": BlipModel, "vilt": ViltModel, "idefics3": ChatModel}


class ByTorchvision:
    """Stands for an image processor of transformers that needs torchvision."""

    backend = "torchvision"


class AnotherByTorchvision(ByTorchvision):
    pass


@pytest.fixture
def only_torchvision(monkeypatch):
    """Folders that have no image processor with Pillow; torchvision has the given version."""
    plain = importlib.metadata.version

    def use(kind, release):
        monkeypatch.setattr(AutoImageProcessor, "from_pretrained", lambda *_, **__: kind())
        monkeypatch.setattr(
            image_processors,
            "version",
            lambda package: release if package == "torchvision" else plain(package),
        )

    return use


@pytest.mark.parametrize("family", KINDS)
def test_the_folders_of_the_tests_are_read_with_pillow(family):
    assert load_images(tiny_folder(family)).backend == "pil"
    assert image_class(tiny_folder(family)).endswith("Pil")


def test_a_whole_processor_gets_the_image_processor_with_pillow():
    folder = tiny_folder("idefics3")
    _, processor = load_chat(folder, "x", CPU)
    ours = processor.image_processor
    use_pillow(processor, folder)
    assert processor.image_processor is ours  # it was so already: nothing is read twice
    processor.image_processor = ByTorchvision()
    use_pillow(processor, folder)
    assert type(processor.image_processor) is type(ours)
    assert processor.image_processor.to_dict() == ours.to_dict()


def test_a_chat_model_is_loaded_with_the_one_with_pillow(monkeypatch):
    """As on a machine with torchvision, where transformers takes the other by itself."""
    folder, whole = tiny_folder("idefics3"), AutoProcessor.from_pretrained

    def by_torchvision(*args, **more):
        processor = whole(*args, **more)
        processor.image_processor = ByTorchvision()
        return processor

    monkeypatch.setattr(AutoProcessor, "from_pretrained", by_torchvision)
    assert load_chat(folder, "x", CPU)[1].image_processor.backend == "pil"


def test_the_class_and_the_version_of_torchvision_are_told(only_torchvision):
    folder = tiny_folder("idefics3")
    only_torchvision(ByTorchvision, "0.28.0")
    assert image_class(folder) == "ByTorchvision, torchvision 0.28.0"


def test_another_class_and_another_torchvision_change_the_fingerprint(only_torchvision):
    folder = tiny_folder("idefics3")
    seen = [folder_digest(folder)]
    for kind, release in (
        (ByTorchvision, "0.28.0"),
        (ByTorchvision, "0.29.1"),
        (AnotherByTorchvision, "0.28.0"),
    ):
        only_torchvision(kind, release)
        seen.append(folder_digest(folder))
    assert len(set(seen)) == 4


@pytest.mark.parametrize("family", KINDS)
def test_the_digest_stands_in_every_fingerprint(family, monkeypatch):
    folder = tiny_folder(family)
    one = KINDS[family](folder, "x", CPU).fingerprint
    monkeypatch.setattr("vqa_state.models.local.runtime.image_class", lambda _: "another")
    assert KINDS[family](folder, "x", CPU).fingerprint != one


def test_a_folder_without_an_image_processor_has_no_class(tmp_path):
    (tmp_path / "config.json").write_text("{}")
    assert image_class(tmp_path) == "none"
