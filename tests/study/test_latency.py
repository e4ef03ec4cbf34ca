"""What a decision takes: a model whose costs are known is measured right, and only once."""

import time

import pytest

from vqa_state.answers.answer import Answer
from vqa_state.models import Failure, Reply
from vqa_state.models.capability_cache import known_model
from vqa_state.models.vision_check import N_CALLS
from vqa_state.study.latency import estimate, keep_pace, milliseconds, read_pace
from vqa_state.study.vision_check import Pace, check_model, first_look
from vqa_state.testing.fake_model import ScriptedModel


@pytest.fixture(autouse=True)
def _own_home(data_home):
    """Nothing is known of any model."""


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


def test_a_project_from_another_machine_is_measured_here(project, data_home):
    model = Slow()
    project.fingerprint = model.fingerprint
    keep_pace(project, model)
    (data_home / "known_models.json").unlink()
    n_runs = model.n_runs
    assert keep_pace(project, model) is not None
    assert model.n_runs > n_runs
    assert known_model(model.fingerprint).image is not None


# ---- a stop --------------------------------------------------------------------------------


class Hanging(Slow):
    """Hangs in every call, and gives up when it is told to."""

    def answer_until(self, images, questions, stop):
        until = time.monotonic() + 20
        while not stop() and time.monotonic() < until:
            time.sleep(0.01)
        yield from ()


def test_a_stop_ends_the_measurement_and_nothing_is_kept(project):
    began = time.monotonic()
    assert keep_pace(project, Hanging(), lambda: time.monotonic() - began > 0.2) is None
    assert time.monotonic() - began < 1
    model = ScriptedModel(lambda i, q: Answer("yes"))
    project.fingerprint = model.fingerprint
    for n_before in range(2 * (1 + len(project.questions()))):
        n_start = len(model.asked)
        stop = lambda n=n_start + n_before: len(model.asked) > n  # noqa: E731
        assert keep_pace(project, model, stop) is None
        assert len(model.asked) <= n_start + n_before + 1
    assert read_pace(project) is known_model(model.fingerprint) is None


# ---- what asking will cost -----------------------------------------------------------------


def test_the_cost_of_a_model_that_is_not_known_is_calls(project):
    cost = estimate(project, "never/1")
    assert cost.plan.n_to_ask == cost.plan.n_calls == 6 * 2 * 16
    assert (cost.seconds, cost.memory, cost.n_look) == (None, None, N_CALLS)


def test_what_was_found_out_is_part_of_the_cost(project):
    model = Slow()
    *_, last = check_model(model)
    cost = estimate(project, model.fingerprint)
    assert cost.seconds == pytest.approx(last.result.pace.seconds(cost.plan))
    assert cost.seconds > 12 * 16 * 0.005
    assert cost.memory == last.result.memory
    assert cost.n_look == 0


def test_a_look_alone_tells_nothing_of_time(project):
    model = Slow()
    list(first_look(model))
    cost = estimate(project, model.fingerprint)
    assert (cost.seconds, cost.n_look) == (None, 0)
    keep_pace(project, model)
    assert estimate(project, model.fingerprint).seconds is not None
