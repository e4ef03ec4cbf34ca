"""Servers that send what no server should: the run goes on, and an error repeats none of it."""

import re

import openai  # noqa: F401 - now, for it takes seconds
import pytest
from server_cases import QUICK, answers, error, model_of, only_bad, outcomes
from stub_server import Result, completion, good

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models import Failure
from vqa_state.models.server import call as server_calls
from vqa_state.models.server.model import list_models
from vqa_state.study.collect import ask, plan

# A character set that is none, or no text

CHARSETS = ["utf-16", "hex", "base64", "rot13", "undefined", "idna", "zip", "no such", '"', "utf-7"]


@pytest.mark.parametrize("charset", CHARSETS)
@pytest.mark.parametrize("status", [400, 401, 503])
def test_no_character_set_ends_a_run(stub, charset, status):
    kind = f"text/plain; charset={charset}"
    stub.script = only_bad(answers(b"x\xff", status, content_type=kind))
    found = outcomes(model_of(stub), ["good", "bad", "fine"])
    assert found[0, "good"] == Answer("Yes.")
    assert str(status) in found[0, "bad"].reason
    stub.script = answers(b"x\xff", status, content_type=kind)
    with pytest.raises(ModelError, match=str(status)):
        list_models(stub.url)


@pytest.mark.parametrize("charset", CHARSETS)
def test_an_answer_is_read_whatever_its_character_set_is_called(stub, charset):
    kind = f"application/json; charset={charset}"
    stub.script = answers('{"choices": [{"message": {"content": "Yes."}}]}', content_type=kind)
    assert outcomes(model_of(stub), ["q"])[0, "q"] == Answer("Yes.")


def test_a_run_outlives_such_replies_and_is_completed_later(stub, project):
    stub.script = lambda call, handler: (
        answers(b"x\xff", 503, content_type="text/plain; charset=hex")(call, handler)
        if call.number % 3 == 0
        else good(call, handler)
    )
    model = model_of(stub)
    last = list(ask(project, model))[-1]
    assert last.n_asked > 0
    assert last.n_asked + last.n_failed == last.n_calls
    stub.script = good
    assert list(ask(project, model))[-1].n_failed == 0
    assert plan(project, model.fingerprint).n_to_ask == 0


# What nobody thought of


@pytest.mark.parametrize("body", ['{"detail": ' + "[" * 900 + "]" * 900 + "}", "1" * 5000, "\x00"])
@pytest.mark.parametrize("status", [200, 400, 503])
def test_no_body_ends_a_run(stub, body, status):
    stub.script = only_bad(answers(body, status))
    found = outcomes(model_of(stub), ["good", "bad", "fine"])
    assert isinstance(found[0, "bad"], Failure)
    assert found[0, "good"] == found[0, "fine"] == Answer("Yes.")


@pytest.mark.parametrize("kind", [RuntimeError, RecursionError, AssertionError, UnicodeError])
@pytest.mark.parametrize("part", ["read_reply", "status_fault"])
def test_an_error_of_ours_or_the_clients_is_one_failure_without_its_words(
    stub, monkeypatch, kind, part
):
    def broken(*args):
        raise kind("the secret words of a reply")

    stub.script = error(503) if part == "status_fault" else good
    monkeypatch.setattr(server_calls, part, broken)
    found = outcomes(model_of(stub), ["one", "two"])
    for failure in found.values():
        assert kind.__name__ in failure.reason
        assert "secret" not in failure.reason
    assert len(stub.calls) == 2 * (1 + QUICK.retries)
    monkeypatch.undo()
    stub.script = good
    assert set(outcomes(model_of(stub)).values()) == {Answer("Yes.")}


def test_a_list_that_breaks_the_client_is_explained(stub, monkeypatch):
    def broken(*args):
        raise RuntimeError("the secret words of a reply")

    monkeypatch.setattr("vqa_state.models.server.model.model_names", broken)
    with pytest.raises(ModelError, match="RuntimeError") as caught:
        list_models(stub.url)
    assert "secret" not in str(caught.value)


# Success by its status, an error by its words


@pytest.mark.parametrize(
    ("body", "says", "n_tries"),
    [
        ({"error": {"message": "insufficient credits"}}, "insufficient credits", 1),
        ({"error": "Unexpected endpoint"}, "Unexpected endpoint", 1),
        ({"object": "error", "message": "no such adapter"}, "no such adapter", 1),
        ({"error": {"message": "insufficient credits", "code": 402}}, "402: insufficient", 1),
        ({"error": {"message": "slow down", "code": 429}}, r"too many .*429: slow down", 3),
        ({"error": {"message": "upstream", "code": "502"}}, "502: upstream", 3),
        ({"error": {"message": "odd", "code": "invalid_x"}}, "odd", 1),
        ({"error": {"message": "odd", "code": True}}, "odd", 1),
        ({"choices": [], "error": {"message": "no room"}}, "no room", 1),
        ({"choices": [{"error": {"code": 502, "message": "cut"}}]}, "502: cut", 3),
        ({"choices": [{"message": {"content": None, "refusal": "I cannot"}}]}, "I cannot", 1),
        (completion(None, finish_reason="content_filter"), "filter", 1),
        ({"error": None, "choices": []}, "no choices", 3),
    ],
)
def test_what_a_server_says_of_a_failure_is_shown(stub, body, says, n_tries):
    stub.script = only_bad(answers(body))
    found = outcomes(model_of(stub), ["good", "bad", "fine"])
    assert re.search(says, found[0, "bad"].reason), found[0, "bad"].reason
    assert found[0, "good"] == found[0, "fine"] == Answer("Yes.")
    assert sum(call.question.startswith("bad") for call in stub.calls) == n_tries


