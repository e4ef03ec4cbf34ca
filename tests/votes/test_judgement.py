"""The sentence of a verdict: the state that won, with its own share, whichever it is."""

import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruling import rules, votes
from votes.test_reject_option import share_of

from vqa_state.answers.table import MISSING
from vqa_state.recognizer.counting import judged_so_far
from vqa_state.votes.early_stop import verdict_so_far
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import FittedVote, VoteKind, equal_vote
from vqa_state.votes.state import State

NAMES = "ajar", "shut"
SHARE = r"(\d+(?:\.\d+)?)%"
SAID = re.compile(
    rf"{SHARE} of the valid votes speak for (\w+)|stands at {SHARE}(?: or more)? for (\w+)"
)


def mirrored(rule):
    """The rule for the states in the other order; a threshold has six digits."""
    vote = rule.vote
    other = FittedVote(
        vote.kind, vote.questions, vote.weights, vote.flipped, round(1 - vote.threshold, 6)
    )
    return AbstainRule(other, rule.min_sureness)


def shown(sentence):
    """The first share that the sentence says, its digits after the point, and whose it is."""
    found = SAID.search(sentence)
    assert found, sentence
    number, name = (found[1], found[2]) if found[1] else (found[3], found[4])
    return Fraction(number) / 100, len(number.partition(".")[2]), name


@given(rules(), st.data())
@settings(deadline=None)
def test_the_sentence_names_the_leading_state_and_its_own_share(rule, data):
    verdicts, p_positive = data.draw(votes(rule))
    for answers, p in zip(verdicts, p_positive, strict=True):
        judged = rule.judge(answers, p)
        sentence = judged.reason(*NAMES)
        if judged.leaning is State.UNKNOWN:
            assert sentence.startswith(("the vote is a tie: ", "no answer was a clear yes or no"))
            continue
        positive = judged.leaning is State.POSITIVE
        share = share_of(rule, answers, p)[0]
        threshold = Fraction(str(rule.vote.threshold))
        own, needs = (share, threshold) if positive else (1 - share, 1 - threshold)
        number, digits, name = shown(sentence)
        assert name == NAMES[0 if positive else 1]
        assert abs(number - own) <= Fraction(1, 2 * 10 ** (digits + 2)) + Fraction(1, 10**11)
        assert (number > needs) or own - needs < Fraction(1, 10**10)
        assert (judged.state is State.UNKNOWN) == ("not sure enough" in sentence)
        assert NAMES[1 if positive else 0] not in sentence
        assert ("less than half" in sentence) == (own < Fraction(1, 2))


@given(rules(), st.data())
@settings(deadline=None)
def test_states_that_change_places_change_no_word(rule, data):
    """Names, answers, shares and threshold turned: the same sentence; a tie has the other order."""
    verdicts, p_positive = data.draw(votes(rule))
    # Exact in the millionths that are counted, as 1 - p of a float is not.
    p_positive = np.round(p_positive * 1024) / 1024
    for answers, p in zip(verdicts, p_positive, strict=True):
        judged = rule.judge(answers, p.astype(np.float32))
        turned = mirrored(rule).judge(-answers, (1 - p).astype(np.float32))
        said, mirror = judged.reason(*NAMES), turned.reason(*NAMES[::-1])
        if judged.leaning is State.UNKNOWN:
            assert sorted(re.findall(r"\w+", said)) == sorted(re.findall(r"\w+", mirror))
        else:
            assert said == mirror


@given(rules(), st.data())
@settings(deadline=None)
def test_an_early_stop_names_the_winner_and_the_least_that_it_can_have(rule, data):
    """Whatever the answers that were not asked for would have said."""
    vote = rule.vote
    plain = FittedVote(
        vote.kind, vote.questions, vote.weights, (False,) * vote.n_used, vote.threshold
    )
    rule = AbstainRule(plain, rule.min_sureness)
    (answers, *_), (p, *_) = data.draw(votes(rule))
    n_asked = data.draw(st.integers(1, len(answers)))
    so_far = answers.copy()
    so_far[n_asked:] = MISSING
    judged = judged_so_far(rule, so_far, p)
    if judged is None:
        return
    sentence = judged.reason_so_far(*NAMES, n_open=5)
    assert judged.state is verdict_so_far(rule, so_far, p)
    if judged.state is State.UNKNOWN:
        assert "cannot become sure enough" in sentence
        return
    whole = rule.judge(answers, p)
    number, _, name = shown(sentence)
    assert name == NAMES[0 if whole.state is State.POSITIVE else 1]
    assert number <= Fraction(whole.confidence) + Fraction(1, 10**11)
    assert "at least" in sentence or "or more" in sentence
    assert sentence.endswith("the 5 answers that were not asked for cannot change it")


