"""Proves or assesses a project and writes every report to a file; `test_kill_trust.py` kills it.

Arguments: "optimize" or "assess", the project's folder, the file of reports, the stage at whose
reports it waits to be killed.
"""

import sys
import time
from pathlib import Path

import numpy as np

from vqa_state.project.project import Project
from vqa_state.study.assess import assess
from vqa_state.study.optimize import optimize


class Brightness:
    """An image network of one number."""

    n_features = 1
    fingerprint = "brightness/1"

    def __call__(self, images):
        for image in images:
            yield np.array([np.asarray(image, np.float32).mean()], np.float32)


def stages(work, project):
    """What each report tells of, in a word."""
    if work == "optimize":
        for progress in optimize(project):
            yield "proof" if progress.proving else "search"
    else:
        for step in assess(project, features=Brightness, n_resamples=6):
            yield "done" if step.assessment else step.stage.name


def main(work, folder, reports, waits_at):
    with Path(reports).open("a") as log:
        for stage in stages(work, Project.open(Path(folder))):
            log.write(f"{stage}\n")
            log.flush()
            time.sleep(0.5 if stage == waits_at else 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
