"""What a recognizer says about one image."""

import math
from dataclasses import dataclass

from vqa_state.answers.answer import Answer
from vqa_state.votes.state import State

__all__ = ["Verdict", "Vote"]


@dataclass(frozen=True, slots=True)
class Vote:
    """One answer of the vote. `speaks_for` is +1, -1 or 0 for an invalid answer."""

    question: str
    copy: int
    answer: Answer
    speaks_for: int

    @property
    def cut_off(self) -> bool:
        """Whether it is invalid because the length limit ended it before yes or no."""
        return self.answer.cut_off


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a recognizer says about one image.

    Attributes:
        state: positive, negative or unknown.
        state_name: the user's word for it, or "unknown".
        reason: why, in one sentence.
        confidence: the winner's share of the vote in [0, 1], below one half where a low threshold
            lets few answers win; NaN without valid votes.
        n_positive: answers for the positive state.
        n_negative: answers for the negative state.
        n_invalid: answers for neither.
        n_calls: one question about one copy is one call.
        milliseconds: from the picture to the verdict.
        votes: all answers, by copy and question.
        n_skipped: calls that were saved because they could not change the verdict.
        sureness: of the vote, in [0, 1]; see `vqa_state.votes.reject_option`. After an early stop,
            the least that the answers not asked for could have left; the most, if the state is
            unknown.
        min_sureness: sureness that a verdict needs; below it, the state is unknown.
        n_copies: copies of the image.
        n_agreeing: copies whose own vote says what the whole vote says.
    """

    state: State
    state_name: str
    reason: str
    confidence: float
    n_positive: int
    n_negative: int
    n_invalid: int
    n_calls: int
    milliseconds: float
    votes: tuple[Vote, ...]
    n_skipped: int = 0
    sureness: float = math.nan
    min_sureness: float = 0.0
    n_copies: int = 0
    n_agreeing: int = 0

    @property
    def n_cut_off(self) -> int:
        """Of the invalid answers, those that the length limit ended before yes or no."""
        return sum(vote.cut_off for vote in self.votes)
