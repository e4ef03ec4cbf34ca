"""The training command's log: what was trained, every few steps, and how long each part took."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

__all__ = ["TrainingLog"]


@dataclass(frozen=True, slots=True)
class TrainingLog:
    """Lines of JSON in a file that later runs add to."""

    path: Path

    def write(self, row: dict[str, object]) -> None:
        """Add one line."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")

    @contextmanager
    def timed(self, part: str) -> Iterator[None]:
        """Write how many seconds of wall time a part took, also if it is stopped."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.write({"part": part, "seconds": round(time.perf_counter() - start, 1)})

    def seconds(self, part: str) -> float:
        """Seconds that a part took in all runs together."""
        if not self.path.exists():
            return 0.0
        rows = [json.loads(line) for line in self.path.read_text("utf-8").splitlines()]
        return float(sum(row["seconds"] for row in rows if row.get("part") == part))
