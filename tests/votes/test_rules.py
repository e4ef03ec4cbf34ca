"""Votes against one answer at a time in fractions, and what they are counted from."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from vote_tables import COUNTED, literal_share, table_of, tables, votes

from vqa_state.answers.rates import count, score
from vqa_state.answers.table import MISSING
from vqa_state.votes.fitting import available_kinds, fit_vote
from vqa_state.votes.rules import MAX_WEIGHT, MILLION, Ballots, FittedVote, VoteKind


class TestDeciding:
    @given(st.data())
    @settings(max_examples=150)
    def test_as_one_answer_at_a_time_in_fractions(self, data):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        decided = vote.decide(Ballots.of_table(table))
        shares = vote.shares(Ballots.of_table(table))
        threshold = Fraction(round(vote.threshold * MILLION), MILLION)
        for image in range(table.n_images):
            share = literal_share(vote, table.verdicts[image], table.p_positive[image])
            if share is None:
                assert decided[image] == 0
                assert np.isnan(shares[image])
            else:
                assert decided[image] == (share > threshold) - (share < threshold)
                assert shares[image] == pytest.approx(float(share), abs=1e-12)

    @given(st.data())
    def test_the_papers_vote_is_the_papers_rule(self, data):
        table = data.draw(tables(min_images=2))
        subset = data.draw(st.sets(st.integers(0, table.n_questions - 1), min_size=1))
        vote = fit_vote(VoteKind.PAPER, Ballots.of_table(table), table.labels, sorted(subset))
        assert (set(vote.weights), vote.threshold) == ({1}, 0.5)
        recognized = vote.decide(Ballots.of_table(table)) == table.labels
        assert (recognized == score(count(table), sorted(subset)).recognized).all()

    @given(st.data())
    def test_margins_have_the_verdicts_sign_and_reach_one(self, data):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        ballots = Ballots.of_table(table)
        margins, shares = vote.margins(ballots), vote.shares(ballots)
        assert (np.sign(margins) == vote.decide(ballots)).all()
        assert (np.abs(margins) <= 1).all()
        assert (margins[shares == 1] == 1).all()
        assert (margins[shares == 0] == -1).all()

    @given(st.data(), st.integers(2, 50))
    def test_scaled_weights_change_nothing(self, data, factor):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        scaled = tuple(factor * weight for weight in vote.weights)
        other = FittedVote(vote.kind, vote.questions, scaled, vote.flipped, vote.threshold)
        ballots = Ballots.of_table(table)
        assert (vote.decide(ballots) == other.decide(ballots)).all()
        np.testing.assert_array_equal(vote.shares(ballots), other.shares(ballots))

    @given(st.data())
    def test_turned_verdicts_turn_the_decision(self, data):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        turned = table_of(-table.verdicts, -table.labels, 1 - table.p_positive.astype(np.float64))
        other = FittedVote(
            vote.kind, vote.questions, vote.weights, vote.flipped, round(1 - vote.threshold, 6)
        )
        before, after = Ballots.of_table(table), Ballots.of_table(turned)
        assume(vote.kind is not VoteKind.WEIGHTED_P_YES)  # float32 holds p and 1 - p unlike
        assert (vote.decide(before) == -other.decide(after)).all()

    @pytest.mark.parametrize(
        ("n_for", "n_all", "threshold"), [(3, 5, 0.6), (3, 10, 0.3), (29, 50, 0.58), (63, 90, 0.7)]
    )
    def test_a_tie_is_exact_where_floats_are_not(self, n_for, n_all, threshold):
        """In floats, 0.58 * 50 million and 0.7 * 90 million fall short of a whole number."""
        ballots = Ballots(np.array([[n_for]]), np.array([[n_all - n_for]]), n_all)
        vote = FittedVote(VoteKind.THRESHOLD, (0,), (1,), (False,), threshold)
        assert vote.decide(ballots)[0] == 0

    def test_no_valid_answer_is_unknown_whatever_the_threshold(self):
        ballots = Ballots(np.zeros((1, 2), int), np.zeros((1, 2), int), 6)
        for kind in COUNTED:
            vote = FittedVote(kind, (0, 1), (3, 1), (False, True), 0.2)
            assert vote.decide(ballots)[0] == 0
            assert vote.margins(ballots)[0] == 0

    @pytest.mark.parametrize(
        "changed",
        [
            {"weights": (0, 1)},
            {"weights": (1,)},
            {"weights": (1, MAX_WEIGHT + 1)},
            {"weights": (1, 1.5)},
            {"questions": (1, 0)},
            {"questions": (0, 0)},
            {"threshold": 0.0},
            {"threshold": 1.0},
            {"threshold": 0.12345678},
            {"questions": (), "weights": (), "flipped": ()},
        ],
    )
    def test_a_vote_refuses_what_a_file_must_not_hold(self, changed):
        good = {"questions": (0, 1), "weights": (1, 2), "flipped": (False,) * 2, "threshold": 0.5}
        FittedVote(VoteKind.PAPER, **good)
        with pytest.raises(ValueError):
            FittedVote(VoteKind.PAPER, **(good | changed))

    def test_p_yes_must_be_known(self):
        vote = FittedVote(VoteKind.WEIGHTED_P_YES, (0,), (1,), (False,), 0.5)
        unknown = Ballots.of_table(table_of([[[1]], [[-1]]], [1, -1]))
        with pytest.raises(ValueError, match="own share"):
            vote.decide(unknown)
        with pytest.raises(ValueError, match="own share"):
            fit_vote(VoteKind.WEIGHTED_P_YES, unknown, np.array([1, -1], np.int8), [0])


class TestBallots:
    @given(tables())
    def test_the_counts_are_those_of_the_table(self, table):
        made, counted = Ballots.of_table(table).counts(table.labels), count(table)
        for kind in ("correct", "wrong", "invalid", "labels"):
            assert (getattr(made, kind) == getattr(counted, kind)).all()
        back = Ballots.of_counts(counted)
        assert (back.positive == Ballots.of_table(table).positive).all()
        assert (back.negative == Ballots.of_table(table).negative).all()
        assert back.n_copies == table.n_copies

    def test_refuse_what_cannot_be(self):
        one, two = np.array([[1]]), np.array([[2]])
        with pytest.raises(ValueError, match="missing"):
            Ballots.of_table(table_of([[[MISSING]]], [1]))
        with pytest.raises(ValueError, match="copies"):
            Ballots(one, two, 2)
        with pytest.raises(ValueError, match="negative"):
            Ballots(-one, one, 2)
        with pytest.raises(ValueError, match="shape"):
            Ballots(one, np.array([[1, 1]]), 2)
        with pytest.raises(ValueError, match="above 1"):
            Ballots(one, one, 2, 2 * MILLION * np.array([[2]]))

    def test_one_unknown_share_leaves_the_kind_out(self):
        known = table_of([[[1, 1]], [[1, -1]]], [1, -1], [[[0.9, 0.8]], [[0.7, 0.1]]])
        some = table_of([[[1, 1]], [[1, -1]]], [1, -1], [[[0.9, np.nan]], [[0.7, 0.1]]])
        assert available_kinds(Ballots.of_table(known)) == tuple(VoteKind)
        assert available_kinds(Ballots.of_table(some)) == tuple(COUNTED)
