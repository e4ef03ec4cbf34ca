"""A key goes to the host that it was set for, and is shown nowhere."""

import copy
import logging
import pickle
import traceback

import pytest
from pictures import draw
from stub_server import Result, Stub, completion

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models.api_keys import ApiKey, key_for, without_keys
from vqa_state.models.server.model import CallBudget, ServerModel, list_models
from vqa_state.models.server.url import ServerURL

KEY = "Zq7-topsecret_41.x"
QUICK = CallBudget(retries=1, first_wait_seconds=0.01, deadline_seconds=3)


@pytest.fixture
def stub(monkeypatch):
    with Stub() as server:
        monkeypatch.setenv("VQA_STATE_KEYS", f"127.0.0.1:{server.port}={KEY}")
        yield server


def found(url, keys="", openai=""):
    key = key_for(ServerURL.parse(url), {"VQA_STATE_KEYS": keys, "OPENAI_API_KEY": openai})
    return None if key is None else key.reveal()


@pytest.mark.parametrize(
    ("url", "keys", "key"),
    [
        ("https://a.com/v1", "a.com=k", "k"),
        ("https://A.com/v1", " A.COM = k ; b.com=l;", "k"),
        ("https://a.com:8443/v1", "a.com=k", "k"),
        ("https://a.com:8443/v1", "a.com=k;a.com:8443=l", "l"),
        ("https://a.com/v1", "a.com:443=l", "l"),
        ("https://a.com/v1", "a.com:8443=l", None),
        ("https://b.a.com/v1", "a.com=k", None),
        ("https://a.com.evil.org/v1", "a.com=k", None),
        ("https://xa.com/v1", "a.com=k", None),
        ("https://a.com/v1", "a.com=k=l==", "k=l=="),
        ("http://localhost:8000/v1", "localhost:8000=k", "k"),
        ("http://127.0.0.5:8000/v1", "127.0.0.5=k", "k"),
        ("http://[::1]:8000/v1", "[::1]:8000=k", "k"),
        ("http://a.com/v1", "b.com=k", None),
    ],
)
def test_a_key_is_for_its_host_alone(url, keys, key):
    assert found(url, keys) == key


def test_the_openai_key_is_for_openai_alone():
    assert found("https://api.openai.com/v1", openai=KEY) == KEY
    assert found("https://api.openai.com/v1", f"api.openai.com={KEY}", "other") == KEY
    for url in ("https://openai.com/v1", "http://localhost:8000/v1", "https://api.openai.com.x.y/"):
        assert found(url, openai=KEY) is None


@pytest.mark.parametrize("host", ["gpu.lan", "192.168.0.7", "localhost.example.com"])
def test_a_key_does_not_go_unencrypted_over_a_network(host):
    with pytest.raises(ModelError, match=f"unencrypted; use https://{host}") as caught:
        found(f"http://{host}:8000/v1", f"{host}={KEY}")
    assert KEY not in str(caught.value)
    assert found(f"https://{host}:8000/v1", f"{host}={KEY}") == KEY


@pytest.mark.parametrize(
    "entry",
    [KEY, f"={KEY}", "a.com=", f"http://a.com={KEY}", f"a.com/v1={KEY}", f"a.com={KEY}\nx: y"],
)
def test_an_entry_that_cannot_be_read_is_named_but_not_shown(entry):
    with pytest.raises(ModelError, match="entry 2 of VQA_STATE_KEYS") as caught:
        found("https://b.com", f"b.com=l;{entry}")
    text = "".join(traceback.format_exception(caught.value))
    assert KEY not in text.replace(repr(entry), "")


def test_a_key_does_not_show_itself():
    key = ApiKey(KEY)
    assert KEY not in f"{key} {key!r} {vars(type(key))}"
    for write in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="not written anywhere"):
            write(key)


