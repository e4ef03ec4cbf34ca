"""How many calls are open at a server at once: measured on the first ones, not a constant.

It doubles as long as answers then come faster, stays where they no longer do, and is halved when
the server says that it has too many requests.
"""

__all__ = ["Pace"]

#: Twice the calls must bring at least so much more answers a second to be worth it.
_GAIN = 1.15

#: A size is judged by so many answers a call that it keeps open; fewer are chance.
_ROUNDS = 3

#: After so many answers without a complaint, one more call is tried again.
_CALM = 60


class Pace:
    """Learns `size` from when answers come; times are seconds on one clock.

    Attributes:
        size: calls to keep open at once, 1 to `largest`.
    """

    def __init__(self, largest: int) -> None:
        self.size = 1
        self._largest = largest
        self._is_measuring = largest > 1
        self._best: tuple[float, int] | None = None
        self._since: float | None = None
        self._n = 0
        self._shrunk_at = float("-inf")

    def answered(self, now: float) -> None:
        """An answer came at `now`."""
        if self._since is None:  # the first answer pays for loading and connecting
            self._since = now
            return
        self._n += 1
        if self._is_measuring and self._n >= _ROUNDS * self.size:
            self._judge(self._n / max(now - self._since, 1e-9))
            self._since, self._n = now, 0
        elif not self._is_measuring and self._n >= _CALM and self.size < self._largest:
            if self._shrunk_at > float("-inf"):
                self.size += 1
            self._n = 0

    def pause(self) -> None:
        """Time now passes that says nothing about the server: nothing is open."""
        self._since, self._n = None, 0

    def refused(self, began: float, now: float) -> None:
        """A call that began at `began` was one too many.

        Calls that were already open when the size last shrank say nothing about the new size.
        """
        if began < self._shrunk_at:
            return
        self.size = max(1, self.size // 2)
        self._is_measuring, self._shrunk_at, self._n = False, now, 0

    def _judge(self, answers_a_second: float) -> None:
        if self._best is not None and answers_a_second < self._best[0] * _GAIN:
            self.size, self._is_measuring = self._best[1], False
            return
        self._best = (answers_a_second, self.size)
        self.size = min(2 * self.size, self._largest)
        self._is_measuring = self.size > self._best[1]
