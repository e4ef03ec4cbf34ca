"""A server's model against a stub: every fault ends in a sentence for its answer alone."""

import re
import threading
import time

import openai  # noqa: F401 - now, for it takes seconds, and tests below look at the clock
import pytest
from pictures import draw
from server_cases import IMPATIENT, answers, cut_off, error, hang, model_of, only_bad, outcomes
from stub_server import Result, Stub, completion, good

from vqa_state.answers.answer import Answer
from vqa_state.models import Failure
from vqa_state.models.server.model import CallBudget


def drip(call, handler):
    handler.head(200, 10_000)
    for _ in range(100):
        handler.wfile.write(b" ")
        handler.wfile.flush()
        time.sleep(0.03)


def flood(call, handler):
    handler.head(200, 50_000_000)
    for _ in range(50):
        handler.wfile.write(b" " * 1_000_000)


FAULTS = {  # name: (script, a part of the sentence, tries)
    "400": (error(400, "no image support"), r"did not accept .*400: no image support", 2),
    "413": (error(413), "did not accept", 1),
    "422": (answers({"detail": "strange field"}, 422), "422: strange field", 2),
    "429": (error(429, "slow down"), r"too many requests now \(429: slow down\)", 3),
    "500": (error(500, "boom"), r"failed \(500: boom\).* named m", 3),
    "503": (error(503, "loading"), "503: loading", 3),
    "null": (answers(completion(None)), "gave an empty answer", 1),
    "blank": (answers(completion(" \n")), "gave an empty answer", 1),
    "list": (answers(completion(["yes"])), "gave an empty answer", 1),
    "no choices": (answers({"choices": []}), "no choices", 3),
    "no message": (answers({"choices": [{}]}), "gave an empty answer", 1),
    "html": (answers("<html>log in</html>"), "a web page instead of an answer", 3),
    "html 502": (answers("<html>bad</html>", 502), "502: a web page", 3),
    "broken json": (answers('{"choices": [{"mess'), "no JSON", 3),
    "a number": (answers("7"), "no JSON", 3),
    "deep json": (answers("[" * 100_000), "no JSON", 3),
    "reset": (cut_off, "broke the connection off", 3),
    "flood": (flood, "broke the connection off", 3),
    "packed": (answers(b"xx", content_encoding="gzip"), "broke the connection off", 3),
    "bytes": (answers(b"\xff\xfe\x00"), "no JSON", 3),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_ends_in_a_sentence_for_its_answer_alone_and_can_be_asked_again(stub, name):
    script, sentence, n_tries = FAULTS[name]
    stub.script = only_bad(script)
    model = model_of(stub)
    found = outcomes(model, ["bad", "good", "fine"])
    assert found[0, "good"] == found[0, "fine"] == Answer("Yes.")
    failure = found[0, "bad"]
    assert isinstance(failure, Failure)
    assert re.search(sentence, failure.reason), failure.reason
    assert sum(call.question.startswith("bad") for call in stub.calls) == n_tries
    stub.script = good
    assert outcomes(model, ["bad"]) == {(0, "bad"): Answer("Yes.")}


@pytest.mark.parametrize("script", [hang, drip])
def test_no_whole_answer_in_time_is_a_failure(stub, script):
    stub.script = only_bad(script)
    began = time.monotonic()
    found = outcomes(model_of(stub, IMPATIENT), ["good", "bad"])
    assert "no whole answer within 0.2 seconds" in found[0, "bad"].reason
    assert found[0, "good"] == Answer("Yes.")
    # Two tries of 0.2 seconds, and what a busy machine adds: 0.9 at most in ten runs.
    assert 0.4 < time.monotonic() - began < 1.5


def test_an_answer_has_a_deadline_with_all_its_tries(stub):
    stub.script = only_bad(error(500))
    budget = CallBudget(retries=1000, run_retries=1000, answer_seconds=0.3, first_wait_seconds=0.02)
    began = time.monotonic()
    assert "500" in outcomes(model_of(stub, budget), ["bad"])[0, "bad"].reason
    assert 0.2 < time.monotonic() - began < 0.8


@pytest.mark.parametrize(
    ("status", "sentence", "n_calls"),
    [
        (401, r"wants a key \(401\).*VQA_STATE_KEYS", 2),
        (403, "may forbid the question or the image; or.* may want a key.*VQA_STATE_KEYS", 16),
        (404, r"no model named m, or no chat completions .*404: who\?", 2),
        (405, "no model named m", 2),
        (302, r"another address \(302\), which is not followed", 2),
    ],
)
def test_what_no_call_can_change_soon_fails_all_with_one_sentence(stub, status, sentence, n_calls):
    stub.script = error(status, "who?")
    found = outcomes(model_of(stub), [f"q{n}" for n in range(50)])
    reasons = {failure.reason for failure in found.values()}
    assert len(stub.calls) == n_calls  # a second opinion, or more where it may be the question
    assert len(reasons) == 1
    assert re.search(sentence, reasons.pop())


def test_a_server_that_is_gone_is_not_waited_for_by_every_pair_and_is_found_again():
    with Stub() as gone:
        model = model_of(gone)
        assert outcomes(model, ["q"])[0, "q"] == Answer("Yes.")
    began = time.monotonic()
    for _ in range(20):
        found = outcomes(model, [f"q{n}" for n in range(64)])
        assert {type(one) for one in found.values()} == {Failure}
    assert "nothing answers at" in found[0, "q0"].reason
    assert (
        time.monotonic() - began < 2
    )  # 20 runs of 64 pairs; each pair has tries and waits to lose
    with Stub(port=gone.port):
        assert set(outcomes(model).values()) == {Answer("Yes.")}


def test_a_run_does_not_try_again_for_ever(stub):
    stub.script = error(500)
    budget = CallBudget(retries=5, run_retries=7, first_wait_seconds=0.001, max_parallel=1)
    outcomes(model_of(stub, budget), [f"q{n}" for n in range(40)])
    assert len(stub.calls) == 16 + 7  # 16 pairs in a row without an answer; then all have failed


def test_answers_that_come_give_retries_back(stub):
    stub.script = lambda call, handler: (
        error(500)(call, handler) if call.number % 2 else good(call, handler)
    )
    budget = CallBudget(retries=1, run_retries=2, first_wait_seconds=0.001, max_parallel=1)
    found = outcomes(model_of(stub, budget), [f"q{n}" for n in range(40)])
    assert set(found.values()) == {Answer("Yes.")}


# Waiting as asked


def first_429(headers, times):
    def script(call, handler):
        times.append(call.began)
        return Result({"error": "busy"}, 429, headers) if call.number == 0 else good(call, handler)

    return script


def test_retry_after_is_waited_for(stub):
    times: list[float] = []
    stub.script = first_429({"retry-after": "0.25"}, times)
    assert outcomes(model_of(stub), ["q"])[0, "q"] == Answer("Yes.")
    assert 0.25 <= times[1] - times[0] < 1


def test_a_wait_that_is_too_long_is_left_to_the_user(stub):
    stub.script = answers({"error": "quota"}, 429, retry_after="3600")
    began = time.monotonic()
    found = outcomes(model_of(stub), [f"q{n}" for n in range(20)])
    assert "asks to wait 3600 seconds" in found[0, "q0"].reason
    assert time.monotonic() - began < 1
    assert len(stub.calls) == 1


# Stopping


@pytest.mark.parametrize("script", [hang, error(500)], ids=["hanging", "backing off"])
def test_a_stop_ends_within_a_second_while_nothing_comes(stub, script):
    stub.script = only_bad(script)
    slow = CallBudget(retries=100, first_wait_seconds=30.0, longest_wait_seconds=60.0)
    model, stopped_at = model_of(stub, slow), []

    def stop():
        if len(stub.calls) > 1 and not stopped_at:
            stopped_at.append(time.monotonic())
        return bool(stopped_at)

    replies = list(model.answer_until([draw(0)], ["good", "bad", "bad 2", "bad 3"], stop))
    assert time.monotonic() - stopped_at[0] < 1
    assert [reply.question for reply in replies] == [0]


def test_closing_the_iterator_cancels_the_calls_in_flight(stub):
    gone = threading.Semaphore(0)

    def script(call, handler):
        if call.number < 40:
            return good(call, handler)
        assert handler.connection.recv(1) == b""  # the caller hung up
        gone.release()
        return None

    stub.script = script
    replies = model_of(stub).answer([draw(0)], [f"q{n}" for n in range(200)])
    for _ in range(40):
        next(replies)
    deadline = time.monotonic() + 5
    while len(stub.calls) == 40 and time.monotonic() < deadline:
        time.sleep(0.01)
    began = time.monotonic()
    replies.close()
    assert time.monotonic() - began < 1
    for _ in stub.calls[40:]:
        assert gone.acquire(timeout=1)
    n_calls = len(stub.calls)
    time.sleep(0.1)
    assert len(stub.calls) == n_calls


def test_who_does_not_read_is_not_asked_on_for(stub):
    replies = model_of(stub).answer([draw(0)], [f"q{n}" for n in range(500)])
    assert stub.calls == []
    next(replies)
    time.sleep(0.5)
    assert 1 <= len(stub.calls) < 60
    replies.close()
