"""Ctrl-C on the command line: it is heard between two stages, and while the program starts."""

import hashlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from pictures import picture

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.cli import making, running
from vqa_state.project.project import Project
from vqa_state.search.genetic import SearchSettings
from vqa_state.testing.fake_model import ScriptedModel

ROOT = Path(__file__).parent.parent.parent


def by_pixels(image, question):
    return Answer(
        ("yes", "no")[hashlib.sha256(image.tobytes() + question.encode()).digest()[0] % 2]
    )


@pytest.fixture
def folder(make_project, registry):
    models.register("scripted", lambda: ScriptedModel(by_pixels))
    project = make_project(n_train=3, n_test=1)
    project.search, project.model = SearchSettings(population=20, generations=3), "scripted"
    project.save()
    return project.folder


def interrupted_after(work):
    """The same work, and Ctrl-C when it has come to its end."""

    def whole(*arguments, **named):
        yield from work(*arguments, **named)
        signal.raise_signal(signal.SIGINT)

    return whole


def forbidden(*_, **__):
    raise AssertionError("a stop was acknowledged, then ignored")


def test_a_stop_at_the_end_of_the_search_ends_tune(run, folder, monkeypatch):
    monkeypatch.setattr(running, "optimize", interrupted_after(running.optimize))
    monkeypatch.setattr(running, "assess", forbidden)
    code, out, err = run("tune", folder, "--engine", "paper")
    assert code == 3
    assert "stopped by you before assessing" in err
    assert "s+" in out  # what was found is shown


def test_a_stop_at_the_end_of_asking_ends_tune(run, folder, monkeypatch):
    monkeypatch.setattr(running, "ask", interrupted_after(running.ask))
    monkeypatch.setattr(running, "optimize", forbidden)
    code, _, err = run("tune", folder)
    assert code == 3
    assert "stopped by you before the search" in err


def test_a_stop_while_suggesting_accepts_no_label(run, folder, tmp_path, monkeypatch):
    run("ask", folder)
    run("optimize", folder, "--engine", "paper")
    (tmp_path / "new.png").write_bytes(picture(100))
    run("add", folder, tmp_path / "new.png")
    monkeypatch.setattr(making, "ask_unlabelled", interrupted_after(making.ask_unlabelled))
    code, _, err = run("label", folder, "--suggest", "--accept")
    assert (code, "no label was changed" in err) == (3, True)
    (new,) = [i for i in Project.open(folder).images.values() if i.name == "new.png"]
    assert new.label is None


@pytest.mark.parametrize("program", [["-m", "vqa_state", "--help"], [str(ROOT / "app.py")]])
def test_ctrl_c_while_the_program_loads_is_one_line(tmp_path, program):
    """A package that it imports is interrupted, in code of its own as `exec` runs it."""
    (tmp_path / "pandas.py").write_text(
        "import os, signal\nexec('os.kill(os.getpid(), signal.SIGINT)\\nwhile True: pass')\n"
    )
    ended = subprocess.run(
        [sys.executable, *program],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (ended.returncode, ended.stdout) == (130, "")
    assert ended.stderr == "stopped by you while starting; nothing was changed\n"
