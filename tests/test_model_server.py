"""A server's model against a stub: every fault ends in a sentence for its answer alone."""

import asyncio
import base64
import io
import re
import threading
import time

import numpy as np
import openai  # noqa: F401 - now, for it takes seconds, and tests below look at the clock
import pytest
from pictures import draw
from PIL import Image
from stub_server import Result, Stub, completion, free_port, good

from vqa_state.answers import Answer
from vqa_state.asking import ask, plan
from vqa_state.errors import ModelError
from vqa_state.models.base import Failure
from vqa_state.models.server import DEFAULT_PROMPT, CallBudget, ServerModel, list_models

QUICK = CallBudget(
    retries=2, deadline_seconds=5.0, first_wait_seconds=0.01, longest_wait_seconds=0.3
)
IMAGES = (draw(0),)
IMPATIENT = CallBudget(retries=1, deadline_seconds=0.2, first_wait_seconds=0.01)


@pytest.fixture(autouse=True)
def bare_environment(monkeypatch):
    for name in ("VQA_STATE_KEYS", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def stub():
    with Stub() as server:
        yield server


def model_of(stub, budget=QUICK, model="m", prompt=""):
    return ServerModel(stub.url, model, f"server:{stub.url}#{model}", prompt, budget=budget)


def outcomes(model, questions=("good", "bad"), images=IMAGES):
    """(image, question) -> outcome; every pair must come exactly once."""
    replies = list(model.answer(images, questions))
    found = {(reply.image, questions[reply.question]): reply.outcome for reply in replies}
    assert len(found) == len(replies) == len(images) * len(questions)
    return found


def only_bad(script):
    """A script for the question "bad"; all others are answered."""

    def chosen(call, handler):
        return script(call, handler) if call.question.startswith("bad") else good(call, handler)

    return chosen


# What is sent and what comes back


def test_every_pair_is_answered_once_and_the_image_is_sent_before_the_question(stub):
    def telling(call, handler):
        url = call.body["messages"][0]["content"][0]["image_url"]["url"]
        pixels = Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2])))
        return Result(completion(f"{pixels.getpixel((0, 0))} {call.question}"))

    stub.script = telling
    images = [draw(n, (40, 40)) for n in range(3)]
    questions = [f"q{n}" for n in range(30)]
    found = outcomes(model_of(stub, prompt="Say: {question}"), questions, images)
    for (i, question), answer in found.items():
        assert answer == Answer(f"{images[i].getpixel((0, 0))} Say: {question}")
    body = stub.calls[0].body
    assert stub.calls[0].path == "/v1/chat/completions"
    assert (body["model"], body["temperature"], body["max_tokens"]) == ("m", 0, 8)
    assert [part["type"] for part in body["messages"][0]["content"]] == ["image_url", "text"]


@pytest.mark.parametrize(
    ("size", "sent"),
    [((1, 1), (32, 32)), ((640, 480), (640, 480)), ((8000, 20), (1024, 32)), ((9, 900), (32, 900))],
)
def test_an_image_is_sent_as_its_pixels_within_bounds(stub, size, sent):
    image = Image.effect_noise(size, 90).convert("RGB")
    image.info = {"icc_profile": b"secret place", "comment": "secret place"}
    assert outcomes(model_of(stub), ["q"], [image]) == {(0, "q"): Answer("Yes.")}
    url = stub.calls[0].body["messages"][0]["content"][0]["image_url"]["url"]
    data = base64.b64decode(url.removeprefix("data:image/png;base64,"))
    got = Image.open(io.BytesIO(data))
    assert got.size == sent
    assert b"secret place" not in data
    assert got.info == {}
    if size == sent:
        assert (np.asarray(got) == np.asarray(image)).all()


def test_nothing_to_ask_asks_nothing(stub):
    model = model_of(stub)
    assert list(model.answer([], ["q"])) == list(model.answer([draw(0)], [])) == []
    assert stub.calls == []


def test_the_fingerprint_holds_all_that_can_change_an_answer_and_no_more():
    def of(url="http://h:1/v1", model="m", prompt="", **budget):
        return ServerModel(url, model, "n", prompt, budget=CallBudget(**budget)).fingerprint

    prints = [
        of(),
        of("https://h:1/v1"),
        of("http://i:1/v1"),
        of("http://h:2/v1"),
        of("http://h:1"),
    ]
    prints += [of(model="k"), of(prompt="{question}!")]
    assert len(set(prints)) == len(prints)
    assert of() == of("HTTP://H:1/v1/") == of(max_parallel=1) == of(prompt=DEFAULT_PROMPT)
    assert of("http://h:80/v1") == of("http://h/v1")
    for part in ("http://h:1/v1", "m", DEFAULT_PROMPT, "temperature 0", "8 tokens", "PNG"):
        assert part in of()


