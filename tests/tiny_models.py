"""Tiny model folders with random weights, each made once a test session."""

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from weakref import finalize

__all__ = ["tiny_folder"]


@cache
def tiny_folder(family: str, seed: int = 0) -> Path:
    """The folder of a tiny "blip", "vilt" or "idefics3"; do not write into it.

    It goes away with the process.
    """
    return _builder(family)(_home() / f"{family}_{seed}", seed=seed)


@cache
def _home() -> Path:
    home = mkdtemp(prefix="tiny_models_")
    finalize(tiny_folder, rmtree, home, ignore_errors=True)
    return Path(home)


def _builder(family: str) -> Callable[..., Path]:
    root = str(Path(__file__).parents[1])
    if root not in sys.path:
        sys.path.append(root)
    from benchmarks import model_folders

    return getattr(model_folders, f"build_{family}")
