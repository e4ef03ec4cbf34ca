"""Tables of answers and votes on them, for the tests of both."""

from fractions import Fraction

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from vqa_state.answers.table import AnswerTable
from vqa_state.questions.grid import Question
from vqa_state.votes.rules import MILLION, FittedVote, VoteKind

COUNTED = [VoteKind.PAPER, VoteKind.THRESHOLD, VoteKind.WEIGHTED_ANSWERS]


def table_of(verdicts, labels, p_positive=None) -> AnswerTable:
    verdicts = np.asarray(verdicts, dtype=np.int8)
    if p_positive is None:
        p_positive = np.full(verdicts.shape, np.nan)
    return AnswerTable(
        image_ids=tuple(f"image{i}" for i in range(verdicts.shape[0])),
        questions=tuple(Question(f"Is it {q}?", yes_means=1) for q in range(verdicts.shape[2])),
        verdicts=verdicts,
        p_positive=np.asarray(p_positive, dtype=np.float32),
        labels=np.asarray(labels, dtype=np.int8),
    )


@st.composite
def tables(draw, min_images=1) -> AnswerTable:
    """Small tables with shares; the first two images have different states."""
    n_images = draw(st.integers(min_images, 8))
    shape = (n_images, draw(st.integers(1, 3)), draw(st.integers(1, 5)))
    verdicts = draw(hnp.arrays(np.int8, shape, elements=st.sampled_from([-1, 0, 1])))
    p = draw(hnp.arrays(np.float32, shape, elements=st.floats(0, 1, width=32)))
    labels = draw(hnp.arrays(np.int8, shape[:1], elements=st.sampled_from([-1, 1])))
    labels[:2] = [1, -1][:n_images]
    return table_of(verdicts, labels, p)


@st.composite
def votes(draw, n_questions, kinds=tuple(VoteKind)) -> FittedVote:
    chosen = draw(st.sets(st.integers(0, n_questions - 1), min_size=1))
    size = {"min_size": len(chosen), "max_size": len(chosen)}
    return FittedVote(
        kind=draw(st.sampled_from(kinds)),
        questions=tuple(sorted(chosen)),
        weights=tuple(draw(st.lists(st.integers(1, 20), **size))),
        flipped=tuple(draw(st.lists(st.booleans(), **size))),
        threshold=draw(st.sampled_from([0.25, 0.4, 0.5, 0.6, 1 / 8, 0.333333])),
    )


def literal_share(vote, verdicts, p) -> Fraction | None:
    """One answer at a time; (n_copies, n_questions) of one image."""
    positive = total = Fraction(0)
    for question, weight, flipped in zip(vote.questions, vote.weights, vote.flipped, strict=True):
        for said, sure in zip(verdicts[:, question], p[:, question], strict=True):
            said, sure = (-said, 1 - float(sure)) if flipped else (said, float(sure))
            if vote.kind is VoteKind.WEIGHTED_P_YES:
                given = Fraction(round(sure * MILLION), MILLION)
            elif vote.kind is VoteKind.WEIGHTED_ANSWERS:
                given = Fraction(1 + int(said), 2)
            elif said == 0:
                continue
            else:
                given = Fraction(int(said == 1))
            positive += weight * given
            total += weight
    if vote.kind is VoteKind.WEIGHTED_ANSWERS and not verdicts[:, list(vote.questions)].any():
        return None
    return positive / total if total else None


def skewed(seed, n_images=20, n_questions=12, n_copies=6) -> AnswerTable:
    """Answers that lean to the positive state, with a real signal; p is sure where answers are."""
    rng = np.random.default_rng(seed)
    labels = np.where(np.arange(n_images) < n_images // 2, 1, -1)
    evidence = (
        labels[:, None, None] * rng.uniform(0, 1.2, n_questions)
        + 0.8
        + rng.normal(0, 0.7, (n_images, 1, n_questions))
        + rng.normal(0, 0.3, (n_images, n_copies, n_questions))
    )
    verdicts = np.where(np.abs(evidence) < 0.1, 0, np.sign(evidence))
    return table_of(verdicts, labels, 1 / (1 + np.exp(-2 * evidence)))
