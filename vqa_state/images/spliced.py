"""A file put together from parts of another one, without a copy of them."""

import io
from collections.abc import Sequence
from itertools import accumulate
from typing import IO, cast

__all__ = ["spliced"]


def spliced(parts: Sequence[memoryview | bytes]) -> IO[bytes]:
    """A file that reads as these parts, one after the other."""
    return cast(IO[bytes], _Spliced(parts))


class _Spliced(io.RawIOBase):
    """Reads parts one after the other, for a decoder that shall not see what lies between them."""

    def __init__(self, parts: Sequence[memoryview | bytes]) -> None:
        super().__init__()
        self._parts = [memoryview(part) for part in parts]
        self._ends = list(accumulate(map(len, self._parts)))
        self._size = self._ends[-1] if self._ends else 0
        self._at = self._place = 0

    def readable(self) -> bool:
        """Always."""
        return True

    def seekable(self) -> bool:
        """Always."""
        return True

    def tell(self) -> int:
        """Bytes before the next one."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place, not before the start."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at, self._place = max(0, base + offset), 0
        return self._at

    def readinto(self, buffer: "memoryview[int]") -> int:  # type: ignore[override]
        """Fill the buffer as far as one part goes."""
        while self._place < len(self._parts) and self._ends[self._place] <= self._at:
            self._place += 1
        if self._place == len(self._parts):
            return 0
        part = self._parts[self._place]
        start = self._at - (self._ends[self._place] - len(part))
        taken = part[start : start + len(buffer)]
        buffer[: len(taken)] = taken
        self._at += len(taken)
        return len(taken)

    def read(self, size: int | None = -1) -> bytes:
        """As many bytes as are wanted, fewer only at the end."""
        left = max(0, self._size - self._at)
        wanted = left if size is None or size < 0 else min(size, left)
        if wanted == 0:
            return b""
        found = bytearray(wanted)
        view, done = memoryview(found), 0
        while done < wanted:
            done += self.readinto(view[done:])
        return bytes(found)
