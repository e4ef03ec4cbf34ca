"""Rendered pictures on disk: written scene by scene, so that a stopped run goes on."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from vqa_state.embedded_training.scenes import THINGS, Picture, SceneRenderer, Split
from vqa_state.embedded_training.scenes.stage import Facts
from vqa_state.errors import ProjectError

__all__ = [
    "Example",
    "SceneJob",
    "is_finished",
    "load_examples",
    "pending_jobs",
    "read_record",
    "render_jobs",
    "write_pictures",
]

#: JPEG quality of stored pictures; high, since training adds its own artefacts.
_QUALITY = 90

#: Pictures of a scene before each camera.
_N_STATES = 2


@dataclass(frozen=True, slots=True)
class Example:
    """One labelled picture. `facts` is empty where nothing but the label is known."""

    path: Path
    thing: str
    is_positive: bool
    facts: Facts
    scene: str


@dataclass(frozen=True, slots=True)
class SceneJob:
    """Some scenes of one thing, rendered in one drawing context."""

    folder: Path
    split: Split
    thing: str
    seeds: tuple[int, ...]
    n_views: int
    size: int = 256


def pending_jobs(
    folder: Path,
    split: Split,
    n_scenes: int,
    n_views: int,
    things: Sequence[str] = THINGS,
    *,
    scenes_per_job: int = 10,
) -> list[SceneJob]:
    """What is still to be rendered for seeds 0 to `n_scenes` - 1 of every thing.

    Raises:
        ProjectError: if `folder` holds scenes with another number of views.
    """
    jobs = []
    for start in range(0, n_scenes, scenes_per_job):
        for thing in things:
            wanted = range(start, min(start + scenes_per_job, n_scenes))
            records = {seed: _record(folder, thing, seed) for seed in wanted}
            seeds = tuple(seed for seed in wanted if not is_finished(records[seed], n_views))
            if seeds:
                jobs.append(SceneJob(folder, split, thing, seeds, n_views))
    return jobs


def render_jobs(jobs: Sequence[SceneJob], n_processes: int = 1) -> Iterator[SceneJob]:
    """Render all jobs and yield each when its pictures are on disk.

    Processes are spawned, not forked: a drawing context does not survive a fork.
    """
    if n_processes == 1:
        for job in jobs:
            yield _render_job(job)
        return
    with get_context("spawn").Pool(n_processes) as pool:
        yield from pool.imap_unordered(_render_job, jobs)


def load_examples(folder: Path, n_scenes: int | None = None) -> list[Example]:
    """All finished pictures below `folder`, of scenes with seeds below `n_scenes`.

    They are ordered by seed, then thing: more scenes only add to the end of the list.
    """
    examples = []
    records = sorted(folder.glob("*/*.json"), key=lambda path: (path.stem, path.parent.name))
    for record in records:
        if n_scenes is not None and int(record.stem) >= n_scenes:
            continue
        thing = record.parent.name
        examples += read_record(record, thing, f"{thing}/{record.stem}")
    return examples


def read_record(record: Path, thing: str, scene: str) -> list[Example]:
    """The pictures of one finished scene."""
    return [
        Example(record.parent / row["file"], thing, row["positive"], row["facts"], scene)
        for row in json.loads(record.read_text("utf-8"))
    ]


def is_finished(record: Path, n_views: int) -> bool:
    """Whether a scene is on disk, in both states before each of `n_views` cameras.

    Raises:
        ProjectError: if it is there with another number of views.
    """
    if not record.exists():
        return False
    found, asked = len(json.loads(record.read_text("utf-8"))), _N_STATES * n_views
    if found != asked:
        raise ProjectError(
            f"{record} says that its scene was rendered with {found // _N_STATES} views, not with "
            f"{n_views}; give --views {found // _N_STATES}, or another --out for other views"
        )
    return True


def write_pictures(record: Path, pictures: Sequence[Picture]) -> None:
    """Write pictures beside their record, which comes last: without it a scene is not finished."""
    rows = []
    for number, picture in enumerate(pictures):
        file = f"{record.stem}_{number}.jpg"
        picture.image.save(record.parent / file, quality=_QUALITY)
        facts = {name: round(value, 4) for name, value in picture.facts.items()}
        rows.append({"file": file, "positive": picture.is_positive, "facts": facts})
    record.write_text(json.dumps(rows), "utf-8")


def _record(folder: Path, thing: str, seed: int) -> Path:
    """The file that says a scene is finished, and what its pictures show."""
    return folder / thing / f"{seed:05d}.json"


def _render_job(job: SceneJob) -> SceneJob:
    with SceneRenderer(job.size) as renderer:
        for seed in job.seeds:
            record = _record(job.folder, job.thing, seed)
            record.parent.mkdir(parents=True, exist_ok=True)
            pictures = renderer.render(job.thing, job.split, seed, job.n_views)
            write_pictures(record, pictures)
    return job
