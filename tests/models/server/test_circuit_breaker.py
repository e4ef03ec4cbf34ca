"""What concerns one question or image fails alone; a server that answers nobody ends the run."""

import time
from dataclasses import replace

import openai  # noqa: F401 - now, for it takes seconds, and tests below look at the clock
import pytest
from pictures import draw
from server_cases import QUICK, answers, error, hang, model_of, outcomes
from stub_server import Result, free_port, good

from vqa_state.answers.answer import Answer
from vqa_state.models import Failure
from vqa_state.models.server.model import CallBudget, ServerModel
from vqa_state.study.collect import ask, plan

ONE = CallBudget(retries=1, first_wait_seconds=0.01, deadline_seconds=0.3, max_parallel=1)


def one_for(name):
    """`ONE` for a server that hangs; for all others with a deadline that a busy machine keeps."""
    return ONE if name == "hang" else replace(ONE, deadline_seconds=10.0)


def picture_of(call):
    return call.body["messages"][0]["content"][0]["image_url"]["url"]


def poisoned(script, is_bad):
    """A script for the calls that `is_bad` tells; all others are answered."""
    return lambda call, handler: script(call, handler) if is_bad(call) else good(call, handler)


def slow(call, handler):
    time.sleep(0.02)
    return good(call, handler)


def redirect(call, handler):
    return Result("", 302, {"location": "http://127.0.0.1:1/"})


FAULTS = {
    **{str(status): error(status, "no") for status in (400, 401, 403, 404, 405, 413, 429, 500)},
    "302": redirect,
    "html": answers("<html>"),
    "hang": hang,
    "reset": lambda call, handler: handler.reset(),
}


# One question, one image


@pytest.mark.parametrize(("name", "place"), [*((name, 0) for name in FAULTS), ("403", 4)])
def test_one_forbidden_question_leaves_its_neighbours_alone(stub, name, place):
    questions = [f"q{n:02}" for n in range(16)]
    stub.script = poisoned(FAULTS[name], lambda call: call.question.startswith(questions[place]))
    found = outcomes(model_of(stub, one_for(name)), questions, [draw(0), draw(1)])
    failed = {key for key, outcome in found.items() if isinstance(outcome, Failure)}
    assert failed == {(0, questions[place]), (1, questions[place])}


@pytest.mark.parametrize("name", ["400", "403", "404", "500", "html"])
@pytest.mark.parametrize("n_good", [1, 8])
def test_many_forbidden_questions_leave_the_others_alone(stub, name, n_good):
    """Also when the server has not answered anything yet."""
    questions = [f"q{n:02}" for n in range(16)]
    stub.script = poisoned(FAULTS[name], lambda call: call.question[:3] < questions[-n_good])
    budget = CallBudget(retries=0, max_parallel=1)
    found = outcomes(model_of(stub, budget), questions, [draw(0)])
    answered = {question for (_, question), one in found.items() if isinstance(one, Answer)}
    if name == "404":  # it says itself that nothing is there
        assert answered in (set(), set(questions[-n_good:]))
    else:
        assert answered == set(questions[-n_good:])


@pytest.mark.parametrize("name", ["403", "404", "500", "302", "hang"])
def test_a_poisonous_image_leaves_the_other_images_alone(stub, project, name):
    first = []
    probe, once = model_of(stub, one_for(name)), replace(one_for(name), retries=0)
    stub.script = poisoned(good, lambda call: bool(first.append(picture_of(call))))
    next(report for report in ask(project, probe) if report.n_asked)
    images = set(first[:1])  # one copy of the first image
    fresh = model_of(stub, once, model="other")
    stub.script = poisoned(FAULTS[name], lambda call: picture_of(call) in images)
    last = list(ask(project, fresh))[-1]
    assert 1 <= last.n_failed <= 32  # its own 32 pairs at most
    assert last.n_asked == last.n_calls - last.n_failed
    stub.script = good
    assert list(ask(project, fresh))[-1].n_failed == 0