@pytest.mark.parametrize(
    "text",
    [
        f"bad key {KEY}.",
        f"bad key {KEY.upper()}",
        "bad " + "\x00".join(KEY),
        "bad " + "\u200b".join(KEY),
        "x" * 190 + KEY,
        f"Authorization: Bearer {KEY}",
    ],
)
def test_a_servers_text_is_shown_without_the_key(text):
    shown = without_keys(text, ApiKey(KEY))
    assert "topsecret" not in shown.lower()
    assert KEY[:5] not in shown
    assert len(shown) <= 200


def test_a_servers_text_is_one_short_plain_line():
    assert without_keys("a\r\n\tb\x1b[31m \u202ec") == "a b[31m c"
    assert (
        without_keys("sk-proj-****abcd and sk-1234567 and Bearer xyz")
        == "[key] and [key] and [key]"
    )
    assert len(without_keys("word " * 1000)) == 200


def test_the_key_is_sent_to_its_server(stub):
    assert next(ServerModel(stub.url, "m", "n").answer([draw(0)], ["q"])).outcome == Answer("Yes.")
    headers = stub.calls[0].headers
    assert headers["authorization"] == f"Bearer {KEY}"


def test_no_key_and_nothing_of_the_environment_goes_elsewhere(stub, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    monkeypatch.setenv("OPENAI_ADMIN_KEY", KEY)
    monkeypatch.setenv("OPENAI_ORG_ID", "my-organisation")
    monkeypatch.setenv("OPENAI_PROJECT_ID", "my-project")
    monkeypatch.setenv("OPENAI_CUSTOM_HEADERS", f"Authorization: Bearer {KEY}\nX-Own: {KEY}")
    monkeypatch.setenv("OPENAI_BASE_URL", stub.url)
    with Stub() as other:
        list(ServerModel(other.url, "m", "n").answer([draw(0)], ["q"]))
        with pytest.raises(ModelError):
            list_models(other.url)
    assert stub.calls == []
    assert len(other.calls) == 2
    for call in other.calls:
        text = str(call.headers)
        assert "authorization" not in call.headers
        assert KEY not in text
        assert "my-" not in text
        assert "stainless" not in text.lower()


def test_a_redirect_is_not_followed(stub):
    with Stub() as other:
        stub.script = lambda call, handler: Result("", 307, {"location": other.url + call.path[3:]})
        reply = next(ServerModel(stub.url, "m", "n").answer([draw(0)], ["q"]))
        assert "which is not followed" in reply.outcome.reason
        with pytest.raises(ModelError, match="which is not followed"):
            list_models(stub.url)
    assert other.calls == []


def test_no_error_log_answer_or_attribute_shows_the_key(stub, caplog):
    """Servers that repeat what they were sent, in every kind of reply."""
    caplog.set_level(logging.DEBUG)

    def echo(status, kind):
        def script(call, handler):
            said = f"you sent {call.headers['authorization']} {KEY}"
            body = {"text": said, "error": {"error": {"message": said}}, "answer": completion(said)}
            return Result(body[kind], status)

        return script

    shown = []
    for status in (200, 302, 400, 401, 403, 404, 422, 429, 500, 503):
        for kind in ("text", "error", "answer"):
            stub.script = echo(status, kind)
            model = ServerModel(stub.url, "m", "n", budget=QUICK)
            shown += [repr(reply) for reply in model.answer([draw(0)], ["q"])]
            shown += [repr(model), str(vars(model)), str(vars(model._caller)), model.fingerprint]
            shown += model.notes
            try:
                shown += list_models(stub.url)
            except ModelError as error:
                shown += traceback.format_exception(error)
    assert all(call.headers["authorization"].endswith(KEY) for call in stub.calls)
    assert len(stub.calls) > 60
    assert KEY not in "".join(shown)
    assert KEY not in caplog.text


def test_the_fingerprint_does_not_know_the_key(stub, monkeypatch):
    one = ServerModel(stub.url, "m", "n").fingerprint
    monkeypatch.delenv("VQA_STATE_KEYS")
    assert ServerModel(stub.url, "m", "n").fingerprint == one
