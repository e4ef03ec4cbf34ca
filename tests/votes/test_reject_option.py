"""The vote and its sureness against plain sums of fractions, and by laws."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruling import FREE, ballots_of, rules, votes

from vqa_state.answers.table import MISSING
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import FittedVote, VoteKind, equal_vote
from vqa_state.votes.state import State


def pull_of(rule, answer, p, flipped):
    """How far one answer speaks for the positive state, -1 to 1; None if it does not count."""
    if rule.vote.kind is VoteKind.WEIGHTED_P_YES:
        pull = 2 * Fraction(round(1_000_000 * float(p)), 1_000_000) - 1
    elif answer == 0 and not rule.vote.kind.weighted:
        return None
    else:
        pull = Fraction(int(answer))
    return -pull if flipped else pull


def share_of(rule, verdicts, p_positive):
    """Share of the positive state over (copies, questions), what counts, and what really speaks."""
    gain = counted = whole = speaks_for = speaks_against = Fraction(0)
    vote = rule.vote
    for copy, shares in zip(verdicts, p_positive, strict=True):
        for question, weight, flipped in zip(
            vote.questions, vote.weights, vote.flipped, strict=True
        ):
            pull = pull_of(rule, copy[question], shares[question], flipped)
            whole += weight
            if pull is None:
                continue
            counted += weight
            gain += weight * (1 + pull) / 2
            speaks_for += weight * max(pull, 0)
            speaks_against += weight * max(-pull, 0)
    share = gain / counted if counted else None
    return share, counted / whole, speaks_for / whole, speaks_against / whole


def judged(rule, verdicts, p_positive):
    """Leaning and sureness by the sentences of the module."""
    t = Fraction(str(rule.vote.threshold))
    share, counted, speaks_for, speaks_against = share_of(rule, verdicts, p_positive)
    nothing = rule.vote.kind is VoteKind.WEIGHTED_ANSWERS and not (speaks_for + speaks_against)
    if nothing or share is None or share == t:
        return 0, 0
    side = 1 if share > t else -1
    margin = (share - t) / (1 - t) if side > 0 else (t - share) / t
    lead = min(margin * counted, speaks_for if side > 0 else speaks_against)
    own = [
        share_of(rule, copy[np.newaxis], p[np.newaxis])[0]
        for copy, p in zip(verdicts, p_positive, strict=True)
    ]
    n_agreeing = sum(s is not None and (s > t) - (s < t) == side for s in own)
    return side, lead * n_agreeing / len(verdicts)


@given(rules(), st.data())
@settings(deadline=None)
def test_states_and_sureness_are_those_of_the_definition(rule, data):
    seen = data.draw(votes(rule))
    states, sureness, margins = rule.states(*seen), rule.sureness(*seen), rule.margins(*seen)
    for i, (answers, p) in enumerate(zip(*seen, strict=True)):
        leaning, expected = judged(rule, answers, p)
        assert sureness[i] == pytest.approx(float(expected), abs=1e-12)
        assert margins[i] == leaning * sureness[i]
        if abs(float(expected) - rule.min_sureness) > 1e-9 or rule.min_sureness == 0:
            assert states[i] == (leaning if expected >= rule.min_sureness else 0)


@given(rules(min_sureness=FREE), st.data())
@settings(deadline=None)
def test_threshold_0_gives_the_votes_own_verdicts(rule, data):
    """So it leaves only ties, and images without an answer that counts."""
    verdicts, p_positive = data.draw(votes(rule))
    expected = rule.vote.decide(ballots_of(verdicts, p_positive))
    assert (rule.states(verdicts, p_positive) == expected).all()


@given(rules(), st.data())
@settings(deadline=None)
def test_one_image_is_judged_as_among_many(rule, data):
    verdicts, p_positive = data.draw(votes(rule))
    states, sureness = rule.states(verdicts, p_positive), rule.sureness(verdicts, p_positive)
    for i, (answers, p) in enumerate(zip(verdicts, p_positive, strict=True)):
        one = rule.judge(answers, p)
        assert {State.POSITIVE: 1, State.NEGATIVE: -1, State.UNKNOWN: 0}[one.state] == states[i]
        assert one.sureness == sureness[i]
        assert 0 <= one.n_agreeing <= one.n_copies == len(answers)
        neither = [
            weight * int((answers[:, question] == 0).sum())
            for question, weight in zip(rule.vote.questions, rule.vote.weights, strict=True)
        ]
        assert one.invalid == pytest.approx(sum(neither) / sum(rule.vote.weights) / len(answers))
        share = share_of(rule, answers, p)[0]
        if share is not None and not math.isnan(one.share):
            assert one.share == pytest.approx(float(share))
        else:
            assert not answers[:, rule.vote.questions].any()


@given(rules(), st.data())
@settings(deadline=None)
def test_an_answer_turned_towards_the_winner_never_makes_less_sure(rule, data):
    verdicts, p_positive = data.draw(votes(rule))
    i, copy = (data.draw(st.integers(0, size - 1)) for size in verdicts.shape[:2])
    place = data.draw(st.integers(0, rule.vote.n_used - 1))
    margin = rule.margins(verdicts, p_positive)[i]
    if not margin:
        return
    winner = -np.sign(margin) if rule.vote.flipped[place] else np.sign(margin)
    cell = i, copy, rule.vote.questions[place]
    more, surer = verdicts.copy(), p_positive.copy()
    more[cell], surer[cell] = winner, max(0, winner)
    assert margin * rule.margins(more, surer)[i] >= margin * margin


@given(rules(), st.data())
@settings(deadline=None)
def test_the_order_of_copies_and_images_is_irrelevant(rule, data):
    verdicts, p = data.draw(votes(rule))
    sureness = rule.sureness(verdicts, p)
    assert (rule.sureness(verdicts[:, ::-1], p[:, ::-1]) == sureness).all()
    assert (rule.sureness(verdicts[::-1], p[::-1])[::-1] == sureness).all()


def test_extremes_and_the_example_of_the_module():
    rule = AbstainRule(equal_vote(range(6)))
    same, none = np.ones((1, 6, 6), np.int8), np.zeros((1, 6, 6), np.int8)
    assert rule.sureness(same) == rule.sureness(-same) == 1
    assert (rule.sureness(none), rule.states(none)) == (0, 0)
    each = np.array([[[1, 1, 1, 1, -1, 0]] * 6], np.int8)
    assert rule.sureness(each) == 0.5
    one_copy_differs = np.array([[[1, 1, 1, 1, 1, 1]] * 5 + [[-1] * 6]], np.int8)
    assert rule.sureness(one_copy_differs) == pytest.approx(24 / 36 * 5 / 6)


def test_a_tie_is_a_tie_as_a_decimal():
    """As a float, 0.6 is a little less than 3 / 5."""
    answers = np.array([[[1, 1, 1, -1, -1]]], np.int8)
    assert AbstainRule(equal_vote(range(5), 0.6)).states(answers) == 0


def test_invalid_answers_that_count_half_cannot_decide_alone():
    vote = equal_vote(range(4), 0.3, VoteKind.WEIGHTED_ANSWERS)
    rule = AbstainRule(vote)
    nothing, one_against = np.zeros((1, 1, 4), np.int8), np.array([[[-1, 0, 0, 0]]], np.int8)
    assert rule.states(nothing) == 0
    assert rule.states(one_against) == 1  # (0 + 3/2) / 4 = 0.375 is above 0.3
    assert rule.sureness(one_against) == 0
    assert AbstainRule(vote, 0.01).states(one_against) == 0


def test_missing_answers_are_not_invalid():
    rule = AbstainRule(FittedVote(VoteKind.PAPER, (1,), (1,), (False,), 0.5))
    verdicts = np.ones((1, 1, 2), np.int8)
    verdicts[0, 0, 0] = MISSING  # nobody asks for this one
    assert rule.states(verdicts) == 1
    with pytest.raises(ValueError, match="missing, which is not invalid"):
        rule.states(verdicts[:, :, ::-1])
    for shape in ((1, 1, 1), (1, 2), (1, 0, 2)):
        with pytest.raises(ValueError, match="a column for question 1 and at least one copy"):
            rule.sureness(np.ones(shape, np.int8))


def test_a_vote_by_p_yes_needs_all_shares():
    rule = AbstainRule(equal_vote(range(2), kind=VoteKind.WEIGHTED_P_YES))
    verdicts = np.ones((1, 1, 2), np.int8)
    for shares in (None, np.ones((1, 1, 1), np.float32), np.full((1, 1, 2), np.nan, np.float32)):
        with pytest.raises(ValueError, match="needs the model's own share for every answer"):
            rule.states(verdicts, shares)
    assert rule.margins(verdicts, np.full((1, 1, 2), 0.25, np.float32)) == -0.5


@pytest.mark.parametrize("min_sureness", [-0.1, 1.1, math.nan])
def test_a_rule_refuses_a_sureness_out_of_range(min_sureness):
    with pytest.raises(ValueError, match="min_sureness must be"):
        AbstainRule(equal_vote(range(1)), min_sureness)
