"""The golden OFA: its folder as its authors would publish it, converted, and what goes into it."""

import json
import shutil
from pathlib import Path

import numpy as np
import ofa_weights
import torch

from vqa_state.models.address import Device, Precision
from vqa_state.models.local.ofa.config import read_folder
from vqa_state.models.local.ofa.loading import convert_checkpoint
from vqa_state.models.local.ofa.network import OfaNetwork, fixed_buffers
from vqa_state.models.local.runtime import Runtime

GOLDEN = Path(__file__).parent / "golden" / "ofa"
REFERENCE = json.loads((GOLDEN / "golden.json").read_text())
N_WORDS = len(json.loads((GOLDEN / "vocab.json").read_text()))
CPU = Runtime(Device.CPU, Precision.FLOAT32)
QUESTIONS = [text for text, _ in REFERENCE["cleaned"][:7]]


def shapes_of(config):
    with torch.device("meta"):
        return {name: value.shape for name, value in OfaNetwork(config).state_dict().items()}


def write_folder(made):
    """The golden model as its authors would publish it, converted."""
    for name in ("config.json", "vocab.json", "merges.txt"):
        shutil.copy(GOLDEN / name, made)
    said = json.loads((made / "config.json").read_text()) | {"patch_image_size": 64}
    (made / "config.json").write_text(json.dumps(said))
    config, _ = read_folder(made)
    learned = ofa_weights.learned_weights(shapes_of(config), N_WORDS)
    state = {name: torch.from_numpy(value) for name, value in learned.items()}
    state |= fixed_buffers(config)
    table = state["encoder.embed_tokens.weight"]
    state |= {"decoder.embed_tokens.weight": table, "decoder.output_projection.weight": table}
    torch.save(state, made / "pytorch_model.bin")
    convert_checkpoint(made)


def variant(folder, target, **said):
    """A copy of the model's folder whose config.json says something else."""
    shutil.copytree(folder, target, ignore=shutil.ignore_patterns("*.bin"))
    config = json.loads((folder / "config.json").read_text()) | said
    (target / "config.json").write_text(json.dumps(config))
    return target


def pixels_of(side):
    image = ofa_weights.picture(7, side, side).astype(np.float32) / 127.5 - 1
    return torch.from_numpy(image).permute(2, 0, 1)[None]


def encode(network, tokens, side=64):
    with torch.inference_mode():
        return network.encoder(network.encoder.see(pixels_of(side)), torch.tensor([tokens]))
