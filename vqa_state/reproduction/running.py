"""Runs the sample projects through asking and searching, on copies; a stop loses nothing."""

import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from vqa_state.errors import ProjectError
from vqa_state.models import VQAModel
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.search.engines import Engine
from vqa_state.study.answer_tables import require_answers
from vqa_state.study.collect import AskProgress, ask
from vqa_state.study.optimize import OptimizeProgress, optimize, results

__all__ = ["Finished", "Step", "copy_projects", "run"]


@dataclass(frozen=True, slots=True, eq=False)
class Finished:
    """One experiment that came to its end."""

    project: Project
    results: Results


@dataclass(frozen=True, slots=True)
class Step:
    """Where the whole run stands.

    Attributes:
        experiment: which is running; `number` of `total` from 1.
        progress: of its asking or its searching, or what it gave.
    """

    experiment: str
    number: int
    total: int
    progress: AskProgress | OptimizeProgress | Finished


_GO_ON = "when the model can answer, run the same command again, and it goes on"

#: What makes an experiment; the rest a run sets itself, or no table shows it.
_EXPERIMENT = ("name", "states", "images", "grid", "seed", "augmentation", "search", "weights")


def copy_projects(source: Path, out: Path, names: Sequence[str]) -> list[Path]:
    """Copy projects below `out`, without answers; a copy of the same that is there is kept.

    All is looked at before anything is copied.

    Raises:
        ProjectError: if `out` lies in `source`, a project is missing or cannot be copied, or
            another project, or a copy of what the source was once, stands where a copy would.
    """
    folders = [out / name for name in names]
    for folder in (out, *folders):
        _check_outside(folder, source)
    for name, folder in zip(names, folders, strict=True):
        original = Project.open(source / name)  # says what is wrong with it
        if (folder / "project.json").exists():
            _check_same(Project.open(folder), original)
    for name, folder in zip(names, folders, strict=True):
        if not (folder / "project.json").exists():
            _copy(source / name, folder)
    return folders


def _check_outside(folder: Path, source: Path) -> None:
    """The samples are never changed, by whatever name or link one comes to them."""
    if folder.resolve().is_relative_to(source.resolve()):
        raise ProjectError(
            f"{folder} is the folder of the samples ({source}) or in it, and a run changes its "
            "copies; choose another folder with --out"
        )


def _check_same(copy: Project, original: Project) -> None:
    differing = [one for one in _EXPERIMENT if getattr(copy, one) != getattr(original, one)]
    if differing:
        raise ProjectError(
            f"{copy.folder} holds a project that is no copy of {original.folder}: "
            f"{', '.join(differing)} differ. It is left as it is; choose another folder with "
            "--out, or move this one away to copy the sample anew"
        )


def _copy(original: Path, folder: Path) -> None:
    unfinished = folder.with_name(f".{folder.name}.part")
    try:
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        shutil.copytree(original / "images", unfinished / "images")
        shutil.copy(original / "project.json", unfinished)
        unfinished.rename(folder)
    except OSError as error:
        raise ProjectError(
            f"cannot copy {original} to {folder} ({error.strerror}); free some space or choose "
            "another folder with --out"
        ) from error


def run(
    folders: Sequence[Path],
    model: VQAModel,
    seed: int,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[Step]:
    """Ask and search one project after another; each ends with a `Finished`.

    Answers are stored as they come, and a search that is on disk for the same answers and seed is
    not run again, so a stopped run goes on where it was.

    Raises:
        ModelError: if the model cannot answer.
        ProjectError: if a project is damaged, or the disk is full.
        MissingAnswersError: if answers are missing once a project was asked; it is not searched.
    """
    for number, folder in enumerate(folders, 1):
        project = Project.open(folder)
        project.model, project.fingerprint = model.name, model.fingerprint
        project.search_seed = seed
        project.engine = Engine.PAPER  # the paper's own search, and no other
        project.save()
        for progress in _progress(project, model, stop):
            yield Step(folder.name, number, len(folders), progress)
            if stop():
                return
        found = results(project)
        assert found is not None  # noqa: S101  # it was searched just now, for these answers
        yield Step(folder.name, number, len(folders), Finished(project, found))


def _progress(
    project: Project, model: VQAModel, stop: Callable[[], bool]
) -> Iterator[AskProgress | OptimizeProgress]:
    last: AskProgress | None = None
    for last in ask(project, model, stop):
        yield last
    failure = None if last is None else last.last_failure
    require_answers(project, failure, f"This is {project.folder.name}; {_GO_ON}")
    if not _is_searched(project):
        yield from optimize(project, stop)


def _is_searched(project: Project) -> bool:
    """Whether all searches ran to their end for these answers, this seed and these settings."""
    found = results(project)
    return found is not None and all(
        one.finished
        and one.engine is project.engine
        and one.seed == project.search_seed
        and one.settings == project.search
        and one.weights == project.weights
        for one in found.searches.values()
    )
