"""A real server, `transformers serve`: killed in the middle of a run and started again."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from urllib.error import HTTPError, URLError
from urllib.request import urlopen

import pytest
from pictures import draw
from stub_server import free_port

from benchmarks.model_folders import build_idefics3
from vqa_state.answers.answer import Answer
from vqa_state.answers.store import AnswerStore, copy_keys
from vqa_state.models import Failure
from vqa_state.models.server.model import CallBudget, ServerModel
from vqa_state.project.split import Split
from vqa_state.study.collect import ask, plan

#: Loads what takes long, then waits for a line, so that a server is there soon after a kill.
_WAITING = """
import sys
from transformers.cli.transformers import app
import transformers.models.idefics3.modeling_idefics3, fastapi, uvicorn
sys.stdin.readline()
app(sys.argv[1:])
"""


class Served:
    """A process that serves models from folders on one port once `start` is called."""

    def __init__(self, port, log):
        self.url = f"http://127.0.0.1:{port}"
        options = ["serve", "--host", "127.0.0.1", "--port", str(port), "--device", "cpu"]
        surroundings = {"HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""}
        self._log = log
        with log.open("w") as file:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _WAITING, *options],
                stdin=subprocess.PIPE,
                stdout=file,
                stderr=subprocess.STDOUT,
                env={**os.environ, **surroundings},
            )

    def start(self, seconds=100.0):
        self._process.stdin.write(b"go\n")
        self._process.stdin.close()
        until = time.monotonic() + seconds
        while time.monotonic() < until and self._process.poll() is None:
            with suppress(URLError, ConnectionError), urlopen(f"{self.url}/health") as reply:  # noqa: S310
                assert reply.status == 200
                return
            time.sleep(0.1)
        pytest.fail(f"transformers serve did not start:\n{self._log.read_text()[-3000:]}")

    def kill(self):
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGKILL)
        self._process.wait()
        if not self._process.stdin.closed:
            self._process.stdin.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return build_idefics3(tmp_path_factory.mktemp("models") / "idefics3")


class Counting:
    """A model that counts what another one replies."""

    def __init__(self, model):
        self.name, self.fingerprint, self.notes = model.name, model.fingerprint, model.notes
        self.answered: Counter = Counter()
        self._model = model

    def answer(self, images, questions):
        for reply in self._model.answer(images, questions):
            if isinstance(reply.outcome, Answer):
                self.answered[images[reply.image].tobytes(), questions[reply.question]] += 1
            yield reply


def stored(project, model):
    """(copy, question) -> text."""
    texts = [question.text for question in project.questions()]
    found = {}
    with AnswerStore(project.store_path) as store:
        for image in project.labelled(Split.TRAIN, Split.TEST):
            for key in copy_keys(image.pixel_hash, project.augmentation, project.seed):
                for text, answer in store.answers(model.fingerprint, key, texts).items():
                    found[key, text] = answer.text
    return found


@pytest.mark.timeout(240)
def test_a_server_killed_in_the_middle_loses_and_doubles_no_answer(tmp_path, folder, project):
    port = free_port()
    first, second = (Served(port, tmp_path / f"{name}.log") for name in ("first", "second"))
    try:
        budget = CallBudget(retries=1, first_wait_seconds=0.1, max_parallel=4)
        model = ServerModel(f"{first.url}/v1", str(folder), "server:test", budget=budget)
        counting = Counting(model)
        first.start()
        for report in ask(project, counting):
            if report.n_asked >= report.n_calls // 4:
                first.kill()
        assert 0 < report.n_asked < report.n_calls
        assert report.n_failed == report.n_calls - report.n_asked
        assert "nothing answers at" in report.last_failure or "broke" in report.last_failure
        before = stored(project, model)
        assert len(before) == report.n_asked

        second.start()
        again = list(ask(project, counting))[-1]
        assert (again.n_failed, again.n_asked) == (0, report.n_failed)
        assert plan(project, model.fingerprint).n_to_ask == 0
        after = stored(project, model)
        assert len(after) == again.n_calls
        assert before.items() <= after.items()
        assert set(counting.answered.values()) == {1}
        assert len(counting.answered) == again.n_calls
        assert len(set(after.values())) > 8  # the images and questions do reach the model
        _check_what_it_says(model, folder, second)
    finally:
        first.kill()
        second.kill()


def _check_what_it_says(model, folder, served):
    """The same call again gives the same text; a wrong model is told, not asked for ever."""
    images, questions = [draw(1, (64, 64)), draw(2, (64, 64))], ["Is the door open?", "Is it shut?"]
    one, two = (
        {(r.image, r.question): r.outcome for r in model.answer(images, questions)}
        for _ in range(2)
    )
    assert one == two
    assert len(set(one.values())) > 1
    budget = CallBudget(retries=1, first_wait_seconds=0.01)
    wrong = ServerModel(f"{served.url}/v1", str(folder / "no"), "server:no", budget=budget)
    outcome = next(wrong.answer(images, questions)).outcome
    assert isinstance(outcome, Failure)
    assert "failed (500" in outcome.reason
    with pytest.raises(HTTPError, match="404"):
        urlopen(f"{served.url}/chat/completions", timeout=5)  # noqa: S310
    lost = ServerModel(served.url, str(folder), "server:lost", budget=budget)
    assert f"answer under {served.url}/v1" in next(lost.answer(images, questions)).outcome.reason
