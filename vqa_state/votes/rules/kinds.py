"""The kinds of vote; each is registered by one line, which names the file that defines `RULE`."""

from enum import StrEnum
from importlib import import_module
from typing import Self

from vqa_state.votes.rules._base import VoteRule

__all__ = ["VoteKind"]


def _defined_in(file: str) -> VoteRule:
    found: VoteRule = import_module(f"{__package__}.{file}").RULE
    return found


class VoteKind(StrEnum):
    """How a vote counts, the simplest first; a member's value is its name in files and options.

    Attributes:
        rule: the definition behind the name.
    """

    def __new__(cls, file: str) -> Self:
        """Make a member of what a file of this package defines."""
        member = str.__new__(cls, _defined_in(file).name)
        member._value_ = _defined_in(file).name
        return member

    def __init__(self, file: str) -> None:
        self.rule = _defined_in(file)

    PAPER = "paper"
    THRESHOLD = "threshold"
    WEIGHTED_ANSWERS = "weighted_answers"
    WEIGHTED_P_YES = "weighted_p_yes"

    @property
    def weighted(self) -> bool:
        """Whether Invalid answers count half, and questions may have weights of their own."""
        return self.rule.weighted

    @property
    def by_p_yes(self) -> bool:
        """Whether the model's own probabilities are counted instead of its answers."""
        return self.rule.by_p_yes
