"""The embedded model keeps the protocol, reads any question, and is what its card says."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from vqa_state import models
from vqa_state.embedded_training.experiments import questions_about
from vqa_state.embedded_training.lexicon import Evidence, lexicon, shares_a_word
from vqa_state.embedded_training.scenes import PAPER_THINGS, THINGS
from vqa_state.embedded_training.training_questions import (
    TrainingQuestion,
    make_training_questions,
)
from vqa_state.errors import ModelError
from vqa_state.models.embedded.model import EmbeddedModel
from vqa_state.models.embedded.network import N_VIEWS
from vqa_state.models.embedded.text import (
    MAX_WORDS,
    N_BUCKETS,
    N_PIECES,
    encode_questions,
    view_of,
    word_pieces,
    words,
)
from vqa_state.models.embedded.vocabulary import ANSWERS
from vqa_state.models.embedded.weights import WEIGHTS

ROOT = Path(__file__).parent.parent.parent.parent
LEXICON = lexicon().things
OPENABLE = [thing for thing, entry in LEXICON.items() if entry.has_door]
HELD_OUT_NOUNS = {thing: entry.held_out for thing, entry in LEXICON.items() if entry.held_out}
UNRELATED = lexicon().unrelated
QUESTIONS = [question.text for question in questions_about("transparent_door")]


@pytest.fixture(scope="module")
def model():
    return EmbeddedModel()


def noise(seed, size=(40, 30), mode="RGB"):
    pixels = np.random.default_rng(seed).integers(0, 256, (size[1], size[0], 3), np.uint8)
    return Image.fromarray(pixels).convert(mode)


def answers(model, images, questions):
    replies = list(model.answer(images, questions))
    return {(reply.image, reply.question): reply.outcome for reply in replies}


class TestContract:
    def test_is_registered_under_its_name(self):
        assert "embedded" in models.names()
        assert EmbeddedModel.name == "embedded"

    def test_every_pair_exactly_once(self, model):
        replies = list(model.answer([noise(1), noise(2)], QUESTIONS[:3]))
        pairs = [(reply.image, reply.question) for reply in replies]
        assert sorted(pairs) == [(i, q) for i in range(2) for q in range(3)]

    def test_nothing_asked_nothing_answered(self, model):
        assert list(model.answer([], QUESTIONS)) == []
        assert list(model.answer([noise(1)], [])) == []
        assert list(model.answer([], [])) == []

    def test_a_batch_answers_as_single_calls_do(self, model):
        images = [noise(seed) for seed in range(3)]
        together = answers(model, images, QUESTIONS[:5])
        for (i, q), outcome in together.items():
            alone = answers(model, [images[i]], [QUESTIONS[q]])[0, 0]
            assert alone.text == outcome.text
            assert alone.p_yes == pytest.approx(outcome.p_yes, abs=1e-5)

    @pytest.mark.parametrize("n_images", [2, 7, 9])
    def test_the_number_of_images_changes_no_digit(self, model, n_images):
        images = [noise(seed) for seed in range(n_images)]
        together = answers(model, images, QUESTIONS[:4])
        alone = answers(model, images[-1:], QUESTIONS[:4])
        assert [together[n_images - 1, q] for q in range(4)] == [alone[0, q] for q in range(4)]

    @pytest.mark.parametrize("n_questions", [1, 15, 64, 65])
    def test_the_number_of_questions_changes_no_digit(self, model, n_questions):
        questions = [f"{QUESTIONS[0]} {number}" for number in range(n_questions)]
        last = answers(model, [noise(1)], questions)[0, n_questions - 1]
        assert answers(EmbeddedModel(), [noise(1)], questions[-1:])[0, 0] == last

    def test_the_same_question_twice_is_answered_twice_alike(self, model):
        outcomes = answers(model, [noise(1)], [QUESTIONS[0], QUESTIONS[0]])
        assert outcomes[0, 0] == outcomes[0, 1]

    def test_two_instances_agree_in_every_digit(self, model):
        images = [noise(seed) for seed in range(2)]
        assert answers(model, images, QUESTIONS) == answers(EmbeddedModel(), images, QUESTIONS)

    def test_threads_get_what_one_thread_gets(self, model):
        images = [noise(seed) for seed in range(4)]
        expected = [answers(model, [image], QUESTIONS[:8]) for image in images]
        with ThreadPoolExecutor(4) as pool:
            got = list(pool.map(lambda i: answers(model, [i], QUESTIONS[:8]), images))
        assert got == expected

    @pytest.mark.parametrize(
        "image",
        [
            noise(1, mode="L"),
            noise(1, mode="P"),
            noise(1, mode="1"),
            noise(1, mode="RGBA"),
            noise(1, mode="CMYK"),
            noise(1, size=(1, 1)),
            noise(1, size=(1, 900)),
            Image.new("RGB", (5000, 4000), "gray"),
        ],
        ids=["grey", "palette", "bits", "alpha", "cmyk", "pixel", "line", "huge"],
    )
    def test_odd_images_are_answered(self, model, image):
        outcome = answers(model, [image], ["Is this door open?"])[0, 0]
        assert outcome.text
        assert 0 <= outcome.p_yes <= 1

    @pytest.mark.parametrize(
        "question", ["", "?", "Ist die Tür offen?", "門は開いていますか", "open " * 200, "😀"]
    )
    def test_odd_questions_are_answered(self, model, question):
        assert answers(model, [noise(1)], [question])[0, 0].text

    def test_p_yes_agrees_with_a_yes_or_no(self, model):
        for outcome in answers(model, [noise(1)], QUESTIONS).values():
            if outcome.text in ("yes", "no"):
                assert (outcome.p_yes >= 0.5) == (outcome.text == "yes")


class TestWeights:
    def test_are_small(self):
        assert WEIGHTS.stat().st_size <= 20e6

    def test_missing_weights_say_what_to_do(self, tmp_path):
        with pytest.raises(ModelError, match="install the package again"):
            EmbeddedModel(tmp_path / "none.safetensors")

    def test_damaged_weights_say_what_to_do(self, tmp_path):
        cut = tmp_path / "cut.safetensors"
        cut.write_bytes(WEIGHTS.read_bytes()[:1000])
        with pytest.raises(ModelError, match="install the package again"):
            EmbeddedModel(cut)

    def test_other_weights_have_another_fingerprint(self, model, tmp_path):
        changed = bytearray(WEIGHTS.read_bytes())
        changed[-1] ^= 1
        other = tmp_path / "other.safetensors"
        other.write_bytes(changed)
        assert EmbeddedModel(other).fingerprint != model.fingerprint
        assert EmbeddedModel().fingerprint == model.fingerprint


class TestTokenizer:
    @given(st.text(max_size=300))
    def test_any_text_gives_buckets_of_one_shape(self, text):
        buckets = encode_questions([text])
        assert buckets.shape == (1, MAX_WORDS, N_PIECES)
        assert buckets.min() >= 0
        assert buckets.max() < N_BUCKETS
        assert buckets[0, 0, 0] > 0

    @given(st.text(alphabet=st.characters(categories=["L"]), min_size=1, max_size=40))
    def test_pieces_of_a_word_depend_on_the_word_alone(self, word):
        assert word_pieces(word) == word_pieces(word)
        assert 0 < len(word_pieces(word)) <= N_PIECES
        assert min(word_pieces(word)) > 0

    def test_case_and_punctuation_do_not_matter(self):
        plain = encode_questions(["is this door open"])
        assert (encode_questions(["Is THIS door, open?"]) == plain).all()

    def test_contractions_are_read(self):
        assert words("Isn't it open?") == ["is", "not", "it", "open"]

    def test_batch_equals_single(self):
        rows = encode_questions(QUESTIONS)
        assert all(
            (encode_questions([question])[0] == row).all()
            for question, row in zip(QUESTIONS, rows, strict=True)
        )

    def test_hashes_are_the_same_for_ever(self):
        # The weights belong to these numbers.
        assert word_pieces("door") == [880, 605, 347, 3483, 3670]


class TestViews:
    def test_the_words_alone_decide(self):
        assert view_of("Is this door open?", N_VIEWS) == view_of("is THIS door, open", N_VIEWS)

    def test_a_grid_reads_all_views(self):
        views = [view_of(question, N_VIEWS) for question in QUESTIONS]
        assert set(views) == set(range(N_VIEWS))
        assert max(views.count(view) for view in range(N_VIEWS)) < len(QUESTIONS) / 2


def questions_on(thing):
    return make_training_questions(thing, 3000, np.random.default_rng(0))


class TestTrainingQuestions:
    @pytest.mark.parametrize("thing", THINGS)
    def test_all_answers_are_in_the_vocabulary(self, thing):
        asked = make_training_questions(thing, 300, np.random.default_rng(0))
        assert {
            answer for question in asked for answer in (question.when_true, question.when_false)
        } <= set(ANSWERS)
        assert len({question.text for question in asked}) == len(asked)

    @pytest.mark.parametrize(
        ("question", "when_open"),
        [
            ("Is the door open?", "yes"),
            ("Is the door closed?", "no"),
            ("Is the door not open?", "no"),
            ("Is the door not closed?", "yes"),
        ],
    )
    def test_state_questions_follow_the_label(self, question, when_open):
        asked = make_training_questions("door", 8000, np.random.default_rng(0))
        one = next(one for one in asked if one.text == question)
        assert one.answer(True, {}) == when_open
        assert one.answer(False, {}) == ("no" if when_open == "yes" else "yes")

    def test_nobody_is_asked_for_an_unknown_fact(self):
        evidence = Evidence("degree", 0.65, 1.0)
        question = TrainingQuestion("Is the door wide open?", "yes", "no", evidence)
        assert question.answer(True, {}) is None
        assert question.answer(True, {"degree": 0.3}) == "no"
        assert question.answer(True, {"degree": 0.9}) == "yes"

    def test_held_out_nouns_are_never_taught(self):
        for thing, nouns in HELD_OUT_NOUNS.items():
            taught = " | ".join(question.text for question in questions_on(thing)).lower()
            assert not [noun for noun in nouns if f" {noun} " in taught]

    def test_wholly_new_words_are_in_no_question_about_anything(self):
        taught = {
            word for thing in THINGS for one in questions_on(thing) for word in words(one.text)
        }
        new = [
            noun for nouns in HELD_OUT_NOUNS.values() for noun in nouns if not shares_a_word(noun)
        ]
        assert len(new) >= len(HELD_OUT_NOUNS)
        assert taught.isdisjoint(word for noun in new for word in words(noun))

    @pytest.mark.parametrize(
        ("noun", "shares"),
        [
            ("front door", True),
            ("Shoulder Bag", True),
            ("tap water", True),  # "tap" is in a tail
            ("icebox", True),
            ("cabin", True),
            ("lighting", True),
            ("exit", False),
            ("wardrobe", False),
            ("vase in", True),
            ("a", False),
        ],
    )
    def test_a_noun_shares_a_word_with_the_lexicon(self, noun, shares):
        assert shares_a_word(noun) == shares

    def test_every_thing_is_asked_with_both_kinds_of_new_nouns(self):
        for nouns in HELD_OUT_NOUNS.values():
            assert {shares_a_word(noun) for noun in nouns} == {True, False}

    def test_unrelated_questions_have_no_answer(self):
        asked = {question.text: question for question in questions_on("door")}
        unrelated = [asked[text] for text in UNRELATED if text in asked]
        assert unrelated
        assert {question.answer(True, {}) for question in unrelated} == {"none"}

    @pytest.mark.parametrize("thing", sorted(OPENABLE))
    def test_no_door_is_denied_to_be_a_door(self, thing):
        asked = make_training_questions(thing, 2000, np.random.default_rng(1))
        nouns = {noun for other in OPENABLE for noun in LEXICON[other].nouns}
        # A lid may be that of a laptop, and a window's curtain is no window.
        nouns -= {*LEXICON["laptop"].nouns, "window"}
        denied = [
            question.text
            for question in asked
            if question.when_true == "none" and question.text not in UNRELATED
        ]
        assert denied
        assert not [text for text in denied if any(f" {noun} " in text for noun in nouns)]


def test_false_premises_are_invalid(model):
    files = sorted((ROOT / "projects" / "refrigerator" / "images").glob("*.jpg"))[:10]
    pictures = [Image.open(file).convert("RGB") for file in files]
    questions = ["Is this bag open?", "Is the TV on?", "Is water running from this faucet?"]
    outcomes = answers(model, pictures, questions).values()
    invalid = sum(outcome.verdict(1) == 0 for outcome in outcomes)
    assert len(outcomes) == 30
    assert invalid >= 24


def test_grids_are_the_papers():
    sizes = {thing: len(questions_about(thing)) for thing in PAPER_THINGS}
    assert sizes == {
        "door": 16,
        "elevator": 32,
        "cabinet": 64,
        "refrigerator": 32,
        "microwave": 64,
        "transparent_door": 64,
        "light": 32,
        "display": 64,
        "handbag": 32,
        "water": 32,
    }


@pytest.mark.parametrize("thing", PAPER_THINGS)
def test_recognizes_most_sample_pictures(model, thing):
    folder = ROOT / "projects" / thing
    images = json.loads((folder / "project.json").read_text("utf-8"))["images"]
    questions = questions_about(thing)
    files = [folder / "images" / f"{image['id']}.{image['suffix']}" for image in images]
    pictures = [Image.open(file).convert("RGB") for file in files]
    outcomes = answers(model, pictures, [question.text for question in questions])
    votes = [
        sum(outcomes[row, q].verdict(question.yes_means) for q, question in enumerate(questions))
        for row in range(len(images))
    ]
    right = sum(vote * image["label"] > 0 for vote, image in zip(votes, images, strict=True))
    assert len(images) == 40
    assert right >= 0.8 * len(images)
