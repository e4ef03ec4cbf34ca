"""Kills a process of its own with kill -9 at random moments, and looks what is left.

Arguments: the project's folder, how many kills, a seed. The last line of its output is a JSON
object with what was found; `test_kill_saving.py` runs it.
"""

import json
import os
import random
import signal
import sys
import time
from pathlib import Path

from pictures import picture

from vqa_state.answers.answer import Answer
from vqa_state.answers.store import AnswerStore
from vqa_state.errors import VQAStateError
from vqa_state.project.importing import add_files
from vqa_state.project.project import Project
from vqa_state.project.searches import read_search, search_path
from vqa_state.project.split import Split
from vqa_state.search.objectives import Objective
from vqa_state.study.collect import ask
from vqa_state.study.optimize import optimize, recognizer_path, refresh
from vqa_state.testing.fake_model import ScriptedModel

MODEL = ScriptedModel(lambda image, question: Answer("yes" if len(question) % 2 else "no", 0.7))
KEPT = {"project.json", ".asking.lock"}


def saving(project, say, rng):
    """Add, label and remove under the lock, and add and save without it."""
    while True:
        with project.changing():
            image = project.add(picture(rng.randrange(10**9)), "new.png").image
            label = rng.choice((1, -1))
            project.set_labels([image.id], label)
        say(f"{image.id} {label}")
        if rng.random() < 0.5:
            with project.changing():
                project.remove([image.id])
            say(f"{image.id} removed")
        add_files(project, [(f"{n}.png", picture(rng.randrange(10**9))) for n in range(2)])
        project.save()
        last = list(project.images)[-1]
        say(f"{last} 0")


def asking(project, say, rng):
    """Ask about another question each time."""
    while True:
        project.seed = rng.randrange(2**31)
        project.save()
        for progress in ask(project, MODEL):
            say(f"answers {progress.n_asked}")
        say("answers 0")


def tuning(project, say, rng):
    """Search again with another seed each time."""
    project.seed = 0
    project.save()
    list(ask(project, MODEL))
    while True:
        project.search_seed = rng.randrange(2**31)
        project.save()
        list(optimize(project, prove=False))
        say(f"searched {project.search_seed}")


WORKS = (saving, asking, tuning)


def killed(work, folder, log, rng):
    """Fork a child that works, and kill it at a random moment; the lines that it could write."""
    log.unlink(missing_ok=True)
    child = os.fork()
    if not child:
        handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        try:
            work(Project.open(folder), lambda line: os.write(handle, f"{line}\n".encode()), rng)
        except VQAStateError as error:
            os.write(handle, f"failed {error}\n".encode())
        os._exit(1)
    time.sleep(rng.uniform(0.01, 0.4))
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    assert os.WTERMSIG(status) == signal.SIGKILL, log.read_text()
    return log.read_text().split("\n")[:-1] if log.exists() else []


def litter(project):
    """Files that nothing names."""
    named = {f"images/{one.id}.{one.suffix}" for one in project.images.values()}
    named |= {f"thumbnails/{one.id}.webp" for one in project.images.values()}
    named |= KEPT | {f"answers.sqlite{end}" for end in ("", "-wal", "-shm")}
    for one in Objective:
        paths = search_path(project, one), recognizer_path(project, one)
        named |= {str(path.relative_to(project.folder)) for path in paths}
    files = (path for path in project.folder.rglob("*") if path.is_file())
    return [name for path in files if (name := str(path.relative_to(project.folder))) not in named]


def lost(project, work, said, n_before):
    """What was said to be done and is not there."""
    gone = [f"file of {one.id}" for one in project.images.values() if not is_whole(project, one)]
    images = {line.split()[0]: line.split()[1] for line in said}
    if work is saving:
        for image_id, label in images.items():
            image = project.images.get(image_id)
            right = image is None if label == "removed" else image is not None
            if image is not None and label in ("1", "-1"):
                right &= image.label == int(label)
            gone += [] if right else [f"{image_id} {label}"]
    if work is asking:
        with AnswerStore(project.store_path) as store:
            rounds, last = 0, 0
            for line in said:
                n_asked = int(line.split()[1])
                rounds, last = (rounds + last, 0) if not n_asked else (rounds, n_asked)
            gone += [] if len(store) - n_before >= rounds + last else ["answers"]
    if work is tuning and said:
        found = refresh(project)
        seeds = {read_search(project, one).seed for one in Objective}
        if len(seeds) == 1 and found is None:
            gone.append("a whole search")
    return gone


def is_whole(project, image):
    try:
        return bool(project.read(image))
    except VQAStateError:
        return False


def n_answers(project):
    with AnswerStore(project.store_path) as store:
        return len(store)


def main(folder, n_kills, seed):
    folder, rng = Path(folder), random.Random(int(seed))
    found = {"kills": 0, "left_before_opening": 0, "left": [], "lost": [], "said": 0}
    for kill in range(int(n_kills)):
        project = Project.open(folder)
        fixed = {i: one.label for i, one in project.images.items() if one.split is Split.TRAIN}
        work, before = WORKS[kill % len(WORKS)], n_answers(project)
        said = killed(work, folder, folder.parent / "said.txt", random.Random(rng.random()))
        found["left_before_opening"] += len(set(litter(Project._read(folder))))
        project = Project.open(folder)
        found["kills"] += 1
        found["said"] += len(said)
        found["left"] += litter(project)
        found["lost"] += lost(project, work, said, before)
        found["lost"] += [i for i, one in fixed.items() if project.images[i].label != one]
        project.remove([i for i, one in project.images.items() if one.split is None])
        project.save()  # so that no round is slower than the one before
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
