"""What turns an image into numbers for a network: the same on every machine where that can be.

Many models have two: one with Pillow, one with torchvision. They resize otherwise, so that the
same image gets other numbers, and other answers. Which one transformers takes by itself depends
on whether torchvision is installed; here it is the one with Pillow wherever there is one.
"""

from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from vqa_state.models.local.folder_rules import check_folder, without_network

__all__ = ["image_class", "load_images", "use_pillow"]


def load_images(folder: Path) -> Any:
    """The image processor of a folder, with Pillow if it has one.

    Raises:
        ModelError: if the folder asks for something that is refused.
        Exception: of transformers, if a file is missing or damaged.
    """
    from transformers import AutoImageProcessor

    check_folder(folder)
    processors: Any = AutoImageProcessor
    with without_network():
        return processors.from_pretrained(
            folder, backend="pil", local_files_only=True, trust_remote_code=False
        )


def use_pillow(processor: Any, folder: Path) -> None:
    """Exchange the image processor of a whole processor, which cannot be asked for it."""
    images = getattr(processor, "image_processor", None)
    if images is not None and not _is_pillow(images):
        processor.image_processor = load_images(folder)


def image_class(folder: Path) -> str:
    """The class that prepares a folder's images; its package's version where that is torchvision.

    "none" for a folder that has no image processor.
    """
    try:
        images = load_images(folder)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return "none"  # whoever loads the model says what is missing
    name = type(images).__name__
    return name if _is_pillow(images) else f"{name}, torchvision {_torchvision()}"


def _is_pillow(images: Any) -> bool:
    return getattr(images, "backend", None) == "pil"


def _torchvision() -> str:
    try:
        return version("torchvision")
    except PackageNotFoundError:
        return "none"
