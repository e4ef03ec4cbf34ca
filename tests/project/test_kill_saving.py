"""Processes are killed while they save, ask and tune: nothing is lost, nothing is left behind."""

import json
import os
import subprocess
import sys
from pathlib import Path

from tuned_project import tuned_copy

ROOT = Path(__file__).parent.parent.parent
WORKER = Path(__file__).parents[1].joinpath("kill_saving_worker.py")
N_KILLS = int(os.environ.get("VQA_STATE_TEST_KILLS", "9"))
"""A third of each kind; 200 take some minutes."""


def test_killed_at_random_moments(make_project, tmp_path):
    project = tuned_copy(make_project, tmp_path)
    done = subprocess.run(
        [sys.executable, WORKER, project.folder, str(N_KILLS), "7"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["kills"] == N_KILLS
    assert found["said"] > 0
    assert found["lost"] == []
    assert found["left"] == []
