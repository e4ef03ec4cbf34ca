"""A server's model against a stub: what is sent, what is understood, how many calls at once."""

import asyncio
import base64
import io
import threading
import time

import numpy as np
import pytest
from pictures import draw
from PIL import Image
from server_cases import (
    answers,
    cut_off,
    error,
    model_of,
    outcomes,
)
from stub_server import Result, completion, free_port, good

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models.server.model import DEFAULT_PROMPT, CallBudget, ServerModel, list_models
from vqa_state.study.collect import ask, plan

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
