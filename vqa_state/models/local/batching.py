"""How many images go through a model together: found by timing the first ones, not by a constant.

A processor gains nothing from it (each image keeps all cores busy), and one image at a time keeps
every digit of an answer the same; so it is tried on other devices only.
"""

from vqa_state.models.address import Device
from vqa_state.models.local.runtime import Runtime

__all__ = ["BatchSize"]

_LARGEST = 16

#: A larger batch must be at least so much faster an image to be worth its memory.
_GAIN = 1.1


class BatchSize:
    """Doubles as long as that makes an image cheaper, then stays.

    The caller asks for `size`, sends at most so many images through, and tells what it took.
    """

    def __init__(self, runtime: Runtime, largest: int = _LARGEST) -> None:
        self.size = 1
        self._largest = 1 if runtime.device is Device.CPU else largest
        self._is_warm = False
        self._best: tuple[float, int] | None = None

    def record(self, n_images: int, seconds: float) -> None:
        """Learn from one call; one with fewer images than `size` says nothing.

        Args:
            n_images: that went through together.
            seconds: that they took, the device's work included.
        """
        if self.size >= self._largest or n_images < self.size:
            return
        if not self._is_warm:
            self._is_warm = True  # the first call pays for compiling and copying
            return
        pace = seconds / n_images
        if self._best is None or pace * _GAIN < self._best[0]:
            self._best = (pace, self.size)
            self.size *= 2
        else:
            self.size = self._largest = self._best[1]

    def too_large(self) -> None:
        """The device had no memory for `size` images: go back to half of it, and stay there."""
        self.size = self._largest = max(1, self.size // 2)
