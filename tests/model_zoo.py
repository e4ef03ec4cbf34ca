"""One model of every family for the contract suite, each small enough to be made on the spot."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch
from chat_folders import BUILDERS, lacking
from stub_server import Stub, good
from tiny_models import tiny_folder

from vqa_state.answers.answer import Answer
from vqa_state.models import VQAModel
from vqa_state.models.address import Device, Precision
from vqa_state.models.embedded.model import EmbeddedModel
from vqa_state.models.local.runtime import Runtime
from vqa_state.testing.fake_model import ScriptedModel

GOLDEN = Path(__file__).parent / "golden" / "ofa"
CPU = Runtime(Device.CPU, Precision.FLOAT32)


@dataclass(frozen=True)
class Kind:
    """How to make a model, and whether its answers are ours alone (a local one, in float32)."""

    name: str
    make: Callable[[], VQAModel]
    is_local: bool = True
    lacks: tuple[str, ...] = ()


def zoo(home: Path) -> dict[str, Kind]:
    """All kinds by name; `home` is where folders are written."""
    kinds = [
        Kind("embedded", EmbeddedModel),
        Kind("fake", lambda: ScriptedModel(lambda image, question: Answer("yes", 0.75))),
        Kind("blip", lambda: blip("folder:blip")),
        Kind("vilt", lambda: vilt("folder:vilt")),
        Kind("ofa", lambda: ofa("folder:ofa", home)),
        Kind("server", lambda: served(home), is_local=False),
    ]
    kinds += [
        Kind(family, lambda family=family: chat(family, home), lacks=tuple(lacking(family)))
        for family in BUILDERS
    ]
    return {kind.name: kind for kind in kinds}


def blip(name: str, **settings) -> VQAModel:
    from vqa_state.models.local.blip import BlipModel

    return BlipModel(tiny_folder("blip"), name, CPU, **settings)


def vilt(name: str, **settings) -> VQAModel:
    from vqa_state.models.local.vilt import ViltModel

    return ViltModel(tiny_folder("vilt"), name, CPU, **settings)


def chat(family: str, home: Path, **settings) -> VQAModel:
    from vqa_state.models.chat.model import ChatModel

    return ChatModel(chat_folder(family, home), f"folder:{family}", CPU, **settings)


@cache
def chat_folder(family: str, home: Path) -> Path:
    if family == "idefics3":
        return tiny_folder("idefics3")
    BUILDERS[family](home / family)
    return home / family


def ofa(name: str, home: Path, **settings) -> VQAModel:
    from vqa_state.models.local.ofa.model import OfaModel

    return OfaModel(ofa_folder(home), name, CPU, **settings)


@cache
def ofa_folder(home: Path) -> Path:
    """The golden words with random weights, small pictures, converted."""
    from vqa_state.models.local.ofa.config import read_folder
    from vqa_state.models.local.ofa.loading import convert_checkpoint
    from vqa_state.models.local.ofa.network import OfaNetwork

    folder = home / "ofa"
    folder.mkdir()
    for name in ("config.json", "vocab.json", "merges.txt"):
        shutil.copy(GOLDEN / name, folder)
    said = json.loads((folder / "config.json").read_text()) | {"patch_image_size": 64}
    (folder / "config.json").write_text(json.dumps(said))
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        network = OfaNetwork(read_folder(folder)[0])
    torch.save(network.state_dict(), folder / "pytorch_model.bin")
    convert_checkpoint(folder)
    return folder


def served(home: Path) -> VQAModel:
    from vqa_state.models.server.model import ServerModel

    server = _server()
    return ServerModel(f"{server.url}", "some-model", "server:stub")


@cache
def _server() -> Stub:
    """Lives as long as the test session."""
    return Stub(good).__enter__()