def test_what_a_server_forbids_for_ever_is_all_that_stays_missing(stub, project):
    texts = [question.text for question in project.questions()]
    stub.script = poisoned(error(403), lambda call: call.question.startswith(texts[0]))
    for _ in range(2):
        model = model_of(stub)  # a new program
        last = list(ask(project, model))[-1]
        assert plan(project, model.fingerprint).n_to_ask == 12
        assert "key" not in last.last_failure.partition(";")[0]
    assert last.n_failed == 12


# Nobody gets an answer


@pytest.mark.parametrize("name", FAULTS)
def test_a_server_that_answers_nobody_ends_the_run_and_is_asked_again_later(stub, project, name):
    stub.script = FAULTS[name]
    model = model_of(stub, one_for(name))
    began = time.monotonic()
    last = list(ask(project, model))[-1]
    took = time.monotonic() - began
    assert (last.n_failed, last.n_asked, last.n_left) == (last.n_calls, 0, 0)
    assert not last.stopped
    assert last.last_failure.count("http://") >= 1
    assert len(stub.calls) <= {"hang": 4, "401": 3, "404": 3, "405": 3, "302": 3}.get(name, 40)
    # A hanging server: two tries, another question, another image; not one deadline an image.
    assert took < 4 * 0.3 + 1.0
    stub.script = good
    again = list(ask(project, model))[-1]
    assert (again.n_asked, again.n_failed) == (again.n_calls, 0)


def test_a_server_that_dies_in_the_middle_ends_the_run_with_all_that_it_said(stub, project):
    stub.script = lambda call, handler: (hang if call.number >= 50 else good)(call, handler)
    model = model_of(stub, ONE)
    last = list(ask(project, model))[-1]
    assert (last.n_asked, last.n_failed) == (50, last.n_calls - 50)
    assert len(stub.calls) == 54
    stub.script = good
    assert list(ask(project, model))[-1].n_asked == last.n_failed


def test_many_calls_at_once_that_hang_are_given_up_together(stub, project):
    stub.script = lambda call, handler: (hang if call.number >= 100 else slow)(call, handler)
    # a deadline that no answer of a busy machine misses
    model = model_of(stub, replace(ONE, max_parallel=8, deadline_seconds=1.0))
    last = list(ask(project, model))[-1]
    assert stub.most_at_once > 1
    assert 100 <= last.n_asked < 110
    assert last.n_failed == last.n_calls - last.n_asked
    # Two tries each: those that were open before the last answer, so that they say nothing, and
    # those that followed them; then another question, and another image.
    assert len(stub.calls) <= 100 + 2 * 8 + 2 * 8 + 2
    stub.script = good
    assert list(ask(project, model))[-1].n_asked == last.n_failed


def test_the_default_budget_is_no_call_for_every_pair(stub, make_project):
    project = make_project(n_train=4, n_test=4, n_copies=3)
    stub.script = answers("<html>log in</html>")
    budget = CallBudget(first_wait_seconds=0.001, longest_wait_seconds=0.002)
    last = list(ask(project, model_of(stub, budget)))[-1]
    assert last.n_failed == last.n_calls > 700
    assert len(stub.calls) <= 80


def test_nobody_there_ends_the_run(project):
    url = f"http://127.0.0.1:{free_port()}/v1"
    model = ServerModel(url, "m", "server:test", budget=QUICK)
    last = list(ask(project, model))[-1]
    assert last.n_failed == last.n_calls
    assert "nothing answers at" in last.last_failure


def test_forbidden_questions_that_stand_together_do_not_hide_the_others(stub):
    questions = [f"q{n:02}" for n in range(40)]
    stub.script = poisoned(error(403), lambda call: call.question < "q20")
    found = outcomes(model_of(stub), questions)
    assert sum(isinstance(one, Answer) for one in found.values()) == 20


def test_a_server_that_fails_half_of_the_time_is_not_given_up(stub):
    stub.script = lambda call, handler: (
        error(500)(call, handler) if call.number % 2 else good(call, handler)
    )
    budget = CallBudget(retries=0, max_parallel=1)
    found = outcomes(model_of(stub, budget), [f"q{n}" for n in range(100)])
    assert len(stub.calls) == 100
    assert sum(isinstance(one, Answer) for one in found.values()) == 50
