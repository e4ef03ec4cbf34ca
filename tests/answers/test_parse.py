"""Free text → yes, no or invalid; and the table that the arithmetic reads."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state.answers.parse import Answer, Reading, read_answer
from vqa_state.answers.table import MISSING, AnswerTable
from vqa_state.questions.grid import Question

YES, NO, INVALID = Reading.YES, Reading.NO, Reading.INVALID

CASES = [
    # plain
    ("yes", YES),
    ("no", NO),
    ("Yes.", YES),
    ("No!", NO),
    (" no ", NO),
    ("\n\tYES\n", YES),
    ("yes yes yes yes", YES),
    ("No, no, no.", NO),
    ("Yes, the door is open.", YES),
    ("No, the door is closed.", NO),
    ("No the door is closed", NO),
    ("yes it is", YES),
    ("no\nThe image shows a wall.", NO),
    ("Yeah, it is", YES),
    ("yep", YES),
    ("Yup.", YES),
    ("nope", NO),
    ("Nah", NO),
    ("True", YES),
    ("False.", NO),
    ("Correct", YES),
    ("Incorrect.", NO),
    # around the answer
    ("Assistant: Yes", YES),
    ("assistant\nNo", NO),
    ("Answer: no", NO),
    ("A: Yes", YES),
    ("answer - No", NO),
    ("**Answer:** Yes", YES),
    ("**Answer**: no", NO),
    ("__Answer__: no", NO),
    ('{"answer": "yes"}', YES),
    ("A door: no", INVALID),
    ("**Yes**", YES),
    ("*no*", NO),
    ("_Yes_", YES),
    ('"Yes"', YES),
    ("(no)", NO),
    ("[Yes]", YES),
    ("- yes", YES),
    ("No.<end_of_utterance>", NO),
    ("<s>Yes</s>", YES),
    ("<|im_start|>assistant\nNo<|im_end|>", NO),
    ("<p>Yes</p>", YES),
    # thinking
    ("<think>No obstacle is there. Hm, no.</think>Yes", YES),
    ("<think>\nYes?\n\nMaybe not.\n</think>\n\nNo.", NO),
    ("The door seems open, I am not sure.</think> Yes", YES),
    ("<think>No, wait, the door", INVALID),
    ("Yes <think>no", YES),
    ("<THINK>no</THINK>yes", YES),
    # Unicode
    ("Ｙｅｓ", YES),
    ("ＮＯ．", NO),
    ("𝐘𝐞𝐬", YES),
    ("\ufeffNo", NO),
    ("\u200bYes\u200b", YES),
    ("Yes\u00a0\u3000", YES),
    ("✅ Yes", YES),
    ("No – it is closed", NO),
    ("No — yes would be wrong", NO),
    ("yés", INVALID),
    ("はい", INVALID),
    ("Да", INVALID),
    ("👍", INVALID),
    # words that only begin like an answer
    ("None", INVALID),
    ("none of them", INVALID),
    ("Nothing", INVALID),
    ("Not sure", INVALID),
    ("Not really", INVALID),
    ("Now closed", INVALID),
    ("north", INVALID),
    ("nobody", INVALID),
    ("no-one", INVALID),
    ("no‑one", INVALID),
    ("No one", INVALID),
    ("no one is there", INVALID),
    ("No, no one is there", NO),
    ("No idea.", INVALID),
    ("Yesterday", INVALID),
    ("yes1", INVALID),
    ("N/A", INVALID),
    ("No2", INVALID),
    ("unanswerable", INVALID),
    # both words
    ("Yes and no", INVALID),
    ("Yes, and no", INVALID),
    ("Yes or no?", INVALID),
    ("No and yes.", INVALID),
    ("yes no", INVALID),
    ("yes no yes", INVALID),
    ("Yes, no.", INVALID),
    ("yes/no", INVALID),
    ("Yes / No: the door", INVALID),
    ("No that is not correct", INVALID),
    ("No, that is not correct", NO),
    ("Yes, there is no obstacle", YES),
    ("Yes. There is no one at the door.", YES),
    ("No: yes would mean open", NO),
    ("yes there is no obstacle", INVALID),
    # hedges
    ("maybe", INVALID),
    ("Yes, maybe", INVALID),
    ("Yes, probably.", INVALID),
    ("No, perhaps not", INVALID),
    ("No, I am not sure", INVALID),
    ("Yes, but I'm not entirely sure.", INVALID),
    ("No, I cannot tell", INVALID),
    ("No, I can’t tell", INVALID),
    ("I cannot tell", INVALID),
    ("No, it cannot be determined", INVALID),
    ("No, it is impossible to tell", INVALID),
    ("Yes, it is hard to say", INVALID),
    ("No, I don't know", INVALID),
    ("No, it is unclear", INVALID),
    # a clear no with a negated verb behind it
    ("No, I don't see an open door.", NO),
    ("No, I do not think so.", NO),
    # no yes or no in front
    ("open", INVALID),
    ("closed", INVALID),
    ("Closed.", INVALID),
    ("The door is open.", INVALID),
    ("The answer is yes", INVALID),
    ("It is not", INVALID),
    ("2", INVALID),
    ("", INVALID),
    ("   ", INVALID),
    ("...", INVALID),
    ("<unk>", INVALID),
    ("<yes>", INVALID),
    ("\x00", INVALID),
    ("\ud800", INVALID),
]


@pytest.mark.parametrize(("text", "reading"), CASES, ids=[ascii(text) for text, _ in CASES])
def test_reading(text, reading):
    assert read_answer(text) is reading


def test_the_table_of_cases_is_not_one_sided():
    assert len(CASES) >= 70
    assert all(sum(r is reading for _, r in CASES) >= 20 for reading in Reading)


words = st.sampled_from(
    [
        *("yes", "no", "Yes", "NO", "nope", "true", "not", "maybe", "door", "open", "one", "and"),
        *("<b>", "<think>", "</think>", "<", ",", ".", " ", "\n", "-", "’", "answer:", "_", "é"),
    ]
)
texts = st.one_of(
    st.text(), st.lists(words, max_size=12).map(" ".join), st.lists(words).map("".join)
)


@given(texts)
def test_any_text_has_a_reading(text):
    assert read_answer(text) in Reading


@given(texts, st.text(alphabet=" \t\r\n\u00a0\u3000"), st.text(alphabet=" \t\r\n\u00a0\u3000"))
def test_space_around_does_not_matter(text, before, after):
    assert read_answer(before + text + after) is read_answer(text)


@given(st.lists(words, max_size=12).map(" ".join))
def test_case_does_not_matter(text):
    readings = {read_answer(t) for t in (text, text.upper(), text.lower(), text.swapcase())}
    assert len(readings) == 1


LIKE_YES_OR_NO = {"yes", "yeah", "yep", "yup", "true", "correct", "no", "nope", "nah", "false"}
LIKE_YES_OR_NO |= {"incorrect"}


@given(st.from_regex(r"[a-z]{1,9}", fullmatch=True), texts)
def test_another_first_word_is_invalid(first, rest):
    if first not in {*LIKE_YES_OR_NO, "answer", "assistant", "a"} and "think" not in rest.lower():
        assert read_answer(f"{first} {rest}") is INVALID


@given(st.sampled_from(sorted(LIKE_YES_OR_NO)), st.sampled_from(["", ".", "!", ", it is", "\n"]))
def test_a_clear_first_word_is_read(first, rest):
    expected = NO if first[0] in "nfi" else YES
    assert read_answer(first + rest) is expected


@pytest.mark.parametrize("piece", ["<think>", "</think>", "<", "<a", " ", "no ", "not ", "é", "'-"])
def test_a_very_long_text_takes_no_long_time(piece):
    began = time.perf_counter()
    read_answer(piece * 50_000)
    assert time.perf_counter() - began < 2


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
