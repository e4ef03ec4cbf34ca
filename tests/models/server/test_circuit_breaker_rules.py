"""The rules of doubt without a server: who counts, where is looked, what is said of a wait."""

import asyncio
from pathlib import Path
from time import monotonic

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state.models.server.call import CallBudget, Caller
from vqa_state.models.server.circuit_breaker import Doubt
from vqa_state.models.server.faults import Fault, Reach
from vqa_state.models.server.url import ServerURL

URL = ServerURL("http", "127.0.0.1", 8000, "/v1")


def n_until_given_up(doubt, reach, start=100.0):
    """Pairs, one after another, until one is told to be all; 99 if none is."""
    for n in range(1, 99):
        if doubt.weigh(Fault("x", reach), start + n, start + n + 0.5).reach is Reach.ALL:
            return n
    return 99


@pytest.mark.parametrize(
    ("reach", "never", "after_an_answer"),
    [(Reach.ANSWER, 16, 99), (Reach.PASSING, 16, 16), (Reach.GONE, 2, 2), (Reach.ALL, 2, 16)],
)
def test_so_many_pairs_in_a_row_are_needed(reach, never, after_an_answer):
    assert n_until_given_up(Doubt(), reach) == never
    doubt = Doubt()
    doubt.answered(1.0)
    assert n_until_given_up(doubt, reach) == after_an_answer


@pytest.mark.parametrize("reach", Reach)
def test_an_answer_ends_the_doubt(reach):
    doubt = Doubt()
    doubt.answered(0.0)
    for n in range(200):
        assert doubt.weigh(Fault("x", reach), 2.0 * n + 1, 2.0 * n + 1.5).reach is not Reach.ALL
        doubt.answered(2.0 * n + 2)
        assert (doubt.n_failed, doubt.is_gone) == (0, False)


@pytest.mark.parametrize("reach", [Reach.PASSING, Reach.GONE])
def test_what_failed_while_another_was_answered_tells_of_itself(reach):
    doubt = Doubt()
    for n in range(200):
        doubt.answered(n + 0.5)
        assert doubt.weigh(Fault("x", reach), float(n), n + 0.9).reach is reach
    assert doubt.n_failed == 0


@pytest.mark.parametrize("reach", [Reach.PASSING, Reach.GONE, Reach.ALL])
def test_pairs_that_were_open_together_are_no_second_opinion(reach):
    doubt = Doubt()
    doubt.answered(1.0)
    told = [doubt.weigh(Fault("x", reach), 2.0, 3.0 + n).reach for n in range(99)]
    assert Reach.ALL not in told
    assert doubt.n_failed == 1


@given(st.integers(1, 5000), st.integers(0, 200))
def test_the_pair_asked_next_is_one_of_those_left(n_left, n_failed):
    doubt = Doubt()
    doubt.n_failed = n_failed
    assert 0 <= doubt.place(n_left) < n_left
    assert n_failed or doubt.place(n_left) == 0


@given(st.integers(16, 2000))
def test_second_opinions_come_from_everywhere(n_left):
    """Sixteen of them leave no gap of a seventh of the pairs, or more."""
    doubt, places = Doubt(), [0, n_left]
    for doubt.n_failed in range(1, 17):
        places.append(doubt.place(n_left))
    gaps = [
        after - before for before, after in zip(sorted(places), sorted(places)[1:], strict=False)
    ]
    assert max(gaps) <= n_left / 7 + 1


def test_who_only_waited_says_what_was_waited_for():
    caller = Caller(URL, "m", None, CallBudget(answer_seconds=0.3, first_wait_seconds=9.0))
    caller._jitter.uniform = lambda least, most: most
    caller._closed_until = monotonic() + 0.2
    caller._closing = Fault("too many requests", Reach.PASSING, 0.2, 429)
    fault = asyncio.run(caller.ask(None, []))
    assert (fault.sentence, fault.reach) == ("too many requests", Reach.PASSING)


@pytest.mark.parametrize("wait", [float("inf"), 1e12, 86_400.0])
def test_nobody_is_kept_out_for_more_than_a_day(wait):
    caller = Caller(URL, "m", None, CallBudget())
    caller._heeded(Fault("busy", Reach.PASSING, wait, 429), monotonic())
    fault = asyncio.run(caller.ask(None, []))
    assert fault.reach is Reach.ALL
    assert fault.sentence == "busy: it asks to wait 86400 seconds"


def test_the_page_about_servers_has_these_numbers():
    page = Path(__file__).parent.parent.parent.parent / "docs" / "models" / "servers.md"
    text, budget = " ".join(page.read_text().split()), CallBudget()
    for words in (
        f"up to {budget.answer_seconds:g} seconds",
        f"again {budget.retries} times",
        f"in a budget of {budget.run_retries}",
        f"a deadline ({budget.deadline_seconds:g} seconds)",
        f"{budget.max_parallel} at most",
        "after two questions if",
        f"after {n_until_given_up(Doubt(), Reach.PASSING)} in a row",
    ):
        assert words in text, words
