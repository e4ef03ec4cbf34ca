"""A chat model and its processor from a folder; what goes wrong there, in words that help."""

import re
from pathlib import Path
from typing import Any

from vqa_state.errors import MissingPackageError, ModelError
from vqa_state.models.runtime import Runtime

__all__ = ["load_chat", "missing_package"]

#: Libraries as transformers calls them in its errors -> what pip calls them.
_PACKAGES = {
    "Torchvision": "torchvision",
    "SentencePiece": "sentencepiece",
    "protobuf": "protobuf",
    "PyAv": "av",
    "timm": "timm",
    "PIL": "pillow",
}


def load_chat(folder: Path, name: str, runtime: Runtime) -> tuple[Any, Any]:
    """The model, ready on its device, and its processor.

    Only safetensors are read, nothing is downloaded and no code of the folder runs.

    Raises:
        MissingPackageError: if it needs a package that is not installed.
        ModelError: if the folder is damaged or incomplete.
    """
    from safetensors import SafetensorError
    from transformers import AutoModelForImageTextToText, AutoProcessor

    processors: Any = AutoProcessor
    models: Any = AutoModelForImageTextToText
    local: dict[str, Any] = {"local_files_only": True, "trust_remote_code": False}
    try:
        processor = processors.from_pretrained(folder, **local)
        model, report = models.from_pretrained(
            folder, use_safetensors=True, dtype=runtime.dtype, output_loading_info=True, **local
        )
    except ImportError as error:
        package = missing_package(str(error))
        if package is None:
            raise
        raise MissingPackageError(name, package) from error
    except (
        *(OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError),
        SafetensorError,
    ) as error:
        raise ModelError(
            f"the model in {folder} cannot be loaded ({_first_line(error)}); download or copy it "
            "again, with all its files"
        ) from error
    _check(folder, processor, report)
    _simplify(model, processor)
    return model.to(str(runtime.device)).eval(), processor


def missing_package(message: str) -> str | None:
    """The package that an ImportError of transformers asks for, as pip calls it."""
    if found := re.search(r"requires the (?:🤗 )?([\w-]+) library", message):
        return _PACKAGES.get(found[1], found[1].lower())
    if found := re.search(r"pip install (?:-U )?([A-Za-z][\w.-]*)", message):
        return found[1]
    if found := re.search(r"No module named '(\w+)", message):
        return found[1]
    return None


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0][:200] if lines else type(error).__name__


def _check(folder: Path, processor: Any, report: dict[str, Any]) -> None:
    # A missing weight would be random numbers, of which transformers only warns.
    if lacking := sorted(report["missing_keys"]):
        raise ModelError(
            f"the model in {folder} lacks {len(lacking)} weights, for example {lacking[0]}; "
            "download or copy it again, with all its files"
        )
    if not hasattr(processor, "tokenizer") or not hasattr(processor, "image_processor"):
        raise ModelError(
            f"the model in {folder} has no processor for images and text; copy the files "
            "preprocessor_config.json, processor_config.json and tokenizer.json, too"
        )


def _simplify(model: Any, processor: Any) -> None:
    """Settle what would make one way to generate unlike the other, or only make warnings."""
    config = model.generation_config
    config.cache_implementation = None  # a cache of fixed size cannot be handed on
    config.do_sample = False
    config.temperature = config.top_p = config.top_k = config.max_length = None
    if config.pad_token_id is None:
        config.pad_token_id = processor.tokenizer.pad_token_id
    if config.pad_token_id is None and config.eos_token_id is not None:
        ends = config.eos_token_id
        config.pad_token_id = ends[0] if isinstance(ends, list) else ends
