"""Engines: how a subset is looked for, one file each, registered in `Engine`.

A new one is a file that defines `ENGINE`, and one line below that names the file; app, command
line and contract tests then offer it.
"""

from enum import StrEnum
from importlib import import_module
from typing import Self

from vqa_state.search.engines._base import EngineKind, EngineSearch

__all__ = ["Engine", "EngineKind", "EngineSearch"]


class Engine(StrEnum):
    """How to look for a subset; a member's value is its name in files and options.

    Attributes:
        kind: the engine behind the name.
    """

    kind: EngineKind

    def __new__(cls, file: str) -> Self:
        """Make a member of what a file of this package defines."""
        kind: EngineKind = import_module(f"{__name__}.{file}").ENGINE
        member = str.__new__(cls, kind.name)
        member._value_, member.kind = kind.name, kind
        return member

    DEFAULT = "restarts"
    PAPER = "paper"
