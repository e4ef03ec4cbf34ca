"""A server that says when to come again is obeyed, for as long as one answer may take."""

import time

import openai  # noqa: F401 - now, for it takes seconds, and tests below look at the clock
import pytest
from pictures import draw
from server_cases import answers, model_of, outcomes
from stub_server import Result, good

from vqa_state.answers.answer import Answer
from vqa_state.models.server.model import CallBudget
from vqa_state.study.collect import ask, plan


class Closing:
    """Answers some calls, then closes for a time; `early` counts who comes before it is over."""

    def __init__(self, seconds, after=5, status=429):
        self.seconds, self.after, self.status = seconds, after, status
        self.until = None
        self.early = 0

    def __call__(self, call, handler):
        if self.until is None and call.number >= self.after:
            self.until = time.monotonic() + self.seconds
        elif self.until is None or time.monotonic() >= self.until:
            return good(call, handler)
        else:
            self.early += 1
        headers = {"retry-after": f"{self.seconds:g}"}
        return Result({"error": "busy"}, self.status, headers)


@pytest.mark.parametrize("status", [429, 503])
def test_a_wait_longer_than_our_own_is_kept_and_nothing_is_lost(stub, project, status):
    stub.script = closing = Closing(1.5, status=status)
    budget = CallBudget(first_wait_seconds=0.01, longest_wait_seconds=0.1, max_parallel=1)
    last = list(ask(project, model_of(stub, budget)))[-1]
    assert (last.n_asked, last.n_failed) == (last.n_calls, 0)
    assert closing.early == 0


@pytest.mark.parametrize("seconds", ["40", "299"])
def test_a_long_wait_ends_with_a_stop(stub, seconds):
    stub.script = answers({"error": "busy"}, 429, retry_after=seconds)
    stopped_at = []

    def stop():
        if stub.calls and time.monotonic() - stub.calls[0].began > 0.4 and not stopped_at:
            stopped_at.append(time.monotonic())
        return bool(stopped_at)

    replies = list(model_of(stub, CallBudget()).answer_until([draw(0)], ["a", "b"], stop))
    assert replies == []
    assert time.monotonic() - stopped_at[0] < 1
    assert len(stub.calls) == 1


def test_whoever_gives_up_keeps_the_wait_too_and_can_ask_again_after_it(stub, project):
    stub.script = closing = Closing(2.0)
    model = model_of(stub, CallBudget(answer_seconds=0.5, max_parallel=1))
    first = list(ask(project, model))[-1]
    assert (first.n_asked, first.n_failed) == (5, first.n_calls - 5)
    assert "asks to wait 2 seconds" in first.last_failure
    n_calls = len(stub.calls)
    assert n_calls == 6
    again = list(ask(project, model))[-1]
    assert "seconds" in again.last_failure
    assert (again.n_asked, len(stub.calls)) == (0, n_calls)
    time.sleep(max(0.0, closing.until - time.monotonic() + 0.05))
    last = list(ask(project, model))[-1]
    assert (last.n_stored, last.n_failed, closing.early) == (5, 0, 0)
    assert plan(project, model.fingerprint).n_to_ask == 0


def test_who_waits_longer_than_an_answer_may_take_fails_by_the_servers_words(stub):
    stub.script = Closing(0.4, after=1)
    model = model_of(stub, CallBudget(answer_seconds=0.5, max_parallel=1))
    assert outcomes(model, ["q"])[0, "q"] == Answer("Yes.")
    stub.script = answers({"error": "busy"}, 429, retry_after="0.4")
    found = outcomes(model, ["a", "b", "c"])
    for failure in found.values():
        assert "too many requests" in failure.reason