def test_the_notes_say_where_images_go_and_what_nobody_knows():
    here, there = (ServerModel(f"http://{h}:1/v1", "m", "n") for h in ("127.0.0.1", "gpu.lan"))
    assert "on this machine" in here.notes[0]
    assert "images go there" in there.notes[0]
    assert "may change its model under the same name" in here.notes[1]


@pytest.mark.parametrize(
    "url",
    [
        "ftp://h/v1",
        "h:8000",
        "",
        "http://",
        "http://u:p@h/v1",
        "http://h/v1?key=k",
        "http://h:99999",
    ],
)
def test_a_url_that_is_none_is_refused_without_repeating_it(url):
    for use in (lambda: ServerModel(url, "m", "n"), lambda: list_models(url)):
        with pytest.raises(ModelError, match=r"http://127\.0\.0\.1:8000/v1") as caught:
            use()
        assert "u:p" not in str(caught.value)
        assert "key=k" not in str(caught.value)


def test_a_model_and_a_prompt_are_needed():
    with pytest.raises(ModelError, match="say which model"):
        ServerModel("http://h/v1", "", "n")
    with pytest.raises(ModelError, match=r"must hold \{question\} once"):
        ServerModel("http://h/v1", "m", "n", "no place")


# Faults


def drip(call, handler):
    handler.head(200, 10_000)
    for _ in range(100):
        handler.wfile.write(b" ")
        handler.wfile.flush()
        time.sleep(0.03)


def cut_off(call, handler):
    handler.head(200, 10_000)
    handler.wfile.write(b'{"choices": [')
    handler.wfile.flush()
    handler.reset()


def hang(call, handler):
    handler.connection.recv(1)  # until the caller goes away


def flood(call, handler):
    handler.head(200, 50_000_000)
    for _ in range(50):
        handler.wfile.write(b" " * 1_000_000)


def answers(body, status=200, **headers):
    return lambda call, handler: Result(body, status, headers)


def error(status, message="no"):
    return answers({"error": {"message": message}}, status)


FAULTS = {  # name: (script, a part of the sentence, tries)
    "400": (error(400, "no image support"), r"did not accept .*400: no image support", 2),
    "413": (error(413), "did not accept", 1),
    "422": (answers({"detail": "strange field"}, 422), "422: strange field", 2),
    "429": (error(429, "slow down"), r"too many requests now \(429: slow down\)", 3),
    "500": (error(500, "boom"), r"failed \(500: boom\).* named m", 3),
    "503": (error(503, "loading"), "503: loading", 3),
    "null": (answers(completion(None)), "gave an empty answer", 1),
    "blank": (answers(completion(" \n")), "gave an empty answer", 1),
    "thought": (answers(completion("", finish_reason="length")), "thinking off", 1),
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
    ("status", "sentence"),
    [
        (401, r"wants a key \(401\).*VQA_STATE_KEYS"),
        (403, "wants a key"),
        (404, r"no model named m, or no chat completions .*404: who\?"),
        (405, "no model named m"),
        (302, r"another address \(302\), which is not followed"),
    ],
)
def test_what_no_call_can_change_fails_all_at_once_with_one_sentence(stub, status, sentence):
    stub.script = error(status, "who?")
    found = outcomes(model_of(stub), [f"q{n}" for n in range(50)])
    reasons = {failure.reason for failure in found.values()}
    assert len(reasons) == len(stub.calls) == 1
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
    assert len(stub.calls) == 40 + 7


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


# How many at once


def slow_good(seconds, at_once):
    """Answers after a time, `at_once` of them together."""
    gate = threading.Semaphore(at_once)

    def script(call, handler):
        with gate:
            time.sleep(seconds)
        return good(call, handler)

    return script


def test_calls_are_bounded_and_grow_to_what_pays(stub):
    stub.script = slow_good(0.15, at_once=100)  # so long that a busy machine does not matter
    model = model_of(stub, CallBudget(max_parallel=6))
    outcomes(model, [f"q{n}" for n in range(60)])
    assert 2 <= stub.most_at_once <= 6


