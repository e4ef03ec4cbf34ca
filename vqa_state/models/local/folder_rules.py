"""What a model's folder must not ask for: code, other models, other files, a network.

A folder may come from anybody. Its JSON files are read by transformers, which takes wishes from
them: to fetch native code from the hub, to load a second model, to read files elsewhere.
"""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

from vqa_state.errors import ModelError
from vqa_state.models.local.families import read_config

__all__ = ["NATIVE_CODE", "check_folder", "settle", "without_network"]

#: Kinds of networks and processors whose own code in transformers fetches something when it runs.
NATIVE_CODE = frozenset({"mra", "pix2struct", "rwkv", "sam3_video", "yoso"})

#: Ways to store weights whose code is in a package of pip. The others fetch it from the hub.
_QUANTIZED = frozenset(
    {
        *("auto-round", "awq", "bitnet", "bitsandbytes", "compressed-tensors", "gptq", "hqq"),
        *("quanto", "torchao"),
    }
)

#: Files beside the weights that would bring a second model, or other weights.
_FILES = {
    "adapter_config.json": "an adapter; merge it into the weights first",
    "audio_tokenizer_config.json": "a model for sound, which is not used here; remove it",
}
_SHARD_OF_TRAINING = re.compile(r"shard-\d{5}-model-\d{5}-of-\d{5}\.safetensors")

#: Entries that name other files or models.
_NAMES = ("audio_tokenizer", "configuration_files", "gguf_file", "transformers_weights")

_JSON = (
    "config.json",
    "processor_config.json",
    "preprocessor_config.json",
    "tokenizer_config.json",
    "video_preprocessor_config.json",
)

_ATTENTION = (None, "eager", "sdpa")

_offline = Lock()
_n_offline: list[bool] = []


def check_folder(folder: Path) -> None:
    """Refuse what transformers would take as a wish for code, models or files from elsewhere.

    Raises:
        ModelError: if the folder asks for such a thing, or a JSON file of it is damaged.
    """
    for file, what in _FILES.items():
        if (folder / file).is_file():
            raise ModelError(f"{folder} holds {what} ({file})")
    if any(_SHARD_OF_TRAINING.fullmatch(path.name) for path in folder.iterdir()):
        raise ModelError(f"{folder} holds parts of a training run; save the model as one first")
    for file in _JSON:
        if (folder / file).is_file():
            for key, value in _entries(read_config(folder, file)):
                if wish := _wish(key, value):
                    raise ModelError(
                        f"{folder / file} asks for {wish}, which is refused ({key}: "
                        f"{json.dumps(value)[:100]}); remove that entry, or use another model"
                    )


def settle(config: Any) -> None:
    """Have every part of the network calculate with torch alone, without code of a repository."""
    if config._attn_implementation not in _ATTENTION:
        config._attn_implementation = None
    if config._experts_implementation != "eager":
        config._experts_implementation = None
    vars(config).pop("auto_map", None)
    for name in config.sub_configs:
        part = getattr(config, name, None)
        if part is not None:
            settle(part)


@contextmanager
def without_network() -> Iterator[None]:
    """Keep this process from the hub meanwhile; downloads run in a process of their own.

    Some processors fetch words or fonts when they are made, whatever `local_files_only` says.
    """
    from huggingface_hub import constants

    with _offline:
        _n_offline.append(constants.HF_HUB_OFFLINE)
        constants.HF_HUB_OFFLINE = True
    try:
        yield
    finally:
        with _offline:
            before = _n_offline.pop()
            if not _n_offline:
                constants.HF_HUB_OFFLINE = before


def _entries(content: Any) -> Iterator[tuple[str, Any]]:
    """Keys and values at any depth."""
    waiting = [content]
    while waiting:
        one = waiting.pop()
        if isinstance(one, dict):
            yield from one.items()
            waiting.extend(one.values())
        elif isinstance(one, list):
            waiting.extend(one)


def _wish(key: str, value: Any) -> str:
    """What an entry asks for that it must not, or ""."""
    if key.strip("_").startswith(("attn_implementation", "experts_implementation")):
        return "code from the hub" if "/" in json.dumps(value) else ""
    if key in _NAMES:
        return "other files or models" if value is not None else ""
    if key == "fast_tokenizer_files":
        return "files elsewhere" if re.search(r"[/\\]", json.dumps(value)) else ""
    if key == "quantization_config" and isinstance(value, dict):
        return _quantized(value)
    if key in ("model_type", "image_processor_type", "feature_extractor_type", "processor_class"):
        plain = str(value).lower().replace("_", "")
        kinds = [kind.replace("_", "") for kind in NATIVE_CODE]
        return "what only the hub has" if plain.startswith(tuple(kinds)) else ""
    return ""


def _quantized(settings: dict[str, Any]) -> str:
    if settings.get("load_in_8bit") or settings.get("load_in_4bit"):
        return ""
    return "" if settings.get("quant_method") in _QUANTIZED else "code from the hub"
