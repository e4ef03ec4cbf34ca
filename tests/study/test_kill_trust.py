"""A real process is killed in the middle of a proof or an assessment; what was there stays."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from kill_trust_worker import Brightness
from study.test_assess import without_time
from tuned_project import tuned_copy

from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.study.assess import Stage, assess, assessment
from vqa_state.study.collect import answer_table, plan
from vqa_state.study.optimize import optimize, recognizer_path, refresh, results

ROOT = Path(__file__).parent.parent.parent
WORKER = Path(__file__).parents[1].joinpath("kill_trust_worker.py")


@pytest.fixture
def tuned(make_project, tmp_path):
    return tuned_copy(make_project, tmp_path)


def start(work, project, reports, waits_at="never"):
    command = [sys.executable, WORKER, work, project.folder, reports, waits_at]
    return subprocess.Popen(command, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)})


def killed_in(stage, work, project, tmp_path):
    """Start the work and kill it while it is at this stage, before its next report."""
    reports = tmp_path / f"{stage}.txt"
    worker, deadline = start(work, project, reports, stage), time.monotonic() + 60
    try:
        while stage not in (said := reports.read_text().split() if reports.exists() else []):
            assert worker.poll() is None, "the worker ended on its own"
            assert time.monotonic() < deadline
            time.sleep(0.005)
        worker.send_signal(signal.SIGKILL)
        assert worker.wait() == -signal.SIGKILL
    finally:
        worker.kill()
        worker.wait()
    assert "done" not in said


def content(project, *folders):
    """Every file in these folders, as bytes; what is being written is no file yet."""
    return {
        path: path.read_bytes()
        for name in folders
        for path in sorted((project.folder / name).rglob("*"))
        if path.is_file() and not path.name.startswith(".writing-")
    }


def litter(project):
    """What a kill in the middle of writing leaves, wherever something is written."""
    for name in ("", "searches", "recognizers", "assessments", "features", "images", "thumbnails"):
        (project.folder / name).mkdir(exist_ok=True)
        (project.folder / name / ".writing-0123456789abcdef").write_bytes(b'{"half of a')


def test_killed_while_proving(tuned, tmp_path):
    kept = content(tuned, "searches", "recognizers", "images")
    answers = answer_table(tuned, Split.TRAIN).verdicts.tobytes()
    tuned.search_seed = 7  # so that another run would keep something else
    tuned.save()
    whole = tmp_path / "whole"
    shutil.copytree(tuned.folder, whole)

    killed_in("proof", "optimize", tuned, tmp_path)
    litter(tuned)

    again = Project.open(tuned.folder)
    assert content(again, "searches", "recognizers", "images") == kept
    assert answer_table(again, Split.TRAIN).verdicts.tobytes() == answers
    assert plan(again, again.fingerprint).n_to_ask == 0
    assert results(again).searches[again.chosen].seed == 0
    refresh(again)
    assert recognizer_path(again, again.chosen).exists()

    list(optimize(again))
    other = Project.open(whole)
    list(optimize(other))
    for one in ("searches", "recognizers"):
        ours, theirs = content(again, one), content(other, one)
        assert list(ours.values()) == list(theirs.values())
        assert len(ours) == 4
    assert results(again).searches[again.chosen].seed == 7
    assert results(again).searches[again.chosen].proof is not None


@pytest.mark.parametrize("stage", [Stage.RESAMPLES, Stage.RIVAL, Stage.RIVAL_BAGS])
def test_killed_while_assessing(tuned, tmp_path, stage):
    *_, last = assess(tuned, features=Brightness, n_resamples=2)
    kept = content(tuned, "searches", "recognizers", "images", "assessments")
    shutil.rmtree(tuned.folder / "features")

    killed_in(stage.name, "assess", tuned, tmp_path)
    litter(tuned)

    again = Project.open(tuned.folder)
    assert content(again, "searches", "recognizers", "images", "assessments") == kept
    assert assessment(again, results(again)).model_dump_json() == last.assessment.model_dump_json()

    assert start("assess", again, tmp_path / "last.txt").wait(60) == 0
    finished = assessment(again, results(again))
    assert (finished.finished, finished.n_resamples) == (True, 6)
    *_, undisturbed = assess(again, features=Brightness, n_resamples=6)
    assert without_time(undisturbed.assessment) == without_time(finished)
