"""`python -m vqa_state.embedded_training.render --out DIR`: render the scenes of one split."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from vqa_state.embedded_training.dataset import render_split
from vqa_state.embedded_training.scenes import SceneSplit

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Render one split to `--out`/SPLIT/THING."""
    parser = argparse.ArgumentParser(
        prog="python -m vqa_state.embedded_training.render", description=__doc__
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument(
        "--split", type=SceneSplit, choices=list(SceneSplit), default=SceneSplit.TRAIN
    )
    parser.add_argument("--scenes", type=int, default=170, help="scenes of each thing")
    parser.add_argument("--views", type=int, default=3, help="cameras for each scene")
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args(arguments)
    folder = chosen.out / chosen.split.value
    render_split(folder, chosen.split, chosen.scenes, chosen.views, chosen.processes)


if __name__ == "__main__":
    main()
