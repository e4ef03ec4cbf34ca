"""The parts of a server's model that need no server: pace, waits, probabilities, addresses."""

import json
import math
import random
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models.api_keys import ApiKey
from vqa_state.models.server.call import CallBudget, Caller
from vqa_state.models.server.concurrency import Pace
from vqa_state.models.server.faults import Fault, Reach, retry_after
from vqa_state.models.server.response import model_names, p_yes, read_reply
from vqa_state.models.server.url import ServerURL

URL = ServerURL("http", "127.0.0.1", 8000, "/v1")
NOW = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


def settled(seconds_for, largest=16, n=600):
    """The size after `n` answers of a server that gives `size` of them in `seconds_for(size)`."""
    pace, now, left = Pace(largest), 0.0, 0
    for _ in range(n):
        left -= 1
        if left <= 0:
            left = pace.size
        now += seconds_for(pace.size) / pace.size
        pace.answered(now)
    return pace.size


@pytest.mark.parametrize(
    ("seconds_for", "size"),
    [
        (lambda n: 1.0, 16),  # as fast for many as for one
        (lambda n: float(n), 1),  # one after another
        (lambda n: max(1.0, n / 4), 4),  # full at four
    ],
)
def test_as_many_calls_are_open_as_make_answers_come_faster(seconds_for, size):
    assert settled(seconds_for) == size
    assert settled(seconds_for, largest=1) == 1


def test_a_complaint_halves_the_calls_once_for_all_that_were_open():
    pace, now = Pace(16), 0.0
    while pace.size < 16:
        now += 1.0 / pace.size
        pace.answered(now)
    for _ in range(5):
        pace.refused(now - 1, now)
    assert pace.size == 8
    pace.refused(now + 1, now + 2)
    assert pace.size == 4
    for _ in range(1000):
        pace.refused(now := now + 10, now)
    assert pace.size == 1
    for _ in range(61 * 3):
        pace.answered(now := now + 1)
    assert 2 <= pace.size <= 4  # calm again: one more at a time


@pytest.mark.parametrize(
    ("header", "seconds"),
    [
        (None, None),
        ("", None),
        ("soon", None),
        ("-5", None),
        ("0", 0.0),
        (" 12 ", 12.0),
        ("1.5", 1.5),
        (format_datetime(NOW + timedelta(seconds=90), usegmt=True), 90.0),
        (format_datetime(NOW - timedelta(seconds=90), usegmt=True), 0.0),
        ("Fri, 99 Jan 2026 03:04:05 GMT", None),
    ],
)
def test_retry_after_in_seconds_and_as_a_date(header, seconds):
    assert retry_after(header, NOW) == seconds


def test_waits_double_are_drawn_from_zero_up_and_have_a_longest():
    budget = CallBudget(retries=8, run_retries=10**6, longest_wait_seconds=5)
    caller = Caller(URL, "m", None, budget)
    caller._jitter = random.Random(0)
    fault = Fault("x", Reach.PASSING)
    for n_tries in range(1, 9):
        waits = [caller._wait(fault, n_tries) for _ in range(300)]
        longest = min(0.5 * 2 ** (n_tries - 1), 5)
        assert 0 <= min(waits) < 0.1 * longest
        assert 0.9 * longest < max(waits) <= longest
    assert caller._wait(fault, 9) is None


@pytest.mark.parametrize("reach", [Reach.ANSWER, Reach.ALL])
def test_what_will_not_work_is_not_tried_again(reach):
    assert Caller(URL, "m", None, CallBudget())._wait(Fault("x", reach), 1) is None


@pytest.mark.parametrize(
    "field", ["retries", "run_retries", "answer_seconds", "first_wait_seconds", "max_parallel"]
)
def test_a_budget_is_checked(field):
    with pytest.raises(ValueError, match=field):
        CallBudget(**{field: -1})


@pytest.mark.parametrize(
    "wrong", [{"max_parallel": 0}, {"deadline_seconds": 0}, {"retries": math.nan}]
)
def test_a_budget_of_nothing_is_none(wrong):
    with pytest.raises(ValueError, match="must be at least"):
        CallBudget(**wrong)


# Probabilities


def first_token(token, top):
    rows = [{"token": word, "logprob": value} for word, value in top]
    return {"content": [{"token": token, "top_logprobs": rows}]}


