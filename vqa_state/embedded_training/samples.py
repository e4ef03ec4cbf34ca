"""`python -m vqa_state.embedded_training.samples --out projects`: the eleven sample projects.

With `--probes DIR` it writes the pictures that a new model is shown
(`vqa_state/models/vision_check.py`).
"""

import argparse
import io
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.progress import track

from vqa_state.embedded_training.experiments import grid_about, states_of
from vqa_state.embedded_training.scenes import PAPER_THINGS, SceneRenderer, SceneSplit
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.questions.states import StateNames

__all__ = ["main", "write_probes", "write_project"]

#: The experiments of the paper whose pictures make up that on various doors.
_DOORS = ("door", "elevator", "cabinet", "refrigerator")
_VARIOUS = "various_doors"

#: Scenes of no project whose states a person tells apart at a glance.
_PROBES = {"light": 203, "door": 201, "display": 207}

_N_PER_STATE = 10
_SIZE = 256
_QUALITY = 82

#: (name, bytes of a JPEG, whether positive, side) of one picture.
_Sample = tuple[str, bytes, bool, Split]


def write_project(folder: Path, experiment: str, renderer: SceneRenderer) -> None:
    """Write one project with 10 + 10 pictures a side, or four times as many for various doors.

    Every picture is of a scene of its own, so test pictures show nothing that train ones show. No
    picture is left out for being hard.
    """
    things = _DOORS if experiment == _VARIOUS else (experiment,)
    positive, negative = states_of(experiment)
    states = StateNames(positive, negative or f"not {positive}")
    name = experiment.replace("_", " ")
    project = Project.create(folder, name, states, grid=grid_about(experiment))
    for thing in things:
        for picture, data, is_positive, side in _samples(thing, renderer):
            added = project.add(data, f"{thing}/{picture}", 1 if is_positive else -1)
            project.set_splits([added.image.id], side)
    project.save()


def main(arguments: Sequence[str] | None = None) -> None:
    """Write all sample projects anew."""
    parser = argparse.ArgumentParser(
        prog="python -m vqa_state.embedded_training.samples", description=__doc__
    )
    place = parser.add_mutually_exclusive_group(required=True)
    place.add_argument("--out", type=Path, metavar="DIR")
    place.add_argument("--probes", type=Path, metavar="DIR")
    chosen = parser.parse_args(arguments)
    with SceneRenderer(_SIZE) as renderer:
        if chosen.probes is not None:
            write_probes(chosen.probes, renderer)
            return
        for experiment in track((*PAPER_THINGS, _VARIOUS), description="samples"):
            shutil.rmtree(chosen.out / experiment, ignore_errors=True)
            write_project(chosen.out / experiment, experiment, renderer)


def write_probes(folder: Path, renderer: SceneRenderer) -> None:
    """Write one picture of each state of some things, as THING_positive.jpg and so on."""
    folder.mkdir(parents=True, exist_ok=True)
    for thing, number in _PROBES.items():
        for state, picture in zip(
            ("positive", "negative"), renderer.render(thing, SceneSplit.SAMPLE, number), strict=True
        ):
            path = folder / f"{thing}_{state}.jpg"
            picture.image.save(path, "JPEG", quality=_QUALITY, optimize=True)


def _samples(thing: str, renderer: SceneRenderer) -> Iterator[_Sample]:
    for number in range(4 * _N_PER_STATE):
        is_positive = number % 2 == 0
        side = Split.TRAIN if number < 2 * _N_PER_STATE else Split.TEST
        positive, negative = renderer.render(thing, SceneSplit.SAMPLE, number)
        buffer = io.BytesIO()
        picture = positive if is_positive else negative
        picture.image.save(buffer, "JPEG", quality=_QUALITY, optimize=True)
        yield f"{side.value}/{number:02d}.jpg", buffer.getvalue(), is_positive, side


if __name__ == "__main__":
    main()
