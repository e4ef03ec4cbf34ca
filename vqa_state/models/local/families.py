"""Which family a folder of weights belongs to, from its config.json alone; no code of it runs."""

import json
import re
from enum import StrEnum
from pathlib import Path
from typing import Any

from vqa_state.errors import ModelError

__all__ = ["Family", "family_of", "missing_weights", "read_config", "weight_files"]

_MAX_CONFIG_BYTES = 10_000_000

_WEIGHTS = "model.safetensors"
_INDEX = "model.safetensors.index.json"
_SHARD = re.compile(r"[^/\\:\0]+\.safetensors")


class Family(StrEnum):
    """Kinds of local models; each has a module of its own."""

    BLIP = "blip"
    VILT = "vilt"
    OFA = "ofa"
    CHAT = "chat"


def read_config(folder: Path, file: str = "config.json") -> dict[str, Any]:
    """A JSON object that stands in a model's folder.

    Raises:
        ModelError: if it is missing, too large or no JSON object.
    """
    path = folder / file
    try:
        with path.open("rb") as opened:
            data = opened.read(_MAX_CONFIG_BYTES + 1)
        content = json.loads(data) if len(data) <= _MAX_CONFIG_BYTES else None
    except OSError as error:
        raise ModelError(
            f"{folder} holds no model ({file}: {error.strerror}); name the folder that holds "
            "config.json and the weights"
        ) from error
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise ModelError(f"{path} is damaged; download or copy it again, with all its files")
    return content


def family_of(folder: Path) -> Family:
    """The family, by the rules of this list, in this order.

    `AutoModelForImageTextToText` would load the captioning class for a BLIP folder without a
    word, so BLIP is recognised by its architecture first.

    Raises:
        ModelError: if there is no model, or none that answers questions about images without code
            of its own.
    """
    config = read_config(folder)
    kind, architectures = config.get("model_type"), config.get("architectures") or []
    if kind == "vilt":
        return Family.VILT
    if kind == "blip" and "BlipForQuestionAnswering" in architectures:
        return Family.BLIP
    if kind == "ofa":
        return Family.OFA
    if kind != "blip" and isinstance(kind, str) and kind in _chat_kinds():
        return Family.CHAT
    own_code = " (it would run code of its own, which is refused)" if "auto_map" in config else ""
    raise ModelError(
        f"the model in {folder} is of the kind {kind!r}{own_code}; usable are BLIP and ViLT for "
        "question answering, OFA, and the image-text-to-text models of transformers, such as "
        "SmolVLM, Qwen-VL, Gemma 3 or InternVL"
    )


def missing_weights(folder: Path) -> list[str]:
    """Files of weights that should be there and are not; empty for a complete folder.

    Raises:
        ModelError: if the index is damaged, or names files elsewhere.
    """
    return [name for name in weight_files(folder) if not (folder / name).is_file()]


def weight_files(folder: Path) -> list[str]:
    """Files that hold the weights, there or not, sorted.

    Raises:
        ModelError: if the index is damaged, or names files elsewhere.
    """
    if (folder / _WEIGHTS).is_file():
        return [_WEIGHTS]
    if not (folder / _INDEX).is_file():
        return [_WEIGHTS]
    shards = read_config(folder, _INDEX).get("weight_map")
    if not isinstance(shards, dict):
        raise ModelError(f"{folder / _INDEX} is damaged; download or copy it again")
    names = sorted({str(name) for name in shards.values()})
    for name in names:
        # Elsewhere no digest would see it; of another kind it might hold more than numbers.
        if not _SHARD.fullmatch(name):
            raise ModelError(
                f"{folder / _INDEX} names {name[:200]!r}; weights are files of the same folder "
                "that end in .safetensors: download or copy the model again"
            )
    return [_INDEX, *names]


def _chat_kinds() -> set[str]:
    from transformers.models.auto.modeling_auto import MODEL_FOR_IMAGE_TEXT_TO_TEXT_MAPPING_NAMES

    return set(MODEL_FOR_IMAGE_TEXT_TO_TEXT_MAPPING_NAMES)
