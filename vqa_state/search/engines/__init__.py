"""Engines: how a subset is looked for, one file each, registered in `Engine`.

A new one is a file with an `EngineKind` and one line below; app, command line and contract tests
then offer it.
"""

from enum import StrEnum
from typing import Self

from vqa_state.search.engines import paper, restarts
from vqa_state.search.engines._base import EngineKind, EngineSearch

__all__ = ["Engine", "EngineKind", "EngineSearch"]


class Engine(StrEnum):
    """How to look for a subset; a member's value is its name in files and options.

    Attributes:
        kind: the engine behind the name.
    """

    kind: EngineKind

    def __new__(cls, kind: EngineKind) -> Self:
        """Make a member of what its file defines."""
        member = str.__new__(cls, kind.name)
        member._value_, member.kind = kind.name, kind
        return member

    PAPER = paper.ENGINE
    DEFAULT = restarts.ENGINE
