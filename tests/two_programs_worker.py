"""Changes a project over and over as one of two programs; `test_two_programs.py` runs both at once.

Arguments: "app" or "commands", the project's folder, how many changes, the second to begin at.
Every change that was said to be saved is a line of the output.
"""

import contextlib
import io
import sys
import time
from pathlib import Path

from pictures import picture

from vqa_state.cli import making
from vqa_state.errors import VQAStateError
from vqa_state.project.project import Project
from vqa_state.web.label_marks import mark
from vqa_state.web.session import Desk
from vqa_state.web.uploads import added_lines

KINDS = 4


def app(folder, number, image_id):
    """A label by the page, a picture by the page, a look, a side."""
    desk, pid = Desk(folder.parent), folder.name
    match number % KINDS:
        case 1:
            list(added_lines(desk, pid, f"app-{number}.png", picture(10_000 + number)))
        case 2:
            with desk.changing(pid) as project:
                project.test_looks += 1
        case _:
            mark(desk, pid, {"labels": {image_id: 1}, "seen": {"labels": {image_id: None}}})


def commands(folder, number, image_id):
    """A label, a picture, a question, a look, as the commands do it."""
    match number % KINDS:
        case 1:
            path = folder.parent / f"commands-{number}.png"
            path.write_bytes(picture(20_000 + number))
            making.add(folder, [path])
        case 2:
            making.grid(folder, yes_positive=[f"Is it number {number}?"])
        case _:
            making.label(folder, [image_id], state="closed")


def main(program, folder, n_changes, begin):
    folder = Path(folder)
    images = sorted(Project.open(folder).images.values(), key=lambda image: image.name)
    mine = [one.id for one in images if one.name.startswith(program)]
    change = app if program == "app" else commands
    time.sleep(max(0.0, float(begin) - time.time()))
    for number in range(int(n_changes)):
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                change(folder, number, mine[number])
        except VQAStateError as error:
            print(f"{number}\trefused\t{error}", flush=True)
        else:
            print(f"{number}\tsaved\t{mine[number]}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
