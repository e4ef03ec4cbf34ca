"""Ready cues: they fit the grid, the model was taught them, and nothing is asked twice."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state.embedded_training.lexicon import Evidence, lexicon
from vqa_state.errors import QuestionError
from vqa_state.questions.cues import CUED_STATES, ready_cues, with_cues
from vqa_state.questions.grid import Form, QuestionGrid, Wording, phrases_for

DOOR = Wording("elevator door")


def test_ask_in_the_things_own_name():
    texts = {question.text: question.yes_means for question in ready_cues("open", DOOR)}
    assert texts["Is the elevator door wide open?"] == 1
    assert texts["Does this image look like this elevator door is completely closed?"] == -1
    assert texts["Is the inside visible?"] == 1


def test_water_keeps_its_place():
    wording = Wording("water", "from {article} faucet")
    texts = {question.text for question in ready_cues("running", wording)}
    assert "Is water flowing in a strong stream from the faucet?" in texts


@pytest.mark.parametrize("state", CUED_STATES)
def test_both_states_are_asked_for(state):
    cues = ready_cues(state, DOOR)
    assert {question.yes_means for question in cues} == {1, -1}
    assert {question.form for question in cues} == {Form.CUSTOM}
    assert len({question.text for question in cues}) == len(cues)


def test_every_cue_was_taught_to_the_embedded_model():
    taught = {
        words
        for ways in lexicon().evidence.values()
        for evidence in ways
        for words in (*evidence.phrases, *evidence.questions)
    }
    for state in CUED_STATES:
        for question in ready_cues(state, Wording("thing")):
            assert any(words.removesuffix("?") in question.text for words in taught), question.text


def test_adding_twice_adds_once():
    grid = QuestionGrid((DOOR,), phrases_for("open", "closed"))
    once = with_cues(grid, "open")
    assert with_cues(once, "open") == once
    assert len(once.build().questions) == 16 + len(ready_cues("open", DOOR))
    assert not once.build().duplicates


def test_a_state_without_cues_says_for_which_there_are():
    with pytest.raises(QuestionError, match="open, on, lit, running"):
        with_cues(QuestionGrid((DOOR,)), "clean")


def test_a_thing_without_a_name_is_named_first():
    with pytest.raises(QuestionError, match="name the thing first"):
        with_cues(QuestionGrid(), "open")


class TestEvidence:
    @given(st.floats(0, 1))
    def test_ever_wider_phrases_hold_ever_less_often(self, degree):
        steps = [
            each
            for each in lexicon().evidence_of("door")
            if each.fact == "degree" and each.up_to == 1
        ]
        held = [each.holds(degree > 0, {"degree": degree}) for each in steps]
        assert held == sorted(held, reverse=True)

    def test_of_a_photo_only_the_label_is_known(self):
        at_all, wide = Evidence("degree", 0.02, 1.0), Evidence("degree", 0.65, 1.0)
        shut = Evidence("degree", -1.0, 0.02)
        assert (at_all.holds(True, {}), at_all.holds(False, {})) == (True, False)
        assert (shut.holds(True, {}), shut.holds(False, {})) == (False, True)
        assert wide.holds(True, {}) is None
        assert Evidence("flush", 0.5, 1.0).holds(False, {}) is None
