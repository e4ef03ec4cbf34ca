"""Objectives: what a search maximizes, one file each, registered in `Objective`.

A new one is a file that defines `OBJECTIVE`, and one line below that names the file; app,
command line, searches, proofs and contract tests then offer it.

Source: paper II-B, equations of E+, E'+, E- and E'-.
"""

from enum import StrEnum
from importlib import import_module
from typing import Self

from vqa_state.search.objectives._base import PAPER_WEIGHTS, ObjectiveKind, ObjectiveWeights

__all__ = ["PAPER_WEIGHTS", "Objective", "ObjectiveKind", "ObjectiveWeights"]


def _defined_in(file: str) -> ObjectiveKind:
    found: ObjectiveKind = import_module(f"{__name__}.{file}").OBJECTIVE
    return found


class Objective(StrEnum):
    """What a search maximizes; a member's value is its name in files and options.

    Attributes:
        kind: the definition behind the name.
    """

    def __new__(cls, file: str) -> Self:
        """Make a member of what a file of this package defines."""
        member = str.__new__(cls, _defined_in(file).name)
        member._value_ = _defined_in(file).name
        return member

    def __init__(self, file: str) -> None:
        self.kind = _defined_in(file)

    S_PLUS = "s_plus"
    S_PRIME_PLUS = "s_prime_plus"
    S_MINUS = "s_minus"
    S_PRIME_MINUS = "s_prime_minus"
