"""Frames and sentences say what the evaluation says."""

import numpy as np
import pytest

from vqa_state.answers.table import AnswerTable
from vqa_state.evaluation.held_out import evaluate
from vqa_state.questions.grid import QuestionGrid, Wording, phrases_for
from vqa_state.report.frames import comparison_frame, question_frame, score_frame
from vqa_state.search.objectives import Objective

QUESTIONS = QuestionGrid((Wording("door"),), phrases_for("open", "closed")).build().questions


def table(n_images, n_good):
    """Half open, half closed; the first `n_good` questions are always right, the others wrong."""
    labels = np.tile(np.array([1, -1], np.int8), n_images // 2)
    verdicts = np.repeat(labels[:, None, None], len(QUESTIONS), axis=2)
    verdicts[:, :, n_good:] *= -1
    ids = tuple(f"{number}" for number in range(n_images))
    return AnswerTable(ids, QUESTIONS, verdicts, np.ones(verdicts.shape, np.float32), labels)


def evaluated(n_test=20, n_good=4):
    chosen = dict.fromkeys(Objective, range(min(n_good, 3)))
    return evaluate(table(20, n_good), table(n_test, n_good) if n_test else None, chosen, seed=0)


def test_numbers_and_words_agree():
    evaluation = evaluated()
    numbers, words = score_frame(evaluation), comparison_frame(evaluation)
    assert list(numbers["subset"]) == list(words["subset"])
    assert words["test: recognized"][0] == "20 of 20 (16.6–20.0)"  # exact: 0.8316 of 20
    assert numbers["test_R_img_low"][0] == pytest.approx(0.025 ** (1 / 20))


def test_undefined_scores_are_dashes():
    words = comparison_frame(evaluated(n_test=0))
    assert (words["test: recognized"] == "–").all()


def test_questions_on_training_images():
    frame = question_frame(table(20, 4))
    assert list(frame["accuracy"]) == [1.0] * 4 + [0.0] * 12
    assert frame["question"][0] == "Is a door open?"
    assert (frame["invalid"] == 0).all()
