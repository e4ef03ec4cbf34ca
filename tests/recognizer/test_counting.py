"""Every kind of vote of a recognizer against its formula, stopped early or not."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_recognizers import QUESTIONS, recognizer, saying
from pictures import draw

from vqa_state.answers.answer import Answer
from vqa_state.errors import RecognizerError
from vqa_state.images.augmentation import AugmentationKind
from vqa_state.recognizer.recognizer import (
    Abstain,
    Copies,
)
from vqa_state.votes.rules import VoteKind
from vqa_state.votes.state import State


def naive(kind, questions, threshold, said, p_yes):
    """The formulas of `voting.kinds`, in fractions; 0 is unknown."""
    above = total = valid = Fraction(0)
    for question, answers, shares in zip(questions, said, p_yes, strict=True):
        for speaks_for, p in zip(answers, shares, strict=True):
            weight = question.weight
            valid += weight * abs(speaks_for)
            if kind is VoteKind.WEIGHTED_P_YES:
                exact = Fraction(round(p * 1_000_000), 1_000_000)
                above += weight * (exact if question.yes_means > 0 else 1 - exact)
                total += weight
            elif kind is VoteKind.WEIGHTED_ANSWERS:
                above += weight * Fraction(1 + speaks_for, 2)
                total += weight
            else:
                above += weight * (speaks_for > 0)
                total += weight * abs(speaks_for)
    if not total or (kind is not VoteKind.WEIGHTED_P_YES and not valid):
        return 0
    difference = above / total - Fraction(round(threshold * 1_000_000), 1_000_000)
    return (difference > 0) - (difference < 0)


TEXTS = {1: ("yes", "no", "door"), -1: ("no", "yes", "door")}  # by yes_means: for, against, neither


@given(
    st.sampled_from(VoteKind),
    st.lists(st.integers(1, 1000), min_size=3, max_size=3),
    st.integers(1, 999_999),
    st.lists(st.tuples(st.sampled_from([1, -1, 0]), st.floats(0, 1)), min_size=6, max_size=6),
    st.sampled_from([0, 0.2, 0.7]),
)
def test_every_kind_of_vote_against_its_formula_and_early_stops(
    kind, weights, millionths, said, least
):
    threshold = 0.5 if kind is VoteKind.PAPER else millionths / 1_000_000
    if kind in (VoteKind.PAPER, VoteKind.THRESHOLD):
        weights = [1, 1, 1]
    questions = tuple(
        one.model_copy(update={"weight": weight})
        for one, weight in zip(recognizer().questions, weights, strict=True)
    )
    one = recognizer(vote=kind, questions=questions, threshold=threshold)
    cautious = one.model_copy(update={"abstain": Abstain(min_sureness=least)})
    replies = dict(zip([(c, t) for c in range(2) for t in QUESTIONS], said, strict=True))

    def answer(copy, text):
        speaks_for, p_yes = replies[copy, text]
        yes_means = next(q.yes_means for q in questions if q.text == text)
        return Answer(TEXTS[yes_means][(1, -1, 0).index(speaks_for)], p_yes)

    answers = {place: answer(*place) for place in replies}
    verdict = one.verdict(one.votes(answers))
    states = {1: State.POSITIVE, -1: State.NEGATIVE, 0: State.UNKNOWN}
    columns = [[replies[c, text] for c in range(2)] for text in QUESTIONS]
    expected = naive(
        kind,
        questions,
        threshold,
        [[speaks_for for speaks_for, _ in column] for column in columns],
        [[p for _, p in column] for column in columns],
    )
    assert verdict.state is states[expected]
    whole = cautious.verdict(cautious.votes(answers))
    assert whole.state in (verdict.state, State.UNKNOWN)
    if whole.state is State.UNKNOWN and verdict.state is not State.UNKNOWN:
        assert "not sure enough" in whole.reason
        assert whole.sureness < least
    first = cautious.verdict_so_far(cautious.votes(answers, n_copies=1))
    if first is not None:
        assert first.state is whole.state
        low, high = sorted((first.sureness, whole.sureness))
        unknown = first.state is State.UNKNOWN
        assert high - low < 1e-9 or (first.sureness == high) == unknown
    last = cautious.verdict_so_far(cautious.votes(answers))
    assert (last.state, last.sureness) == (whole.state, whole.sureness)


def test_early_stop_says_the_same_with_fewer_calls():
    copied = {"kind": AugmentationKind.RGB_SHIFT, "amount": 0.1, "n_copies": 5, "seed": 0}
    one = recognizer(copies=Copies(**copied), calls_per_image=15)
    clear = saying(a="yes", b="no", c="yes")
    verdict = one.recognize(draw(1), clear, stop_early=True)
    assert (verdict.state, verdict.n_calls, verdict.n_skipped) == (State.POSITIVE, 9, 6)
    assert len(clear.asked) == 9
    assert "6 answers that were not asked for cannot change it" in verdict.reason
    tie = saying(a="yes", b="yes", c="door")
    verdict = one.recognize(draw(1), tie, stop_early=True)
    assert (verdict.state, verdict.n_calls, verdict.n_skipped) == (State.UNKNOWN, 15, 0)


def test_a_closed_door_is_told_by_the_votes_for_closed():
    one = recognizer()
    shut = saying(a="no", b="yes", c="no")
    verdict = one.recognize(draw(1), shut)
    assert (verdict.state_name, verdict.confidence) == ("closed", 1.0)
    assert verdict.reason == "100% of the valid votes speak for closed"
    copied = {"kind": AugmentationKind.RGB_SHIFT, "amount": 0.1, "n_copies": 5, "seed": 0}
    many = recognizer(copies=Copies(**copied), calls_per_image=15)
    verdict = many.recognize(draw(1), shut, stop_early=True)
    assert (verdict.n_skipped, verdict.confidence) == (6, 0.6)
    assert verdict.reason == (
        "at least 60% of the valid votes speak for closed: the 6 answers that were not asked for "
        "cannot change it"
    )


def test_a_vote_by_probabilities_needs_them():
    one = recognizer(vote=VoteKind.WEIGHTED_P_YES)
    with pytest.raises(RecognizerError, match="the model gave none"):
        one.recognize(draw(1), saying(a="yes", b="no", c="yes"))
