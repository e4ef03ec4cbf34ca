"""What a vote says about one image, and the sentence that says why.

The sentence names the state that wins, or leads unsurely, with its own share of the vote. So it
reads the same if the two states change places, with their answers and the threshold.
"""

import math
from dataclasses import dataclass
from typing import Final

from vqa_state.votes.state import State

__all__ = ["Judgement"]

_MOST_DIGITS: Final = 9
"""Of a percentage; shares that more digits would part are equal."""
_EXACT: Final = 12
"""Decimals of a share that count: 1 - share has none of a float's own beyond these."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a vote says about one image, and why.

    Attributes:
        state: positive, negative or unknown.
        leaning: what the vote says before the sureness is looked at; unknown only for a tie or
            without an answer that counts.
        share: of the weight that counts, for the positive state, in [0, 1]; NaN if nothing counts.
        invalid: share of the weight whose answers are invalid, in [0, 1].
        n_copies: copies of the image.
        n_agreeing: copies whose own vote says what `leaning` says.
        sureness: in [0, 1].
        min_sureness: what a verdict needs.
        threshold: share above which the positive state wins.
        by_majority: whether the most of the valid answers win, each counting one, as in the paper.
    """

    state: State
    leaning: State
    share: float
    invalid: float
    n_copies: int
    n_agreeing: int
    sureness: float
    min_sureness: float
    threshold: float = 0.5
    by_majority: bool = True

    @property
    def confidence(self) -> float:
        """The share of the state that wins, or leads unsurely; of a tie, the larger one.

        In [0, 1], below one half where a low threshold lets few answers win; NaN if nothing counts.
        """
        if self.leaning is State.UNKNOWN:
            return max(self.share, 1 - self.share)
        return self.share if self.leaning is State.POSITIVE else 1 - self.share

    def reason(self, positive: str, negative: str) -> str:
        """Why, in one sentence.

        Args:
            positive: the user's word for the positive state.
            negative: the user's word for the negative state.
        """
        if math.isnan(self.share):
            return "no answer was a clear yes or no"
        if self.leaning is State.UNKNOWN:
            return f"the vote is a tie: {self._tie(positive, negative)}"
        leader = positive if self.leaning is State.POSITIVE else negative
        if self.state is not State.UNKNOWN:
            return self._stand(leader)
        return (
            f"the vote is not sure enough ({self.sureness:.2f} of the {self.min_sureness:.2f} "
            f"that a verdict needs): {self._stand(leader)}{',' if self.by_majority else ';'} "
            f"{self.invalid:.0%} of all are invalid, "
            f"{self.n_agreeing} of {self.n_copies} copies agree"
        )

    def reason_so_far(self, positive: str, negative: str, n_open: int) -> str:
        """Why the answers that were not asked for cannot change the verdict.

        It is for a judgement in which these answers speak against the winner, so that its share is
        the least that the winner can have.

        Args:
            positive: the user's word for the positive state.
            negative: the user's word for the negative state.
            n_open: answers that were not asked for.
        """
        words = "answer that was" if n_open == 1 else "answers that were"
        rest = f"the {n_open} {words} not asked for cannot change it"
        if self.state is State.UNKNOWN:
            return f"the vote cannot become sure enough any more: {rest}"
        leader = positive if self.leaning is State.POSITIVE else negative
        return f"{self._stand(leader, at_least=True)}: {rest}"

    @property
    def _leader_share(self) -> float:
        return round(self.confidence, _EXACT)

    @property
    def _leader_needs(self) -> float:
        """The share above which the state wins that has the larger lead."""
        needs = 1 - self.threshold if self.leaning is State.NEGATIVE else self.threshold
        return round(needs, _EXACT)

    def _stand(self, leader: str, *, at_least: bool = False) -> str:
        """The share of the state that leads, and what it needs if that is not the majority.

        With weights or another threshold, that is no share of answers.
        """
        share, needs = self._leader_share, self._leader_needs
        digits = _digits(share, needs, down=at_least)
        shown = _percent(share, digits, down=at_least)
        if self.by_majority:
            return f"{'at least ' if at_least else ''}{shown} of the valid votes speak for {leader}"
        stand = f"the vote stands at {shown}{' or more' if at_least else ''} for {leader}"
        wins = f"{'leads' if self.state is State.UNKNOWN else 'wins'} above {needs:.{digits}%}"
        if share < 0.5 and not at_least:
            return f"{stand}, less than half, but {leader} {wins}"
        return f"{stand}, which {wins}"

    def _tie(self, positive: str, negative: str) -> str:
        """Both states, for neither wins."""
        share, other = round(self.share, _EXACT), round(1 - self.share, _EXACT)
        digits = _digits(share, 0.5)
        if self.by_majority:
            return (
                f"{share:.0%} of the valid votes speak for {positive}, {other:.0%} for {negative}"
            )
        return (
            f"it stands at {share:.{digits}%} for {positive} and {other:.{digits}%} for "
            f"{negative}, and each wins only above that"
        )


def _digits(share: float, needs: float, *, down: bool = False) -> int:
    """The fewest that part a share from what it needs, and from 0, 50 and 100 %, if it is none."""
    others = [limit for limit in (needs, 0.0, 0.5, 1.0) if limit != share]
    shown = (
        digits
        for digits in range(_MOST_DIGITS)
        if _percent(share, digits, down=down) not in [f"{limit:.{digits}%}" for limit in others]
    )
    return next(shown, _MOST_DIGITS)


def _percent(share: float, digits: int, *, down: bool = False) -> str:
    """A share in percent, rounded to the nearest, or down where it is the least."""
    if down:
        steps = 10 ** (digits + 2)
        share = math.floor(round(share * steps, _EXACT - digits - 2)) / steps
    return f"{share:.{digits}%}"
