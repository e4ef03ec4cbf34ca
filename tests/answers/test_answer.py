"""An answer, and the table that the arithmetic reads."""

import numpy as np
import pytest

from vqa_state.answers.answer import Answer
from vqa_state.answers.table import MISSING, AnswerTable
from vqa_state.questions.grid import Question


@pytest.mark.parametrize(
    ("text", "yes_means", "verdict"),
    [("yes", 1, 1), ("yes", -1, -1), ("no", 1, -1), ("no", -1, 1), ("open", 1, 0), ("", -1, 0)],
)
def test_verdict_follows_the_questions_meaning(text, yes_means, verdict):
    assert Answer(text).verdict(yes_means) == verdict


@pytest.mark.parametrize("p_yes", [-0.1, 1.1, float("nan"), float("inf")])
def test_a_probability_outside_0_to_1_is_refused(p_yes):
    with pytest.raises(ValueError, match=r"p_yes must be in \[0, 1\]"):
        Answer("yes", p_yes)


def test_an_answer_is_plain_data():
    answer = Answer("no\ud800", np.float32(0.25))
    assert type(answer.p_yes) is float
    assert answer == Answer("no?", 0.25)


QUESTIONS = (Question("Is the door open?", 1), Question("Is the door closed?", -1))


def table(verdicts, labels=(1, -1), shape=(2, 1, 2)):
    values = np.array(verdicts, np.int8).reshape(shape)
    p = np.full(shape, np.nan, np.float32)
    return AnswerTable(("a", "b"), QUESTIONS, values, p, np.array(labels, np.int8))


def test_table_knows_its_sizes_and_gaps():
    answers = table([1, 0, -1, MISSING])
    assert (answers.n_images, answers.n_copies, answers.n_questions) == (2, 1, 2)
    assert answers.complete.tolist() == [True, False]
    kept = answers.take(answers.complete)
    assert (kept.image_ids, kept.labels.tolist()) == (("a",), [1])
    assert kept.verdicts.tolist() == [[[1, 0]]]


def test_table_refuses_what_does_not_fit():
    with pytest.raises(ValueError, match=r"\(2, 2, 2\), got \(2, 2, 1\)|shape"):
        table([1, 1, 1, 1], shape=(2, 2, 1))
    with pytest.raises(ValueError, match="shape"):
        table([1, 1, 1, 1], shape=(4,))
    with pytest.raises(ValueError, match=r"\+1 or -1"):
        table([1, 1, 1, 1], labels=(1, 0))
    with pytest.raises(ValueError, match="verdicts must be"):
        table([1, 2, 1, 1])


def test_an_empty_table_is_a_table():
    empty = AnswerTable(
        (),
        QUESTIONS,
        np.ones((0, 6, 2), np.int8),
        np.ones((0, 6, 2), np.float32),
        np.ones(0, np.int8),
    )
    assert (empty.n_images, empty.n_copies, empty.complete.shape) == (0, 6, (0,))
