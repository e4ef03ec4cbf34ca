"""What every kind of vote has to keep; a new kind is tested by being registered."""

import numpy as np
import pytest
from ruling import ballots_of

from vqa_state.votes.early_stop import calls_needed
from vqa_state.votes.fitting import fit_vote
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import MAX_WEIGHT, FittedVote, VoteKind


@pytest.fixture(params=VoteKind, ids=str)
def kind(request):
    return request.param


def answers(seed=0, n_images=12, n_copies=3, n_questions=5):
    """Answers that lean to the label, (images, copies, questions), shares, and labels."""
    rng = np.random.default_rng(seed)
    labels = np.where(np.arange(n_images) % 2, 1, -1).astype(np.int8)
    p = rng.beta(2, 2, (n_images, n_copies, n_questions)) + 0.2 * labels[:, None, None]
    shares = np.clip(p, 0, 1).astype(np.float32)
    verdicts = np.where(shares > 0.55, 1, np.where(shares < 0.45, -1, 0)).astype(np.int8)
    return verdicts, shares, labels


def fitted(kind, seed=0) -> FittedVote:
    verdicts, shares, labels = answers(seed)
    return fit_vote(kind, ballots_of(verdicts, shares), labels, (0, 2, 3))


def test_a_name_and_how_it_counts(kind):
    assert VoteKind(kind.rule.name) is kind
    assert kind.weighted or not kind.by_p_yes


def test_what_is_learned_is_a_vote_and_repeats(kind):
    vote = fitted(kind)
    assert vote == fitted(kind)
    assert (vote.kind, vote.questions) == (kind, tuple(sorted(set(vote.questions))))
    assert 0 < vote.threshold < 1
    assert max(vote.weights) <= (MAX_WEIGHT if kind.weighted else 1)


def test_it_recognizes_more_than_half_of_what_it_learned_from(kind):
    verdicts, shares, labels = answers()
    assert (fitted(kind).decide(ballots_of(verdicts, shares)) == labels).mean() > 0.5


def test_whole_tables_and_single_images_agree(kind):
    verdicts, shares, _ = answers(1)
    vote = fitted(kind)
    p_positive = shares if kind.by_p_yes else None
    rule = AbstainRule(vote)
    states = rule.states(verdicts, p_positive)
    assert (states == vote.decide(ballots_of(verdicts, shares))).all()
    needed = calls_needed(rule, verdicts, p_positive)
    assert (needed <= vote.n_used * verdicts.shape[1]).all()
