"""A small project that was asked and searched: once in a run, then copied for every test."""

import atexit
import hashlib
import shutil
import tempfile
from pathlib import Path

from vqa_state.answers.answer import Answer
from vqa_state.project.project import Project
from vqa_state.search.genetic import SearchSettings
from vqa_state.study.collect import ask
from vqa_state.study.optimize import optimize
from vqa_state.testing.fake_model import ScriptedModel


def unsure(image, question):
    """Answers and probabilities that differ by picture, copy and question."""
    seen = hashlib.sha256(image.tobytes() + question.encode()).digest()
    text = ("yes", "no", "door")[seen[0] % 5 % 3]
    return Answer(text, seen[1] / 255)


MODEL = ScriptedModel(unsure)

_made: list[Path] = []


def tuned_copy(make_project, folder: Path) -> Project:
    """A copy of its own for one test; `make_project` is the fixture."""
    if not _made:
        home = Path(tempfile.mkdtemp(prefix="tuned-"))
        atexit.register(shutil.rmtree, home, ignore_errors=True)
        shutil.copytree(_tuned(make_project).folder, home / "project")
        _made.append(home / "project")
    shutil.copytree(_made[0], folder / "tuned")
    return Project.open(folder / "tuned")


def _tuned(make_project) -> Project:
    project = make_project("template", n_train=4, n_test=3)
    project.search = SearchSettings(population=30, generations=5)
    project.model, project.fingerprint = MODEL.name, MODEL.fingerprint
    project.save()
    list(ask(project, MODEL))
    list(optimize(project, prove=False))
    return project
