"""The kinds of vote: each is registered here by one line."""

from enum import StrEnum
from typing import Self

from vqa_state.votes.rules import paper, threshold, weighted_answers, weighted_p_yes
from vqa_state.votes.rules._base import VoteRule

__all__ = ["VoteKind"]


class VoteKind(StrEnum):
    """How a vote counts, the simplest first; a member's value is its name in files and options.

    Attributes:
        rule: the definition behind the name.
    """

    rule: VoteRule

    def __new__(cls, rule: VoteRule) -> Self:
        """Make a member of what its file defines."""
        member = str.__new__(cls, rule.name)
        member._value_, member.rule = rule.name, rule
        return member

    PAPER = paper.PaperVote()
    THRESHOLD = threshold.ThresholdVote()
    WEIGHTED_ANSWERS = weighted_answers.WeightedAnswersVote()
    WEIGHTED_P_YES = weighted_p_yes.WeightedPYesVote()

    @property
    def weighted(self) -> bool:
        """Whether Invalid answers count half, and questions may have weights of their own."""
        return self.rule.weighted

    @property
    def by_p_yes(self) -> bool:
        """Whether the model's own probabilities are counted instead of its answers."""
        return self.rule.by_p_yes
