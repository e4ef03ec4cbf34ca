"""Pictures that are odd, cut off or huge: `python -m benchmarks.hostile --seconds N`.

Half of the time goes to random odd files, each with an oracle; half to the largest pictures that
are read, each in a process of its own, whose peak of memory is measured. A row says what was
counted and its bound; the program ends with 1 if one does not hold.
"""

import argparse
import json
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.hostile_files import FAMILIES, Case, endless
from benchmarks.hostile_peaks import PEAKS, measure_peak
from vqa_state.errors import ImageError
from vqa_state.images import MAX_MEMORY, pixel_hash, read_picture

__all__ = ["Row", "main", "measure"]

_QUICK_SECONDS = 2.0
_SHOWN = 3


@dataclass(frozen=True, slots=True)
class Row:
    """One thing that was counted.

    Attributes:
        what: what was counted.
        value: how much.
        unit: of value and bound.
        bound: the most that is allowed; for files tried, the least.
        holds: whether it is kept.
    """

    what: str
    value: float
    unit: str
    bound: float
    holds: bool


class _Counts:
    """What became of the files of one family."""

    def __init__(self) -> None:
        self.n_files = 0
        self.faults: dict[str, list[str]] = {name: [] for name in _FAULTS}

    def add(self, case: Case) -> None:
        """Read one file and judge what comes of it."""
        self.n_files += 1
        fault = _fault(case)
        if fault is not None:
            self.faults[fault[0]].append(f"{case.what[:200]}: {fault[1]}")


_CRASH, _REFUSED, _WRONG, _REASON = (
    "crashes", "sound pictures refused", "wrong pixels", "refused for a wrong reason",
)  # fmt: skip
_FAULTS = (_CRASH, _REFUSED, _WRONG, _REASON)


def _fault(case: Case) -> tuple[str, str] | None:
    """Kind of fault and its words; None if all is as it must be."""
    expected = case.expected
    try:
        pixels = read_picture(case.data).pixels
    except ImageError as error:
        if not expected.reason:
            return _REFUSED, str(error)
        return None if expected.reason in str(error) else (_REASON, str(error))
    except Exception as error:  # noqa: BLE001  # what is looked for
        return _CRASH, repr(error)
    if expected.pixels is None or pixel_hash(pixels) != pixel_hash(expected.pixels):
        return _WRONG, f"{pixels.size}"
    return None


def measure(seconds: float, seed: int = 0, *, peaks: Sequence[str] = tuple(PEAKS)) -> Iterator[Row]:
    """Try odd files of every family in turn for half of the time, and large ones for the rest."""
    began = time.monotonic()
    counted = {name: _Counts() for name in FAMILIES}
    streams = {name: endless(family, seed) for name, family in FAMILIES.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the oracle's, of odd EXIF
        while time.monotonic() - began < seconds / 2:
            for name, stream in streams.items():
                counted[name].add(next(stream))
    for name, counts in counted.items():
        yield Row(f"{name}: files tried", counts.n_files, "files", 1, counts.n_files >= 1)
        for fault, found in counts.faults.items():
            for words in found[:_SHOWN]:
                print(f"{name}: {fault}: {words}", file=sys.stderr)
            yield Row(f"{name}: {fault}", len(found), "files", 0, not found)
    for number, name in enumerate(peaks):
        if number and time.monotonic() - began > seconds:
            return
        peak = measure_peak(name)
        yield Row(f"peak: {name}", round(peak / 1e6), "MB", MAX_MEMORY / 1e6, peak <= MAX_MEMORY)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the rows, write them as JSON if asked to; 1 if a bound is broken."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hostile", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="about how long")
    parser.add_argument("--seed", type=int, default=0, help="of the odd files")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows to FILE")
    parser.add_argument("--quick", action="store_true", help="two seconds and one large picture")
    options = parser.parse_args(arguments)
    seconds = _QUICK_SECONDS if options.quick else options.seconds
    rows = []
    for row in measure(seconds, options.seed):
        rows.append(row)
        mark = "holds" if row.holds else "BROKEN"
        print(f"{row.what:<64} {row.value:>10g} {row.unit:<5} of {row.bound:g}: {mark}", flush=True)
    if options.json:
        options.json.write_text(json.dumps([asdict(r) for r in rows], indent=1) + "\n", "utf-8")
    return 0 if all(row.holds for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
