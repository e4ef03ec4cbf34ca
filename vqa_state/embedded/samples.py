"""`python -m vqa_state.embedded.samples --out DIR`: pictures for the sample projects."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from vqa_state.embedded.scenes import SceneRenderer, Split

__all__ = ["main", "write_samples"]

#: The things that the package ships a sample project of.
_SAMPLE_THINGS = ("refrigerator", "transparent_door")

_SIZE = 320
_QUALITY = 85


def write_samples(folder: Path, thing: str, n_images: int = 10) -> None:
    """Write `n_images` pictures a state for train and for test: FOLDER/{train,test}/STATE/NN.jpg.

    Every picture is of a scene of its own, so test pictures show nothing that train ones show.
    """
    with SceneRenderer(_SIZE) as renderer:
        for number in range(4 * n_images):
            is_open, use = number % 2 == 0, "train" if number < 2 * n_images else "test"
            positive, negative = renderer.render(thing, Split.SAMPLE, number)
            picture = positive if is_open else negative
            target = folder / use / ("open" if is_open else "closed")
            target.mkdir(parents=True, exist_ok=True)
            file = target / f"{number % (2 * n_images) // 2 + 1:02d}.jpg"
            picture.image.save(file, quality=_QUALITY, optimize=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the pictures of all sample projects."""
    parser = argparse.ArgumentParser(
        prog="python -m vqa_state.embedded.samples", description=__doc__
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    chosen = parser.parse_args(arguments)
    for thing in _SAMPLE_THINGS:
        write_samples(chosen.out / thing, thing)


if __name__ == "__main__":
    main()
