"""How much memory the models of this process take."""

import sys
from dataclasses import dataclass

import psutil

__all__ = ["Memory"]


@dataclass(frozen=True, slots=True)
class Memory:
    """Megabytes that this process takes now, and the most that it took of a graphics card."""

    process: int
    gpu: int = 0

    @classmethod
    def now(cls) -> "Memory":
        """Measure; nothing is loaded for it."""
        return cls(psutil.Process().memory_info().rss // 1_000_000, _on_gpu() // 1_000_000)

    def __str__(self) -> str:
        gpu = f" and {self.gpu:,} MB of the graphics card" if self.gpu else ""
        return f"{self.process:,} MB of memory{gpu}"


def _on_gpu() -> int:
    """Bytes; 0 where torch was not needed or calculates on a processor."""
    torch = sys.modules.get("torch")
    if torch is None:
        return 0
    if torch.cuda.is_available() and torch.cuda.is_initialized():
        return int(torch.cuda.max_memory_reserved())
    if torch.backends.mps.is_available():
        return int(torch.mps.driver_allocated_memory())
    return 0
