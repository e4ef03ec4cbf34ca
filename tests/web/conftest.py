"""A desk with projects, a scripted model, and the app in a thread, for all web tests."""

import os
import shutil
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

os.environ["GRADIO_ANALYTICS_ENABLED"] = "False"  # before gradio is imported, as app.py does

from stand_ins import Gate, picture, says

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.project.project import Project
from vqa_state.study.collect import ask
from vqa_state.study.optimize import optimize
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.session import Desk


@pytest.fixture
def gate() -> Iterator[Gate]:
    """A gate before the model's 200th answer; open unless a test closes it."""
    one = Gate()
    one.opened.set()
    yield one
    one.opened.set()


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch, gate: Gate) -> ScriptedModel:
    """A model under the name "scripted"."""

    def script(image: Image.Image, question: str) -> Answer:
        if len(model.asked) == 200:
            gate.pass_through()
        return says(image, question)

    model = ScriptedModel(script)
    monkeypatch.setitem(models._factories, "scripted", lambda: model)
    return model


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    """A desk without projects."""
    folder = tmp_path / "projects"
    folder.mkdir()
    return Desk(folder)


@pytest.fixture(scope="session")
def labelled_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with 16 labelled, divided pictures and its 16 questions about one door."""
    desk = Desk(tmp_path_factory.mktemp("labelled"))
    pid = desk.create("door", "open", "closed")
    with desk.changing(pid) as project:
        for number in range(8):
            for dark in (True, False):
                name = f"{'open' if dark else 'closed'}-{number}.png"
                project.add(picture(number, dark=dark), name, 1 if dark else -1)
        project.assign_splits()
        project.search = replace(project.search, population=60, generations=8)
    return desk.root / pid


@pytest.fixture(scope="session")
def asked_folder(labelled_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same project with all its answers."""
    folder = tmp_path_factory.mktemp("asked") / labelled_folder.name
    shutil.copytree(labelled_folder, folder)
    project, model = Project.open(folder), ScriptedModel(says)
    project.model, project.fingerprint = model.name, model.fingerprint
    project.save()
    deque(ask(project, model), maxlen=0)
    return folder


@pytest.fixture(scope="session")
def optimized_folder(asked_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same project with its recognizers."""
    folder = tmp_path_factory.mktemp("optimized") / asked_folder.name
    shutil.copytree(asked_folder, folder)
    deque(optimize(Project.open(folder)), maxlen=0)
    return folder


@pytest.fixture
def pid(desk: Desk, labelled_folder: Path) -> str:
    """Id of a labelled project on the desk."""
    return copied(labelled_folder, desk)


@pytest.fixture
def asked(desk: Desk, asked_folder: Path, scripted: ScriptedModel) -> str:
    """Id of a project with all its answers on the desk."""
    return copied(asked_folder, desk)


@pytest.fixture
def optimized(desk: Desk, optimized_folder: Path, scripted: ScriptedModel) -> str:
    """Id of a project with its recognizers on the desk."""
    return copied(optimized_folder, desk)


def copied(folder: Path, desk: Desk) -> str:
    shutil.copytree(folder, desk.root / folder.name, dirs_exist_ok=True)
    return folder.name
