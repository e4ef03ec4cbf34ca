"""Tiny model folders with random weights, each made once a test session."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks import model_folders

__all__ = ["tiny_folder"]

_HERE = TemporaryDirectory(prefix="tiny_models_")


@cache
def tiny_folder(family: str, seed: int = 0) -> Path:
    """The folder of a tiny "blip", "vilt" or "idefics3"; do not write into it.

    It goes away with the process.
    """
    build: Callable[..., Path] = getattr(model_folders, f"build_{family}")
    return build(Path(_HERE.name) / f"{family}_{seed}", seed=seed)
