"""Which label next, which label again, which label to suggest: against plain loops, and by laws."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vqa_state.evaluation.label_ranking import closest_votes, doubtful_labels, suggestions
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import FittedVote, VoteKind

MARGIN = st.sampled_from([0.0, 0.5, -0.5, 1.0, -1.0, math.nan]) | st.floats(-1, 1)
MARGINS = st.integers(0, 8).flatmap(lambda n: arrays(np.float64, n, elements=MARGIN))


def names(margins):
    return [f"image{i}" for i in range(len(margins))]


@given(MARGINS)
def test_the_closest_vote_comes_first_and_none_is_lost(margins):
    ranked = closest_votes(names(margins), margins)
    assert sorted(one.image_id for one in ranked) == names(margins)
    known = [abs(one.margin) for one in ranked if not math.isnan(one.margin)]
    assert known == sorted(known)
    assert all(math.isnan(one.margin) for one in ranked[len(known) :])
    for one in ranked:
        assert np.array_equal(one.margin, margins[int(one.image_id[5:])], equal_nan=True)


@given(MARGINS)
def test_a_turned_vote_is_as_close(margins):
    turned = closest_votes(names(margins), -margins)
    assert [one.image_id for one in turned] == [
        one.image_id for one in closest_votes(names(margins), margins)
    ]


@given(MARGINS, st.sampled_from([0.25, 0.5, 1.0]), st.data())
def test_doubtful_labels_are_those_with_a_strong_vote_against(margins, strongly, data):
    labels = data.draw(arrays(np.int8, margins.size, elements=st.sampled_from([-1, 1])))
    listed = doubtful_labels(names(margins), labels, margins, strongly=strongly)
    expected = {
        name
        for name, label, margin in zip(names(margins), labels, margins, strict=True)
        if (margin <= -strongly if label > 0 else margin >= strongly)
    }
    assert {one.image_id for one in listed} == expected
    assert len(listed) == len(expected)
    strengths = [-one.label * one.margin for one in listed]
    assert strengths == sorted(strengths, reverse=True)
    fewer = doubtful_labels(names(margins), labels, margins, strongly=1.0)
    assert {one.image_id for one in fewer} <= expected


@given(MARGINS, st.sampled_from([0.0, 0.5, 1.0]))
def test_suggestions_are_the_votes_sides(margins, min_sureness):
    suggested = suggestions(names(margins), margins, min_sureness=min_sureness)
    expected = {
        name: (1 if margin > 0 else -1, abs(margin))
        for name, margin in zip(names(margins), margins, strict=True)
        if margin and abs(margin) >= min_sureness
    }
    assert {one.image_id: (one.label, one.sureness) for one in suggested} == expected
    assert [one.sureness for one in suggested] == sorted(
        (sure for _, sure in expected.values()), reverse=True
    )


def test_a_vote_of_the_abstain_rule_goes_straight_in():
    """What is suggested is what the recognizer would say, image by image."""
    rule = AbstainRule(FittedVote(VoteKind.PAPER, (0, 1, 2), (1, 1, 1), (False,) * 3, 0.5), 0.5)
    rng = np.random.default_rng(0)
    verdicts = rng.integers(-1, 2, (30, 2, 3)).astype(np.int8)
    margins, states = rule.margins(verdicts), rule.states(verdicts)
    suggested = suggestions(names(margins), margins, min_sureness=rule.min_sureness)
    assert {(one.image_id, one.label) for one in suggested} == {
        (name, state) for name, state in zip(names(margins), states.tolist(), strict=True) if state
    }
    assert 0 < len(suggested) < 30


def test_reasons():
    ranked = closest_votes(["a", "b", "c", "d"], np.array([0.25, -0.5, 0.0, math.nan]))
    assert [one.reason("open", "closed") for one in ranked] == [
        "the vote is a tie between open and closed",
        "the vote leans to open by 0.25 of 1",
        "the vote leans to closed by 0.50 of 1",
        "no answer was a clear yes or no",
    ]
    labels = np.array([1, -1], np.int8)
    first, second = doubtful_labels(["a", "b"], labels, np.array([-0.75, 0.5]))
    assert first.reason("open", "closed") == (
        "its label says open, but recognizers that were chosen without it say closed (by 0.75 of "
        "1): the label may be wrong, or the image is hard"
    )
    assert second.reason("open", "closed").startswith("its label says closed, but")
    assert "say open (by 0.50" in second.reason("open", "closed")


def test_what_does_not_fit_is_refused():
    one, label = np.zeros(1), np.ones(1, np.int8)
    for ranking in (closest_votes, suggestions):
        with pytest.raises(ValueError, match="one margin for each of 2"):
            ranking(["a", "b"], one)
        with pytest.raises(ValueError, match=r"margins must be in \[-1, 1\]"):
            ranking(["a"], one + 1.5)
    with pytest.raises(ValueError, match="labels must be 1 values"):
        doubtful_labels(["a"], 0 * label, one)
    for strongly in (0.0, 1.1, math.nan):
        with pytest.raises(ValueError, match="strongly must be"):
            doubtful_labels(["a"], label, one, strongly=strongly)
    with pytest.raises(ValueError, match="min_sureness must be"):
        suggestions(["a"], one, min_sureness=-0.1)