def test_a_server_that_takes_one_after_another_is_not_crowded(stub):
    stub.script = slow_good(0.05, at_once=1)
    model = model_of(stub, CallBudget(max_parallel=16))
    outcomes(model, [f"q{n}" for n in range(40)])
    assert stub.most_at_once <= 4


def test_threads_may_share_a_model_and_a_loop_may_run_already(stub):
    model, found = model_of(stub), []
    threads = [threading.Thread(target=lambda: found.append(outcomes(model))) for _ in range(4)]
    for thread in threads:
        thread.start()

    async def inside():
        return outcomes(model)

    found.append(asyncio.run(inside()))
    for thread in threads:
        thread.join()
    assert found == [{(0, "good"): Answer("Yes."), (0, "bad"): Answer("Yes.")}] * 5


# What servers understand


def logprobs(**p):
    top = [{"token": token, "logprob": float(np.log(value))} for token, value in p.items()]
    return {"content": [{"token": "Yes", "logprob": top[0]["logprob"], "top_logprobs": top}]}


def test_how_sure_it_is_comes_from_the_first_token(stub):
    stub.script = answers(completion("Yes.", logprobs=logprobs(Yes=0.6, yes=0.1, No=0.2, NO=0.05)))
    assert outcomes(model_of(stub), ["q"])[0, "q"] == Answer("Yes.", round(0.7 / 0.95, 6))


@pytest.mark.parametrize("status", [400, 422, 501])
def test_a_server_without_probabilities_is_asked_without_from_then_on(stub, status):
    def script(call, handler):
        if "logprobs" in call.body:
            return Result({"error": {"message": "logprobs not supported"}}, status)
        return good(call, handler)

    stub.script = script
    found = outcomes(model_of(stub, CallBudget(max_parallel=1)), [f"q{n}" for n in range(20)])
    assert set(found.values()) == {Answer("Yes.", None)}
    assert len(stub.calls) == 21
    assert "top_logprobs" not in stub.calls[-1].body


def test_a_server_that_wants_another_name_for_the_limit_gets_it(stub):
    def script(call, handler):
        if "max_tokens" in call.body:
            return Result({"error": {"message": "use 'max_completion_tokens' instead"}}, 400)
        return good(call, handler)

    stub.script = script
    found = outcomes(model_of(stub, CallBudget(max_parallel=1)), ["a", "b", "c"])
    assert set(found.values()) == {Answer("Yes.")}
    assert len(stub.calls) == 4
    assert stub.calls[-1].body["max_completion_tokens"] == 8
    assert stub.calls[-1].body["logprobs"] is True


# Listing models


def test_models_are_listed_in_the_servers_order(stub):
    stub.script = answers({"data": [{"id": "b"}, {"id": "a"}, {"id": "b"}, {"no": 1}, 7]})
    assert list_models(stub.url) == ("b", "a")
    assert stub.calls[0].path == "/v1/models"


@pytest.mark.parametrize(
    ("script", "sentence"),
    [
        (error(404), "no list of models .*with /v1 at the end"),
        (error(401), "wants a key"),
        (error(500), r"failed \(500: no\); see its own log$"),
        (answers("<html>"), "check the address; most servers answer under"),
        (answers({"data": 5}), "check the address"),
        (cut_off, "broke the connection off"),
    ],
)
def test_a_list_that_does_not_come_is_explained(stub, script, sentence):
    stub.script = script
    with pytest.raises(ModelError, match=sentence):
        list_models(stub.url.removesuffix("/v1"))


def test_no_server_no_list():
    with pytest.raises(ModelError, match="nothing answers at"):
        list_models(f"http://127.0.0.1:{free_port()}/v1")


# Through asking


def test_failures_are_counted_shown_and_asked_again(stub, project):
    stub.script = lambda call, handler: (
        error(400)(call, handler) if "closed" in call.question else good(call, handler)
    )
    model = model_of(stub)
    last = list(ask(project, model))[-1]
    assert last.n_failed > 0
    assert last.n_asked + last.n_failed == last.n_calls
    assert "did not accept" in last.last_failure
    stub.script = good
    again = list(ask(project, model))[-1]
    assert (again.n_asked, again.n_failed) == (last.n_failed, 0)
    assert plan(project, model.fingerprint).n_to_ask == 0