@pytest.mark.parametrize(
    ("verdicts", "sentence"),
    [
        ([[1, 1], [1, 1]], "100% of the valid votes speak for open"),
        ([[-1, -1], [-1, -1]], "100% of the valid votes speak for closed"),
        ([[0, -1], [-1, -1]], "100% of the valid votes speak for closed"),
        ([[0, 0], [0, 0]], "no answer was a clear yes or no"),
        (
            [[1, -1], [1, -1]],
            "the vote is a tie: 50% of the valid votes speak for open, 50% for closed",
        ),
        (
            [[1, 1], [0, -1]],
            "the vote is not sure enough (0.12 of the 0.50 that a verdict needs): 67% of the valid "
            "votes speak for open, 25% of all are invalid, 1 of 2 copies agree",
        ),
        (
            [[-1, -1], [0, 1]],
            "the vote is not sure enough (0.12 of the 0.50 that a verdict needs): 67% of the valid "
            "votes speak for closed, 25% of all are invalid, 1 of 2 copies agree",
        ),
    ],
)
def test_reasons(verdicts, sentence):
    rule = AbstainRule(equal_vote(range(2)), min_sureness=0.5)
    assert rule.judge(np.array(verdicts, np.int8)).reason("open", "closed") == sentence


@pytest.mark.parametrize(
    ("kind", "weights", "threshold", "column", "sentence", "confidence"),
    [
        (
            VoteKind.THRESHOLD, (1,) * 5, 0.3, [1, 1, -1, -1, -1],
            "the vote stands at 40% for open, less than half, but open wins above 30%", 0.4,
        ),
        (
            VoteKind.THRESHOLD, (1,) * 5, 0.3, [1, -1, -1, -1, -1],
            "the vote stands at 80% for closed, which wins above 70%", 0.8,
        ),
        (
            VoteKind.THRESHOLD, (1,) * 5, 0.7, [1, 1, 1, -1, -1],
            "the vote stands at 40% for closed, less than half, but closed wins above 30%", 0.4,
        ),
        (
            VoteKind.THRESHOLD, (1,) * 5, 0.4, [1, 1, -1, -1, -1],
            "the vote is a tie: it stands at 40% for open and 60% for closed, and each wins only "
            "above that", 0.6,
        ),
        (
            VoteKind.THRESHOLD, (1,) * 5, 0.5, [1, 1, -1, -1, -1],
            "60% of the valid votes speak for closed", 0.6,
        ),
        (
            VoteKind.THRESHOLD, (1,) * 5, 0.396, [1, 1, -1, -1, -1],
            "the vote stands at 40.0% for open, less than half, but open wins above 39.6%", 0.4,
        ),
        (
            VoteKind.WEIGHTED_ANSWERS, (1000, 1, 1, 1, 1), 0.5, [1, -1, -1, -1, -1],
            "the vote stands at 99.6% for open, which wins above 50.0%", 1000 / 1004,
        ),
        (
            VoteKind.WEIGHTED_ANSWERS, (1000, 1, 1, 1, 1), 0.5, [-1, 1, 1, 1, 1],
            "the vote stands at 99.6% for closed, which wins above 50.0%", 1000 / 1004,
        ),
        (
            VoteKind.WEIGHTED_ANSWERS, (1,) * 5, 0.5, [0, 0, 0, 0, -1],
            "the vote stands at 60% for closed, which wins above 50%", 0.6,
        ),
    ],
)  # fmt: skip
def test_reasons_of_votes_that_are_not_the_papers(
    kind, weights, threshold, column, sentence, confidence
):
    rule = AbstainRule(FittedVote(kind, tuple(range(5)), weights, (False,) * 5, threshold))
    judged = rule.judge(np.array([column], np.int8))
    assert judged.reason("open", "closed") == sentence
    assert judged.confidence == pytest.approx(confidence)


def test_a_narrow_majority_does_not_read_like_a_tie():
    answers = np.array([[1] * 101 + [-1] * 100], np.int8)
    said = AbstainRule(equal_vote(range(201))).judge(answers).reason("open", "closed")
    assert said == "50.2% of the valid votes speak for open"


def test_an_unsure_vote_of_another_kind_says_which_state_leads():
    rule = AbstainRule(FittedVote(VoteKind.THRESHOLD, (0, 1, 2), (1,) * 3, (False,) * 3, 0.4), 0.9)
    judged = rule.judge(np.array([[1, 1, -1], [1, 0, -1]], np.int8))
    assert judged.state is State.UNKNOWN
    assert judged.reason("open", "closed") == (
        "the vote is not sure enough (0.28 of the 0.90 that a verdict needs): the vote stands at "
        "60% for open, which leads above 40%; 17% of all are invalid, 2 of 2 copies agree"
    )
