"""`python -m vqa_state.embedded_training.render --out DIR`: render the scenes of one split."""

from collections.abc import Sequence

from vqa_state.embedded_training.dataset import render_split
from vqa_state.embedded_training.options import parser_of
from vqa_state.embedded_training.scenes import SceneSplit

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Render one split to `--out`/SPLIT/THING."""
    parser = parser_of("render", __doc__, out=None, scenes=(170, "scenes of each thing"), views=3)
    parser.add_argument(
        "--split", type=SceneSplit, choices=list(SceneSplit), default=SceneSplit.TRAIN
    )
    chosen = parser.parse_args(arguments)
    folder = chosen.out / chosen.split.value
    render_split(folder, chosen.split, chosen.scenes, chosen.views, chosen.processes)


if __name__ == "__main__":
    main()
