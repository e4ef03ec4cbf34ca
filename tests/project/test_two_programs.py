"""Two real processes change one project at once: none of what they were told is saved is lost."""

import os
import subprocess
import sys
import time
from pathlib import Path

from pictures import picture
from two_programs_worker import KINDS

from vqa_state.images import content_hash
from vqa_state.project.project import Project, StateNames

ROOT = Path(__file__).parent.parent.parent
WORKER = Path(__file__).parents[1].joinpath("two_programs_worker.py")
N_CHANGES = int(os.environ.get("VQA_STATE_TEST_CHANGES", "24"))
"""Of both together; 200 take about a minute."""


def test_of_interleaved_changes_none_is_lost(tmp_path):
    project = Project.create(tmp_path / "shared", "door", StateNames("open", "closed"))
    each = N_CHANGES // 2
    for number in range(each):
        for place, program in enumerate(("app", "commands")):
            project.add(picture(2 * number + place), f"{program}-{number:04}.png")
    project.save()

    begin = time.time() + 6  # both are loaded by then
    workers = {
        program: subprocess.Popen(
            [sys.executable, WORKER, program, project.folder, str(each), str(begin)],
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            text=True,
        )
        for program in ("app", "commands")
    }
    said = {program: worker.communicate(timeout=280)[0] for program, worker in workers.items()}

    lines = {
        program: [line.split("\t") for line in out.splitlines()] for program, out in said.items()
    }
    for program, worker in workers.items():
        assert worker.returncode == 0
        assert [line[1] for line in lines[program]] == ["saved"] * each, lines[program]

    found = Project.open(project.folder)
    questions = {one.text for one in found.grid.custom}
    looks = 0
    for program, label in (("app", 1), ("commands", -1)):
        for number, (_, _, image_id) in enumerate(lines[program]):
            match number % KINDS:
                case 1:
                    start = 10_000 if program == "app" else 20_000
                    added = found.images[content_hash(picture(start + number))]
                    assert found.read(added)
                case 2 if program == "app":
                    looks += 1
                case 2:
                    assert f"Is it number {number}?" in questions
                case _:
                    assert found.images[image_id].label == label
    assert found.test_looks == looks > 0
    assert all(found.read(image) for image in found.images.values())
    hidden = [path.name for path in found.folder.rglob(".*")]
    assert hidden == []
