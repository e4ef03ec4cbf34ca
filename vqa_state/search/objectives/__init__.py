"""Objectives: what a search maximizes, one file each, registered in `Objective`.

A new one is a file with an `ObjectiveKind` and one line below; app, command line, searches, proofs
and contract tests then offer it.

Source: paper II-B, equations of E+, E'+, E- and E'-.
"""

from enum import StrEnum
from typing import Self

from vqa_state.search.objectives import s_minus, s_plus, s_prime_minus, s_prime_plus
from vqa_state.search.objectives._base import PAPER_WEIGHTS, ObjectiveKind, ObjectiveWeights

__all__ = ["PAPER_WEIGHTS", "Objective", "ObjectiveKind", "ObjectiveWeights"]


class Objective(StrEnum):
    """What a search maximizes; a member's value is its name in files and options.

    Attributes:
        kind: the definition behind the name.
    """

    kind: ObjectiveKind

    def __new__(cls, kind: ObjectiveKind) -> Self:
        """Make a member of what its file defines."""
        member = str.__new__(cls, kind.name)
        member._value_, member.kind = kind.name, kind
        return member

    S_PLUS = s_plus.OBJECTIVE
    S_PRIME_PLUS = s_prime_plus.OBJECTIVE
    S_MINUS = s_minus.OBJECTIVE
    S_PRIME_MINUS = s_prime_minus.OBJECTIVE
