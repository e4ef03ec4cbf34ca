"""A classic VQA network and its processor from a folder; what goes wrong there, in plain words."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vqa_state.errors import ModelError
from vqa_state.models._base import Failure
from vqa_state.models.import_faults import import_fault, misfit
from vqa_state.models.local.folder_rules import check_folder, settle, without_network
from vqa_state.models.local.image_processors import load_images
from vqa_state.models.local.runtime import Runtime

__all__ = [
    "LOCAL",
    "Parts",
    "failure_of",
    "first_line",
    "load_network",
    "load_parts",
    "loading",
]

#: For everything that transformers reads: nothing is downloaded and no code of the folder runs.
LOCAL: dict[str, Any] = {"local_files_only": True, "trust_remote_code": False}

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

    if not any((folder / name).is_file() for name in _TOKENIZER_FILES):
        raise ModelError(
            f"the model in {folder} has no tokenizer; copy the file {_TOKENIZER_FILES[0]}, too"
        )
    with loading(folder, str(folder)):
        tokenizer = transformers.AutoTokenizer.from_pretrained(folder, **LOCAL)
        images = load_images(folder)
        model, report = load_network(folder, getattr(transformers, architecture), runtime)
    if lacking := sorted(report["missing_keys"]):
        # They would be random numbers, of which transformers only warns.
        raise ModelError(
            f"the model in {folder} lacks {len(lacking)} weights, for example {lacking[0]}; "
            "download or copy it again, with all its files"
        )
    return Parts(model.to(str(runtime.device)).eval(), images, tokenizer)


@contextmanager
def loading(folder: Path, name: str) -> Iterator[None]:
    """Read a folder; whatever the libraries raise for one that is damaged becomes our error.

    Raises:
        MissingPackageError: if a package is needed that is not installed.
        ModelError: if the folder is damaged, or asks for something that is refused.
    """
    try:
        check_folder(folder)
        with without_network():
            yield
    except ModelError:
        raise
    except ImportError as error:
        fault = import_fault(name, error)
        if fault is None:
            raise
        raise fault from error
    except Exception as error:  # a damaged or hostile folder makes them raise nearly anything
        help_with = "download or copy it again, with all its files"
        if type(error).__name__ in ("OutOfMemoryError", "MemoryError"):
            help_with = "it needs more memory than is free: take a smaller one or half precision"
        raise misfit(name, error) or ModelError(
            f"the model in {folder} cannot be loaded ({first_line(error)}); {help_with}"
        ) from error


def load_network(folder: Path, kind: Any, runtime: Runtime) -> tuple[Any, dict[str, Any]]:
    """A network of a class of transformers, and its report of what was read."""
    from transformers import AutoConfig

    config = AutoConfig.from_pretrained(folder, **LOCAL)
    settle(config)
    model, report = kind.from_pretrained(
        folder,
        config=config,
        use_safetensors=True,
        dtype=runtime.dtype,
        output_loading_info=True,
        **LOCAL,
    )
    return model, report


def failure_of(error: Exception) -> Failure:
    """Why a network that was loaded could not answer about one image."""
    import torch

    if isinstance(error, torch.OutOfMemoryError | MemoryError):
        return Failure(
            "the device has no memory left for this image; make the image smaller, end other "
            "programs that use it, or choose the device cpu"
        )
    return Failure(f"the model failed at this image ({first_line(error)})")


def first_line(error: Exception) -> str:
    """What an error says, without its pages of detail."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0][:200] if lines else type(error).__name__