SPELLINGS = ["yes", "Yes", " YES", "▁Yes", "Ġyes", "no", "No", " no", "▁NO", "Ġno", "Not", "The"]


@given(st.lists(st.floats(0.001, 1), min_size=12, max_size=12))
def test_the_share_of_yes_is_that_of_all_its_spellings(weights):
    p = np.asarray(weights) / sum(weights)
    top = list(zip(SPELLINGS, np.log(p).tolist(), strict=True))
    expected = p[:5].sum() / p[:10].sum()
    assert p_yes(first_token("Yes", top), "Yes.") == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("logprobs", "text"),
    [
        (None, "Yes"),
        ({}, "Yes"),
        ({"content": None}, "Yes"),
        ({"content": []}, "Yes"),
        ({"content": [{"token": "Yes"}]}, "Yes"),
        (first_token("Yes", [("Yes", math.log(0.6))]), "Yes"),  # "no" may have the other 0.4
        (first_token("Hm", [("yes", -0.1), ("no", -3)]), "Yes"),  # of a thought, not the answer
        (first_token("", [("yes", -0.1), ("no", -3)]), "Yes"),
        (first_token("Open", [("Open", -0.1), ("Shut", -3)]), "Open"),
        (first_token("Yes", [("yes", None), ("no", "x"), (None, -1), ("no", math.nan)]), "Yes"),
        (first_token("Yes", [("yes", 5.0), ("no", 10**400)]), "Yes"),
    ],
)
def test_where_a_server_does_not_say_how_sure_it_is_nothing_is_made_up(logprobs, text):
    assert p_yes(logprobs, text) is None


def test_a_side_outside_the_list_counts_nothing_where_hardly_anything_is_left():
    top = [("Yes", math.log(0.995)), ("The", math.log(0.003))]
    assert p_yes(first_token("Yes", top), "Yes") == 1.0
    assert p_yes(first_token("Yes", [("Yes", 0.0), ("No", -9999)]), "Yes") == 1.0


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["choices", "message", "content", "logprobs", "token", "top_logprobs", "data", "id"]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=15,
)


@given(
    JSON | st.builds(lambda x: {"choices": [{"message": {"content": "Yes"}, "logprobs": x}]}, JSON)
)
def test_no_body_breaks_the_reading(content):
    body = json.dumps(content)
    outcome = read_reply(body, URL)
    assert isinstance(outcome, Answer | Fault)
    names = model_names(body)
    assert names is None or all(isinstance(name, str) for name in names)


def test_an_answer_keeps_no_key_and_has_an_end():
    body = json.dumps({"choices": [{"message": {"content": "it is k123 " + "x" * 9999}}]})
    outcome = read_reply(body, URL, ApiKey("k123"))
    assert outcome.text.startswith("it is [key] xx")
    assert len(outcome.text) == 2000


# Addresses


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("http://LocalHost:8000/v1/", "http://localhost:8000/v1"),
        ("https://a.com:443/v1", "https://a.com/v1"),
        ("http://[::1]:8000/v1", "http://[::1]:8000/v1"),
        ("https://a.com", "https://a.com"),
        ("https://g.com/v1beta/openai/", "https://g.com/v1beta/openai"),
    ],
)
def test_an_address_has_one_spelling(text, url):
    assert str(ServerURL.parse(text)) == url
    assert ServerURL.parse(url) == ServerURL.parse(text)


@pytest.mark.parametrize(
    "text",
    [
        "http://a.com\\@b.com/v1",
        "http://a.com@b.com/v1",
        "http://a.com#@b.com/",
        "http://a.com:0/v1",
        "http://[::1%25eth0]/v1",
        "http://a b.com/v1",
        "http://a.com/v1?x=1",
        "http://a.com/../v1 x",
        "file:///etc/passwd",
    ],
)
def test_an_address_that_two_programs_could_read_differently_is_refused(text):
    with pytest.raises(ModelError):
        ServerURL.parse(text)


@pytest.mark.parametrize(
    ("host", "here"),
    [
        ("localhost", True),
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("[::1]", True),
        ("127.0.0.1.nip.io", False),
        ("localhost.com", False),
        ("0.0.0.0", False),  # noqa: S104
        ("10.0.0.1", False),
    ],
)
def test_what_is_on_this_machine(host, here):
    assert ServerURL.parse(f"http://{host}:1/v1").is_loopback is here
