"""`python -m vqa_state.embedded_training.render --out DIR`: render the scenes of one split."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.progress import track

from vqa_state.embedded_training.dataset import pending_jobs, render_jobs
from vqa_state.embedded_training.scenes import THINGS, Split

__all__ = ["main", "render_split"]


def render_split(
    folder: Path,
    split: Split,
    n_scenes: int,
    n_views: int,
    n_processes: int,
    things: Sequence[str] = THINGS,
) -> None:
    """Render what is missing, with a bar. Finished scenes are skipped, so a stop costs little."""
    jobs = pending_jobs(folder, split, n_scenes, n_views, things)
    done = render_jobs(jobs, n_processes)
    for _ in track(done, total=len(jobs), description=f"scenes ({split.value})"):
        pass


def main(arguments: Sequence[str] | None = None) -> None:
    """Render one split to `--out`/SPLIT/THING."""
    parser = argparse.ArgumentParser(
        prog="python -m vqa_state.embedded_training.render", description=__doc__
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--split", type=Split, choices=list(Split), default=Split.TRAIN)
    parser.add_argument("--scenes", type=int, default=170, help="scenes of each thing")
    parser.add_argument("--views", type=int, default=3, help="cameras for each scene")
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args(arguments)
    folder = chosen.out / chosen.split.value
    render_split(folder, chosen.split, chosen.scenes, chosen.views, chosen.processes)


if __name__ == "__main__":
    main()
