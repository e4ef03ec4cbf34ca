"""Whether a call that failed tells of its own question and image, or of the whole server.

One question can be forbidden, and one image can break a server that answers about all others; so
nothing is given up before other pairs, taken from elsewhere, failed too, and none was answered.
"""

from dataclasses import replace

from vqa_state.models.server.faults import Fault, Reach

__all__ = ["Doubt"]

#: So many pairs in a row, if nobody is there or the server says itself that none will be answered.
_FEW = 2

#: So many of any other kind: each may be refused for its own words.
_MANY = 16


class Doubt:
    """Counts what failed since the last answer; times are seconds on one clock.

    Attributes:
        n_failed: pairs in a row that failed as all others might.
        is_gone: at the last of them nobody was there, or nobody spoke.
        last_answer: when the last answer came.
    """

    def __init__(self) -> None:
        self.n_failed = 0
        self.is_gone = False
        self.last_answer = float("-inf")
        self._since = 0.0

    def answered(self, now: float) -> None:
        """An answer came: whatever failed before told of itself."""
        self.n_failed, self.is_gone, self.last_answer = 0, False, now

    def weigh(self, fault: Fault, began: float, now: float) -> Fault:
        """The fault of a pair asked at `began`, of `Reach.ALL` if no other will be answered.

        Pairs that were open already when the first one failed are no second opinion.
        """
        told = fault if fault.reach is not Reach.ALL else replace(fault, reach=Reach.ANSWER)
        if not self._may_be_all(fault, began) or (self.n_failed and began < self._since):
            return told
        if not self.n_failed:
            self._since = now
        self.n_failed += 1
        self.is_gone = fault.reach is Reach.GONE
        return replace(fault, reach=Reach.ALL) if self.n_failed >= self._enough(fault) else told

    def place(self, n_left: int) -> int:
        """Which of the pairs left to ask now: the first, or in doubt one from elsewhere.

        Multiples of the golden section spread evenly, however many there are.
        """
        return int(n_left * (self.n_failed * 0.6180339887 % 1.0))

    def _may_be_all(self, fault: Fault, began: float) -> bool:
        if fault.reach is Reach.ALL:
            return True
        if fault.reach is Reach.ANSWER:
            return self._never_answered
        return self.last_answer < began

    def _enough(self, fault: Fault) -> int:
        says_so = fault.reach is Reach.ALL and self._never_answered
        return _FEW if says_so or fault.reach is Reach.GONE else _MANY

    @property
    def _never_answered(self) -> bool:
        return self.last_answer == float("-inf")
