"""Rendered pictures on disk: written scene by scene, so that a stopped run goes on."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from rich.progress import track

from vqa_state.embedded_training.cache import digest, digest_file
from vqa_state.embedded_training.scenes import THINGS, RenderedPicture, SceneRenderer, SceneSplit
from vqa_state.embedded_training.scenes.simulation import Facts
from vqa_state.errors import ProjectError

__all__ = [
    "Example",
    "digest_examples",
    "load_examples",
    "read_scene",
    "render_missing",
    "render_split",
]

#: JPEG quality of stored pictures; high, since training adds its own artefacts.
_QUALITY = 90

#: Pictures of a scene before each camera.
_N_STATES = 2

#: Scenes that one process renders in one drawing context.
_PER_JOB = 10

#: (seed, number of views) -> pictures of one scene.
_Render = Callable[[int, int], list[RenderedPicture]]
_OpenRenderer = Callable[[], AbstractContextManager[_Render]]


@dataclass(frozen=True, slots=True)
class Example:
    """One labelled picture. `facts` is empty where nothing but the label is known."""

    path: Path
    thing: str
    is_positive: bool
    facts: Facts
    scene: str


@dataclass(frozen=True, slots=True)
class _Job:
    """Some scenes that are rendered in one drawing context, each to FOLDER/SEED.json."""

    folder: Path
    open_renderer: _OpenRenderer
    seeds: tuple[int, ...]
    n_views: int


def render_split(
    folder: Path,
    split: SceneSplit,
    n_scenes: int,
    n_views: int,
    n_processes: int,
    things: Sequence[str] = THINGS,
) -> None:
    """Render the missing scenes of some things to FOLDER/THING; see `render_missing`."""
    renderers = {folder / thing: partial(_open_renderer, thing, split) for thing in things}
    render_missing(renderers, n_scenes, n_views, n_processes, f"scenes ({split.value})")


@contextmanager
def _open_renderer(thing: str, split: SceneSplit) -> Iterator[_Render]:
    with SceneRenderer() as renderer:
        yield partial(renderer.render, thing, split)


def render_missing(
    renderers: Mapping[Path, _OpenRenderer],
    n_scenes: int,
    n_views: int,
    n_processes: int,
    description: str,
) -> None:
    """Render scenes 0 to `n_scenes` - 1 to each folder, with a bar; finished ones are skipped.

    Processes are spawned, not forked: a drawing context does not survive a fork. So what opens a
    renderer must be picklable.

    Raises:
        ProjectError: if a folder holds scenes with another number of views.
    """
    jobs = []
    for start in range(0, n_scenes, _PER_JOB):
        wanted = range(start, min(start + _PER_JOB, n_scenes))
        for folder, open_renderer in renderers.items():
            seeds = tuple(s for s in wanted if not _is_finished(_record(folder, s), n_views))
            if seeds:
                jobs.append(_Job(folder, open_renderer, seeds, n_views))
    for _ in track(_run(jobs, n_processes), total=len(jobs), description=description):
        pass


def _run(jobs: Sequence[_Job], n_processes: int) -> Iterator[None]:
    if n_processes == 1 or not jobs:
        yield from map(_render, jobs)
        return
    with get_context("spawn").Pool(n_processes) as pool:
        yield from pool.imap_unordered(_render, jobs)


def _render(job: _Job) -> None:
    job.folder.mkdir(parents=True, exist_ok=True)
    with job.open_renderer() as render:
        for seed in job.seeds:
            _write_scene(_record(job.folder, seed), render(seed, job.n_views))


def _record(folder: Path, seed: int) -> Path:
    """The file that says a scene is finished, and what its pictures show."""
    return folder / f"{seed:05d}.json"


def _is_finished(record: Path, n_views: int) -> bool:
    """Whether a scene is on disk, in both states before each of `n_views` cameras."""
    if not record.exists():
        return False
    found = len(json.loads(record.read_text("utf-8"))) // _N_STATES
    if found != n_views:
        raise ProjectError(
            f"{record} says that its scene was rendered with {found} views, not with {n_views}; "
            f"give --views {found}, or another --out for other views"
        )
    return True


def _write_scene(record: Path, pictures: Sequence[RenderedPicture]) -> None:
    """Write pictures beside their record, which comes last: without it a scene is not finished."""
    rows = []
    for number, picture in enumerate(pictures):
        file = f"{record.stem}_{number}.jpg"
        picture.image.save(record.parent / file, quality=_QUALITY)
        facts = {name: round(value, 4) for name, value in picture.facts.items()}
        rows.append({"file": file, "positive": picture.is_positive, "facts": facts})
    record.write_text(json.dumps(rows), "utf-8")


def read_scene(folder: Path, seed: int, thing: str, name: str) -> list[Example]:
    """The pictures of one finished scene; scenes are called NAME/SEED."""
    record = _record(folder, seed)
    return [
        Example(folder / row["file"], thing, row["positive"], row["facts"], f"{name}/{record.stem}")
        for row in json.loads(record.read_text("utf-8"))
    ]


def load_examples(folder: Path, n_scenes: int | None = None) -> list[Example]:
    """All finished pictures below `folder`, of scenes with seeds below `n_scenes`.

    They are ordered by seed, then thing: more scenes only add to the end of the list.
    """
    scenes = sorted((int(path.stem), path.parent.name) for path in folder.glob("*/*.json"))
    return [
        example
        for seed, thing in scenes
        if n_scenes is None or seed < n_scenes
        for example in read_scene(folder / thing, seed, thing, thing)
    ]


def digest_examples(examples: Sequence[Example]) -> str:
    """For all that training learns from: pictures by their bytes, labels, facts, and the order."""
    return digest(
        *(
            [digest_file(e.path), e.thing, e.is_positive, sorted(e.facts.items()), e.scene]
            for e in examples
        )
    )
