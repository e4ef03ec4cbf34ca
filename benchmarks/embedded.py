"""What the embedded model costs: `python -m benchmarks.embedded`.

Start-up and memory are measured in fresh processes, on top of what importing torch costs alone.
Asking all questions of a picture at once is compared with asking one question at a time, the two
in turn, so that a busy machine slows both; look at the ratio more than at the seconds.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from vqa_state.embedded_training.experiments import questions_about
from vqa_state.models.embedded.model import EmbeddedModel

__all__ = ["main"]

#: Runs in a process of its own; prints seconds to import and load, and peak memory in MB.
_LOAD = """
import resource, time
import torch
start = time.perf_counter()
from vqa_state.models.embedded.model import EmbeddedModel
model = EmbeddedModel()
loaded = time.perf_counter() - start
import numpy as np
from PIL import Image
rng = np.random.default_rng(0)
images = [Image.fromarray(rng.integers(0, 256, (480, 640, 3), np.uint8)) for _ in range(24)]
questions = [f"Is the door number {number} open?" for number in range(64)]
sum(1 for _ in model.answer(images, questions))
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(loaded, peak)
"""

_N_COPIES = 120


def start_up(n_runs: int) -> dict[str, float]:
    """Seconds to import and load after torch, and peak resident megabytes while answering."""
    runs = []
    for _ in range(n_runs):
        done = subprocess.run(  # noqa: S603  # our own text, our own interpreter
            [sys.executable, "-c", _LOAD], capture_output=True, text=True, check=True
        )
        runs.append([float(word) for word in done.stdout.split()])
    seconds, megabytes = zip(*runs, strict=True)
    return {"load_seconds": statistics.median(seconds), "peak_mb": max(megabytes)}


def pictures(n: int, seed: int) -> list[Image.Image]:
    """Noise: the network does the same work on it as on a photo."""
    rng = np.random.default_rng(seed)
    return [Image.fromarray(rng.integers(0, 256, (256, 256, 3), np.uint8)) for _ in range(n)]


def timed(work: Callable[[], object]) -> float:
    """Seconds that it takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def one_at_a_time(
    model: EmbeddedModel, images: Sequence[Image.Image], questions: Sequence[str]
) -> int:
    """Each question in a call of its own: the image is encoded for every one."""
    return sum(
        1 for image in images for question in questions for _ in model.answer([image], [question])
    )


def together(model: EmbeddedModel, images: Sequence[Image.Image], questions: Sequence[str]) -> int:
    """All questions about a picture in one call."""
    return sum(1 for _ in model.answer(images, questions))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the costs; with --json write them, too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.embedded", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="fewer runs")
    chosen = parser.parse_args(arguments)
    n_runs, n_compared = (1, 2) if chosen.quick else (5, 4)
    found: dict[str, float] = start_up(n_runs)
    model = EmbeddedModel()
    questions = [question.text for question in questions_about("cabinet")]
    together(model, pictures(8, 0), questions)  # the first call is slower
    images = pictures(_N_COPIES, 1)
    found["seconds_120x64"] = statistics.median(
        timed(lambda: together(model, images, questions)) for _ in range(n_runs)
    )
    few = images[:n_compared]
    alone, at_once = [], []
    for _ in range(n_runs):
        alone.append(timed(lambda: one_at_a_time(model, few, questions)))
        at_once.append(timed(lambda: together(model, few, questions)))
    found["one_at_a_time_seconds"] = statistics.median(alone)
    found["together_seconds"] = statistics.median(at_once)
    found["ratio"] = found["one_at_a_time_seconds"] / found["together_seconds"]
    single = [timed(lambda: together(model, images[:24], questions[:1])) for _ in range(n_runs)]
    full = [timed(lambda: together(model, images[:24], questions)) for _ in range(n_runs)]
    found["64_questions_against_1"] = statistics.median(full) / statistics.median(single)
    found = {name: round(value, 3) for name, value in found.items()}
    print(f"import and load, after torch   {found['load_seconds']:8.2f} s")
    print(f"peak resident memory           {found['peak_mb']:8.0f} MB")
    print(f"{_N_COPIES} copies x 64 questions       {found['seconds_120x64']:8.2f} s")
    print(f"{n_compared} pictures, one question a call {found['one_at_a_time_seconds']:6.2f} s")
    print(f"{n_compared} pictures, all at once         {found['together_seconds']:6.2f} s")
    print(f"ratio                          {found['ratio']:8.1f}")
    print(f"64 questions cost as much as   {found['64_questions_against_1']:8.2f} times one")
    if chosen.json is not None:
        chosen.json.write_text(json.dumps(found, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
