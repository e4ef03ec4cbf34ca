"""Votes with abstain rules, and answers for them: strategies shared by tests."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import MILLION, Ballots, FittedVote, VoteKind

ANSWERS = st.sampled_from([-1, 0, 1])
FREE = st.just(0.0)
ANY = st.sampled_from([0.0, 0.0, 0.2, 0.5, 1.0])


@st.composite
def rules(draw, min_sureness=ANY, max_questions=4):
    """Any kind of vote on up to as many questions, some of the table perhaps unused."""
    used = draw(
        st.lists(st.integers(0, max_questions), min_size=1, max_size=max_questions, unique=True)
    )
    kind = draw(st.sampled_from(VoteKind))
    weights = [draw(st.sampled_from([1, 2, 3, 7, 1000])) for _ in used]
    flipped = [draw(st.booleans()) for _ in used]
    threshold = draw(st.sampled_from([0.5, 0.3, 0.6, 0.25, 0.9, 0.333333, 0.000001]))
    vote = FittedVote(kind, tuple(sorted(used)), tuple(weights), tuple(flipped), threshold)
    return AbstainRule(vote, draw(min_sureness))


@st.composite
def votes(draw, rule):
    """Verdicts and shares, (n_images, n_copies, n_questions), that a rule can be asked about."""
    n_questions = max(rule.vote.questions) + 1 + draw(st.integers(0, 1))
    shape = draw(st.integers(1, 3)), draw(st.integers(1, 4)), n_questions
    shares = st.sampled_from([0.0, 0.125, 0.5, 0.75, 1.0]) | st.floats(0, 1, width=32)
    return draw(arrays(np.int8, shape, elements=ANSWERS)), draw(
        arrays(np.float32, shape, elements=shares)
    )


def ballots_of(verdicts, p_positive) -> Ballots:
    """The same answers, added up over the copies."""
    millionths = np.rint(p_positive.astype(np.float64) * MILLION).astype(np.int64)
    return Ballots(
        positive=(verdicts > 0).sum(axis=1, dtype=np.int64),
        negative=(verdicts < 0).sum(axis=1, dtype=np.int64),
        n_copies=verdicts.shape[1],
        p_positive=millionths.sum(axis=1),
    )
