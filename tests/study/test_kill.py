"""A real process is killed in the middle of asking, again and again; nothing is lost."""

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from kill_worker import answer

from vqa_state.answers.store import AnswerStore, copy_keys
from vqa_state.images.augmentation import copies
from vqa_state.images.reading import pixel_hash, read_picture
from vqa_state.project.split import Split
from vqa_state.study.collect import answer_table, ask, plan
from vqa_state.testing.fake_model import ScriptedModel

WORKER = Path(__file__).parents[1].joinpath("kill_worker.py")
ROOT = Path(__file__).parent.parent.parent
N_KILLS = 5
FINGERPRINT = "scripted/1"


def start(project, calls, seconds):
    command = [sys.executable, WORKER, project.folder, calls, str(seconds)]
    return subprocess.Popen(command, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)})


def lines(calls):
    """Whole lines only: the last one may be cut off by the kill."""
    return calls.read_text().split("\n")[:-1] if calls.exists() else []


def kill_after(worker, calls, n_more, rng):
    """Kill the worker at a random moment after it has made `n_more` calls."""
    wanted = len(lines(calls)) + n_more
    deadline = time.monotonic() + 60
    while len(lines(calls)) < wanted:
        assert worker.poll() is None, "the worker ended on its own"
        assert time.monotonic() < deadline
        time.sleep(0.002)
    time.sleep(rng.random() * 0.03)
    worker.send_signal(signal.SIGKILL)
    assert worker.wait() == -signal.SIGKILL


def stored(project):
    """Every stored (hash of the copy, question), as the worker writes them."""
    texts = [question.text for question in project.questions()]
    found = set()
    with AnswerStore(project.store_path) as store:
        for image in project.images.values():
            pixels = read_picture(project.read(image)).pixels
            shifted = copies(pixels, image.pixel_hash, project.augmentation, project.seed)
            keys = copy_keys(image.pixel_hash, project.augmentation, project.seed)
            for copy, key in zip(shifted, keys, strict=True):
                said = store.answers(FINGERPRINT, key, texts)
                found |= {f"{pixel_hash(copy)}\t{text}" for text in said}
    return found


def test_killed_again_and_again_the_table_is_the_same(make_project, tmp_path):
    rng = random.Random(2303)
    project = make_project("killed", n_train=3, n_test=2)
    calls = tmp_path / "calls.txt"
    batch = project.augmentation.n_copies * len(project.questions())
    n_calls = batch * len(project.images)

    for kill in range(N_KILLS):
        before, n_before = stored(project), len(lines(calls))
        worker = start(project, calls, 0.015)
        try:
            kill_after(worker, calls, rng.randint(1, batch * 3 // 2), rng)
        finally:
            worker.kill()
            worker.wait()
        assert not before & set(lines(calls)[n_before:]), "asked again although it was stored"
        assert before <= stored(project), "an answer was lost"
        assert len(lines(calls)) - len(stored(project)) <= batch * (kill + 1)

    before, n_before = stored(project), len(lines(calls))
    assert 0 < len(before) < n_calls
    assert start(project, calls, 0).wait(60) == 0
    last = lines(calls)[n_before:]
    assert not before & set(last)
    assert len(last) == n_calls - len(before)
    assert plan(project, FINGERPRINT).n_to_ask == 0
    times = Counter(lines(calls))
    assert len(times) == n_calls
    assert sum(times.values()) - n_calls <= N_KILLS * batch

    whole = make_project("whole", n_train=3, n_test=2)
    for _ in ask(whole, ScriptedModel(answer)):
        pass
    for split in (Split.TRAIN, Split.TEST):
        project.fingerprint = whole.fingerprint = FINGERPRINT
        one, other = answer_table(project, split), answer_table(whole, split)
        assert one.image_ids == other.image_ids
        assert one.complete.all()
        assert (one.verdicts == other.verdicts).all()
        assert np.array_equal(one.p_positive, other.p_positive)
