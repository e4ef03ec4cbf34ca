"""What a decision takes: a model whose costs are known is measured right, and only once."""

import time

import pytest

from vqa_state.answers import Answer
from vqa_state.checking import Pace
from vqa_state.models.base import Failure, Reply
from vqa_state.pace import keep_pace, milliseconds, read_pace


class Slow:
    """Takes 30 ms an image and 5 ms a question."""

    name, fingerprint, notes = "slow", "slow/1", ()

    def __init__(self, outcome=None):
        self.n_runs, self.outcome = 0, outcome or Answer("yes")

    def answer(self, images, questions):
        self.n_runs += 1
        for i, _ in enumerate(images):
            time.sleep(0.03)
            for q, _ in enumerate(questions):
                time.sleep(0.005)
                yield Reply(i, q, self.outcome)


def test_the_two_parts_are_told_apart_and_kept(project):
    model = Slow()
    project.fingerprint = model.fingerprint
    pace = keep_pace(project, model)
    assert pace.image >= 0.01
    assert 0.004 < pace.question < 0.05
    n_runs = model.n_runs
    assert keep_pace(project, model) == read_pace(project) == pace
    assert model.n_runs == n_runs
    project.fingerprint = "other"
    assert read_pace(project) is None


def test_milliseconds_of_a_decision():
    assert milliseconds(Pace(0.030, 0.005), 10, 6) == pytest.approx(6 * (30 + 50))
    assert milliseconds(None, 10, 6) is None


def test_what_costs_money_or_fails_is_not_measured(project):
    paid = Slow()
    paid.name = "server:http://localhost:1/v1#x"
    assert keep_pace(project, paid) is None
    assert paid.n_runs == 0
    assert keep_pace(project, Slow(Failure("busy"))) is None
    (project.folder / "pace.json").write_text("{")
    assert read_pace(project) is None
