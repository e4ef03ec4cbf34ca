"""Engines: how a subset is looked for, one file each, registered in `Engine`.

A new one is a file that defines `ENGINE`, and one line below that names the file; app, command
line and contract tests then offer it.
"""

from enum import StrEnum
from importlib import import_module
from typing import Self

from vqa_state.search.engines._base import EngineKind, EngineSearch

__all__ = ["Engine", "EngineKind", "EngineSearch"]


def _defined_in(file: str) -> EngineKind:
    found: EngineKind = import_module(f"{__name__}.{file}").ENGINE
    return found


class Engine(StrEnum):
    """How to look for a subset; a member's value is its name in files and options.

    Attributes:
        kind: the engine behind the name.
    """

    def __new__(cls, file: str) -> Self:
        """Make a member of what a file of this package defines."""
        member = str.__new__(cls, _defined_in(file).name)
        member._value_ = _defined_in(file).name
        return member

    def __init__(self, file: str) -> None:
        self.kind = _defined_in(file)

    DEFAULT = "restarts"
    PAPER = "paper"
