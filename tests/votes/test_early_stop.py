"""Stopping early never changes a verdict: by every completion, by laws, and asked step by step."""

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from ruling import ANY, rules, votes

from vqa_state.answers.table import MISSING
from vqa_state.votes.early_stop import calls_needed, is_settled, verdict_so_far
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import VoteKind, equal_vote
from vqa_state.votes.state import State


def asked_in_turn(rule, verdicts, p_positive):
    """What a recognizer does with one image: ask about a copy, look, go on. Calls and verdict."""
    so_far, shares = np.full(verdicts.shape, MISSING, np.int8), np.full_like(p_positive, np.nan)
    for copy in range(len(verdicts)):
        so_far[copy], shares[copy] = verdicts[copy], p_positive[copy]
        state = verdict_so_far(rule, so_far, shares)
        if state is not None:
            return (copy + 1) * rule.vote.n_used, state
    raise AssertionError("all answers are in, and nothing is settled")


@given(rules(), st.data())
@settings(deadline=None)
def test_the_verdict_is_always_that_of_all_answers(rule, data):
    verdicts, p_positive = data.draw(votes(rule))
    needed = calls_needed(rule, verdicts, p_positive)
    for i, (answers, p) in enumerate(zip(verdicts, p_positive, strict=True)):
        n_calls, state = asked_in_turn(rule, answers, p)
        assert state is rule.judge(answers, p).state
        assert n_calls == needed[i] <= rule.vote.n_used * len(answers)


def completions(rule, verdicts, p_positive):
    """Every way in which the open answers of one image could turn out."""
    said = [-1, 0, 1]
    if rule.vote.kind is VoteKind.WEIGHTED_P_YES:
        said = [(0, 0.0), (0, 0.5), (0, 1.0)]
    used = np.isin(np.arange(verdicts.shape[1]), rule.vote.questions)
    cells = list(zip(*np.nonzero((verdicts == MISSING) & used), strict=True))
    for answers in product(said, repeat=len(cells)):
        full, shares = verdicts.copy(), p_positive.copy()
        for cell, answer in zip(cells, answers, strict=True):
            full[cell], shares[cell] = answer if isinstance(answer, tuple) else (answer, 0)
        yield full, shares


@given(rules(ANY, 3), st.data())
@settings(deadline=None, max_examples=300)
def test_settled_is_exactly_what_no_completion_can_change(rule, data):
    """Not too early, and (with extremes among the completions) not too late."""
    verdicts, p_positive = data.draw(votes(rule))
    verdicts, p_positive = verdicts[0, :2], p_positive[0, :2]
    is_open = data.draw(st.lists(st.booleans(), min_size=verdicts.size, max_size=verdicts.size))
    verdicts[np.reshape(is_open, verdicts.shape)] = MISSING
    outcomes = {rule.judge(*full).state for full in completions(rule, verdicts, p_positive)}
    certain = verdict_so_far(rule, verdicts, p_positive)
    if certain is None:
        assert len(outcomes) > 1 or nothing_counts_yet(rule, verdicts)
    else:
        assert outcomes == {certain}


def nothing_counts_yet(rule, verdicts):
    """All so far are invalid: waiting for the first valid answer costs a call at most."""
    seen = verdicts[:, rule.vote.questions]
    return rule.vote.kind is not VoteKind.WEIGHTED_P_YES and np.isin(seen, (0, MISSING)).all()


@given(rules(), st.data())
@settings(deadline=None)
def test_once_settled_always_settled(rule, data):
    verdicts, p_positive = data.draw(votes(rule))
    calls = list(np.ndindex(verdicts.shape[1:]))
    so_far = np.full(verdicts.shape, MISSING, np.int8)
    was = np.zeros(len(verdicts), dtype=bool)
    for copy, question in data.draw(st.permutations(calls)):  # in whatever order
        so_far[:, copy, question] = verdicts[:, copy, question]
        now = is_settled(rule, so_far, p_positive)
        assert (now | ~was).all()
        was = now
    assert was.all()


@given(st.integers(0, 9), st.integers(0, 9), st.integers(0, 9), st.sampled_from([0.3, 0.5, 0.6]))
@settings(deadline=None)
def test_the_formula_of_the_module(n_positive, n_negative, n_open, t):
    answers = [1] * n_positive + [-1] * n_negative + [MISSING] * n_open
    if not answers:
        return
    rule = AbstainRule(equal_vote(range(len(answers)), t))
    n, tenths = len(answers), round(10 * t)
    expected = None
    if 10 * n_positive > tenths * n:
        expected = State.POSITIVE
    elif 10 * (n_positive + n_open) < tenths * n:
        expected = State.NEGATIVE
    elif n_open == 0:
        expected = State.UNKNOWN
    assert verdict_so_far(rule, np.array([answers], np.int8)) is expected


def test_calls_by_hand():
    """Five questions, three copies, all answers alike: two copies are more than half."""
    verdicts = np.ones((1, 3, 5), np.int8)
    assert calls_needed(AbstainRule(equal_vote(range(5))), verdicts) == 10
    assert calls_needed(AbstainRule(equal_vote(range(5)), 1.0), verdicts) == 15
    verdicts[0, 1, :3] = -1
    assert calls_needed(AbstainRule(equal_vote(range(5))), verdicts) == 15


def test_an_unsure_image_is_settled_as_unknown():
    rule = AbstainRule(equal_vote(range(4)), 0.9)
    half_way = np.array([[1, -1, MISSING, MISSING]], np.int8)
    assert verdict_so_far(rule, half_way) is State.UNKNOWN


def test_only_invalid_answers_settle_nothing():
    """If all that counts half were invalid, the verdict would be unknown, not positive."""
    rule = AbstainRule(equal_vote(range(5), 0.3, VoteKind.WEIGHTED_ANSWERS))
    answers = np.array([[0, 0, 0, 0, MISSING]], np.int8)
    assert rule.states(np.where(answers == MISSING, -1, answers)[np.newaxis]) == 1
    assert verdict_so_far(rule, answers) is None
    answers[0, 4] = 0
    assert verdict_so_far(rule, answers) is State.UNKNOWN
