"""A chat model and its processor from a folder; what goes wrong there, in words that help."""

from pathlib import Path
from typing import Any

from vqa_state.errors import ModelError
from vqa_state.models.import_faults import missing_package
from vqa_state.models.local.image_processors import use_pillow
from vqa_state.models.local.loading import LOCAL, load_network, loading
from vqa_state.models.local.runtime import Runtime

__all__ = ["load_chat", "missing_package"]


def load_chat(folder: Path, name: str, runtime: Runtime) -> tuple[Any, Any]:
    """The model, ready on its device, and its processor.

    Only safetensors are read, nothing is downloaded and no code of the folder runs.

    Raises:
        MissingPackageError: if it needs a package that is not installed.
        ModelError: if the folder is damaged or incomplete.
    """
    from transformers import AutoModelForImageTextToText, AutoProcessor

    processors: Any = AutoProcessor
    with loading(folder, name):
        processor = processors.from_pretrained(folder, **LOCAL)
        use_pillow(processor, folder)
        model, report = load_network(folder, AutoModelForImageTextToText, runtime)
    _check(folder, processor, report)
    _simplify(model, processor)
    return model.to(str(runtime.device)).eval(), processor


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
