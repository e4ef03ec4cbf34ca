"""A classic VQA network and its processor from a folder; what goes wrong there, in plain words."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vqa_state.errors import ModelError
from vqa_state.models.base import Failure
from vqa_state.models.runtime import Runtime

__all__ = ["Parts", "failure_of", "first_line", "load_parts"]

_TOKENIZER_FILES = ("tokenizer.json", "vocab.txt")


@dataclass(frozen=True, slots=True)
class Parts:
    """A network of transformers, ready on its device, and what prepares its input."""

    model: Any
    images: Any
    tokenizer: Any


def load_parts(folder: Path, architecture: str, runtime: Runtime) -> Parts:
    """Read a model from a folder; nothing is downloaded and no code of the folder runs.

    Images are prepared with Pillow even where torchvision is installed: it resizes otherwise, and
    the same image would get other answers on another machine.

    Args:
        folder: that holds config.json, safetensors and the processor's files.
        architecture: the class in transformers.
        runtime: what it shall run on.

    Raises:
        ModelError: if a file is missing or damaged.
    """
    import transformers
    from safetensors import SafetensorError

    if not any((folder / name).is_file() for name in _TOKENIZER_FILES):
        raise ModelError(
            f"the model in {folder} has no tokenizer; copy the file {_TOKENIZER_FILES[0]}, too"
        )
    local: dict[str, Any] = {"local_files_only": True}
    processors: Any = transformers.AutoImageProcessor
    try:
        tokenizer = transformers.AutoTokenizer.from_pretrained(folder, **local)
        images = processors.from_pretrained(folder, backend="pil", **local)
        model, report = getattr(transformers, architecture).from_pretrained(
            folder, use_safetensors=True, dtype=runtime.dtype, output_loading_info=True, **local
        )
    except (
        *(OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError),
        SafetensorError,
    ) as error:
        raise ModelError(
            f"the model in {folder} cannot be loaded ({first_line(error)}); download or copy it "
            "again, with all its files"
        ) from error
    if lacking := sorted(report["missing_keys"]):
        # They would be random numbers, of which transformers only warns.
        raise ModelError(
            f"the model in {folder} lacks {len(lacking)} weights, for example {lacking[0]}; "
            "download or copy it again, with all its files"
        )
    return Parts(model.to(str(runtime.device)).eval(), images, tokenizer)


def failure_of(error: RuntimeError) -> Failure:
    """Why a network that was loaded could not answer about one image."""
    import torch

    if isinstance(error, torch.OutOfMemoryError):
        return Failure(
            "the device has no memory left for this image; end other programs that use it, or "
            "choose the device cpu"
        )
    return Failure(f"the model failed at this image ({first_line(error)})")


def first_line(error: Exception) -> str:
    """What an error says, without its pages of detail."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0][:200] if lines else type(error).__name__
