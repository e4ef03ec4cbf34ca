"""Which family a folder of weights belongs to, from its config.json alone; no code of it runs."""

import json
from enum import StrEnum
from pathlib import Path
from typing import Any

from vqa_state.errors import ModelError

__all__ = ["Family", "family_of", "missing_weights", "read_config"]

_MAX_CONFIG_BYTES = 10_000_000

_INDEX = "model.safetensors.index.json"


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
    """Files of weights that should be there and are not; empty for a complete folder."""
    if (folder / "model.safetensors").is_file():
        return []
    if not (folder / _INDEX).is_file():
        return ["model.safetensors"]
    shards = read_config(folder, _INDEX).get("weight_map")
    if not isinstance(shards, dict):
        return [_INDEX]
    names = sorted({str(name) for name in shards.values()})
    return [name for name in names if not (folder / name).is_file()]


def _chat_kinds() -> set[str]:
    from transformers.models.auto.modeling_auto import MODEL_FOR_IMAGE_TEXT_TO_TEXT_MAPPING_NAMES

    return set(MODEL_FOR_IMAGE_TEXT_TO_TEXT_MAPPING_NAMES)