def test_a_code_that_stands_in_the_body_is_heeded_like_a_status(stub):
    stub.script = answers({"error": {"message": f"bad key {'x' * 9}", "code": 401}})
    found = outcomes(model_of(stub), [f"q{n}" for n in range(50)])
    assert "wants a key (401)" in found[0, "q0"].reason
    assert len(stub.calls) < 5


@pytest.mark.parametrize(
    ("parts", "text"),
    [
        ([{"type": "text", "text": "Yes."}], "Yes."),
        ([{"type": "text", "text": "Yes, "}, {"type": "text", "text": "open."}], "Yes, open."),
        ([{"type": "thinking", "text": "Hm"}, {"type": "output_text", "text": "No."}], "No."),
        ([{"text": "Yes."}, 7, None, {"type": "text", "text": 5}], "Yes."),
    ],
)
def test_an_answer_in_parts_is_joined(stub, parts, text):
    stub.script = answers(completion(parts))
    assert outcomes(model_of(stub), ["q"])[0, "q"] == Answer(text)


@pytest.mark.parametrize("parts", [[], ["yes"], [{"type": "image"}], [[]], {"text": "Yes."}])
def test_parts_without_a_text_are_no_answer(stub, parts):
    stub.script = answers(completion(parts))
    assert "empty answer" in outcomes(model_of(stub), ["q"])[0, "q"].reason


# Names of models

NAMES = ["hf-internal-testing/tiny", "sk-learn/key-value-net", "a  b", "/models/" + "x" * 300]


def test_models_are_listed_by_the_very_names_that_they_are_asked_by(stub):
    stub.script = answers({"data": [{"id": name} for name in NAMES]})
    assert list_models(stub.url) == tuple(NAMES)


def test_a_name_that_no_address_can_hold_or_that_shows_the_key_is_left_out(stub, monkeypatch):
    monkeypatch.setenv("VQA_STATE_KEYS", f"127.0.0.1:{stub.port}=Zq7-topsecret")
    strange = ["a\x1b[31m", "b\u202ec", "c\nd", "e\ud800", "f" * 2000, "g zq7-TOPSECRET", " ", "\t"]
    stub.script = answers({"data": [{"id": name} for name in [*strange, "fine"]]})
    assert list_models(stub.url) == ("fine",)


def test_an_error_names_the_model_as_it_is_called(stub):
    stub.script = error(404, "no model hf-internal-testing/tiny; hf_abcdefgh12 is no key")
    reason = outcomes(model_of(stub, model="hf-internal-testing/tiny"), ["q"])[0, "q"].reason
    assert reason.count("hf-internal-testing/tiny") == 2
    assert "hf_abcdefgh12" not in reason


# Bytes that are hardly HTTP

RAW = {
    "nothing": b"",
    "zeros": b"\0" * 100,
    "a length below zero": b"HTTP/1.1 200 OK\r\ncontent-length: -5\r\n\r\n",
    "no status": b"HTTP/1.1 999 X\r\ncontent-length: 0\r\n\r\n",
    "no chunk": b"HTTP/1.1 200\r\ntransfer-encoding: chunked\r\n\r\nzz\r\n",
    "no place": b"HTTP/1.1 302 F\r\nlocation: http://[bad\r\ncontent-length: 0\r\n\r\n",
    "another protocol": b"HTTP/1.1 101 S\r\n\r\n",
    "no content": b"HTTP/1.1 204 N\r\n\r\n",
    "a cookie": b"HTTP/1.1 200 \xff\r\nset-cookie: \xff=\xfe;;;\r\ncontent-length: 2\r\n\r\n{}",
    "headers": b"HTTP/1.1 503 x\r\ncontent-type: \xff; charset=\xff\r\n\r\n\xff",
    "many headers": b"HTTP/1.1 200 OK\r\n" + b"a: b\r\n" * 20_000 + b"\r\n",
}


@pytest.mark.parametrize("name", RAW)
def test_no_bytes_cost_more_than_their_own_answer(stub, name):
    def script(call, handler):
        handler.wfile.write(RAW[name])
        handler.wfile.flush()
        handler.connection.shutdown(2)
        handler.close_connection = True

    stub.script = only_bad(script)
    found = outcomes(model_of(stub), ["good", "bad", "fine", "good again"])
    failed = {question for (_, question), one in found.items() if isinstance(one, Failure)}
    assert failed == {"bad"}


def test_a_cookie_is_neither_kept_nor_sent(stub):
    stub.script = lambda call, handler: Result(completion("Yes."), 200, {"set-cookie": "id=me"})
    outcomes(model_of(stub), ["a", "b", "c"])
    assert all("cookie" not in call.headers for call in stub.calls)
