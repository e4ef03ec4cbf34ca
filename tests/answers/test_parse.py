"""Free text → yes, no or invalid: as people judged it, and whatever the text is."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state.answers.parse import Reading, read_answer

YES, NO, INVALID = Reading.YES, Reading.NO, Reading.INVALID

#: Kind -> why, and by reading the texts; judged by hand by the question "would a careful person say
#: that it answers?", before a parser read them.
KINDS = json.loads(
    Path(__file__).parents[1].joinpath("answer_texts.json").read_text(encoding="utf-8")
)
CASES = [
    (kind, text, reading)
    for kind, judged in KINDS.items()
    for reading in Reading
    for text in judged.get(reading.value, [])
]


@pytest.mark.parametrize("kind", KINDS)
def test_texts_are_read_as_people_judged_them(kind):
    wrong = [
        (ascii(text), f"judged {reading}, read {read_answer(text)}")
        for own, text, reading in CASES
        if own == kind and read_answer(text) is not reading
    ]
    assert wrong == []


def test_the_table_of_texts_is_large_and_not_one_sided():
    assert len(KINDS) >= 15
    assert all(judged["why"] for judged in KINDS.values())
    texts = [text for _, text, _ in CASES]
    assert len(texts) == len(set(texts)) >= 600
    assert all(sum(r is reading for *_, r in CASES) >= 80 for reading in Reading)


MARKS = [
    ("<think>", "</think>"),
    ("<thinking>", "</thinking>"),
    ("<reasoning>", "</reasoning>"),
    ("<thought>", "</thought>"),
    ("<reflection>", "</reflection>"),
    ("[THINK]", "[/THINK]"),
    ("◁think▷", "◁/think▷"),
    ("<seed:think>", "</seed:think>"),
    ("<|begin_of_thought|>", "<|end_of_thought|>"),
    ("<|START_THINKING|>", "<|END_THINKING|>"),
    ("<|inner_prefix|>", "<|inner_suffix|>"),
    ("<|channel>thought\n", "<channel|>"),
    (
        "<|channel|>analysis<|message|>",
        "<|end|><|start|>assistant<|channel|>final<|message|>",
    ),
]


@given(
    st.sampled_from(MARKS),
    st.text(st.characters(codec="ascii", exclude_characters="<>[]{}|\\"), max_size=30),
)
def test_no_thought_is_an_answer_and_none_changes_one(marks, thought):
    opened, closed = marks
    assert read_answer(f"{opened}{thought}") is INVALID
    assert read_answer(f"{opened}Yes {thought}") is INVALID
    assert read_answer(f"{opened}{thought}{closed}No.") is NO
    assert read_answer(f"{thought}{closed}No.") is NO
    assert read_answer(f"Yes.{opened}{thought}") is YES


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
    announced = "think" in rest.lower() or "answer" in rest.lower()
    if first not in {*LIKE_YES_OR_NO, "answer", "assistant", "a"} and not announced:
        assert read_answer(f"{first} {rest}") is INVALID


@given(st.sampled_from(sorted(LIKE_YES_OR_NO)), st.sampled_from(["", ".", "!", ", it is", "\n"]))
def test_a_clear_first_word_is_read(first, rest):
    expected = NO if first[0] in "nfi" else YES
    assert read_answer(first + rest) is expected


@pytest.mark.parametrize(
    "piece",
    [
        *("<think>", "</think>", "<", "<a", " ", "no ", "not ", "é", "'-", "answer: ", "yes, no. "),
        *("the answer is ", "\\boxed{", "<|channel|>", "no, wait, ", '"*_', "so "),
    ],
)
@pytest.mark.timeout(120)  # steps that grow with the square would take hours
def test_a_very_long_text_is_read_to_its_end(piece):
    whole = piece * (200_000 // len(piece))
    assert read_answer(whole) in Reading
