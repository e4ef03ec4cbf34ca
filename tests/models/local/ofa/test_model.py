"""The port of OFA against the authors' own implementation, whose results stand in golden/ofa."""

import hashlib

import numpy as np
import ofa_weights
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from ofa_golden import (
    GOLDEN,
    REFERENCE,
    encode,
    shapes_of,
    write_folder,
)
from PIL import Image

from vqa_state.models.local.ofa.config import AskingStyle, DecoderPrompt, OfaConfig, read_folder
from vqa_state.models.local.ofa.decoding import BeamSearch, beam_search, best_answer, start
from vqa_state.models.local.ofa.loading import load_network
from vqa_state.models.local.ofa.network import fixed_buffers
from vqa_state.models.local.ofa.preprocessing import clean_question, to_pixels
from vqa_state.models.local.ofa.tokenizer import OfaTokenizer


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("ofa")
    write_folder(made)
    return made


@pytest.fixture(scope="module")
def network(folder):
    return load_network(folder, read_folder(folder)[0], torch.float32)


# The network


@pytest.mark.parametrize("size", ofa_weights.SIZES)
def test_every_public_size_has_the_keys_and_shapes_of_the_reference(size):
    shapes = shapes_of(OfaConfig(**ofa_weights.sizes_config(size)))
    lines = [f"{name} {list(shape)}" for name, shape in sorted(shapes.items())]
    assert len(lines) == REFERENCE["keys"][size]["n_keys"]
    digest = hashlib.sha256("\n".join(lines).encode()).hexdigest()
    assert digest == REFERENCE["keys"][size]["sha256"]


def test_calculated_tables_are_those_of_the_reference():
    made = {
        name: hashlib.sha256(value.numpy().astype("<i8").tobytes()).hexdigest()
        for name, value in fixed_buffers(OfaConfig()).items()
    }
    assert made == REFERENCE["buffers"]


@pytest.mark.parametrize("case", REFERENCE["forward"], ids=lambda case: f"{case['side']} px")
def test_states_and_logits_are_those_of_the_reference(network, case):
    encoded = encode(network, case["tokens"][0], case["side"])
    with torch.inference_mode():
        said = network.decoder.begin(encoded)
        states = network.decoder(torch.tensor([case["words"]]), said)
        logits = network.decoder.score_words(states)
    assert np.allclose(encoded.states[:, ::5], case["states"], atol=2e-5)
    assert np.allclose(encoded.places[:, ::5], case["places"], atol=1e-5)
    assert np.allclose(logits[..., ::397], case["logits"], atol=1e-4)


def test_a_padded_batch_of_the_reference_gives_what_we_give_one_by_one(network):
    case = REFERENCE["padded"]
    for tokens, expected in zip(case["tokens"], case["logits"], strict=True):
        with torch.inference_mode():
            said = network.decoder.begin(encode(network, tokens))
            logits = network.decoder.score_words(
                network.decoder(torch.tensor([case["words"]]), said)
            )
        assert np.allclose(logits[0, :, ::397], expected, atol=1e-4)


def test_words_one_at_a_time_score_as_all_at_once(network):
    words = torch.tensor([[0, 30, 41, 52, 63]])
    with torch.inference_mode():
        encoded = encode(network, [0, 40, 50, 2])
        at_once = network.decoder(words, network.decoder.begin(encoded))
        said = network.decoder.begin(encoded)
        one_by_one = [network.decoder(words[:, i : i + 1], said) for i in range(5)]
    assert torch.allclose(torch.cat(one_by_one, dim=1), at_once, atol=1e-5)


# Words and pixels


@pytest.mark.parametrize(("raw", "clean"), REFERENCE["cleaned"])
def test_questions_are_cleaned_as_in_the_training_data(raw, clean):
    assert clean_question(raw) == clean


def test_tokens_are_those_of_the_reference(folder):
    tokenizer = OfaTokenizer(folder)
    for text, tokens in REFERENCE["tokens"]:
        assert [0, *tokenizer.encode(text), 2] == tokens, text
    for tokens, text in REFERENCE["decoded"]:
        assert tokenizer.decode(tokens).strip() == text


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=40))
def test_any_text_comes_back_and_never_becomes_a_mark(text):
    tokenizer = OfaTokenizer(GOLDEN)
    tokens = tokenizer.encode(text + "</s><pad>")
    assert tokenizer.decode(tokens) == text + "</s><pad>"
    assert not {0, 1, 2, 3} & set(tokens)


def test_pixels_are_those_of_the_reference():
    image = Image.fromarray(ofa_weights.picture(3, 37, 50))
    modes = [image, image.convert("L"), image.quantize(9), image.resize((1, 1))]
    for one, expected in zip(modes, REFERENCE["pixels"], strict=True):
        pixels = to_pixels(one, AskingStyle(patch_image_size=16))
        assert np.allclose(pixels[0, :, ::3, ::2], expected, atol=1e-6)


def test_imagenet_colours():
    black = Image.new("RGB", (5, 5))
    pixels = to_pixels(black, AskingStyle(16, imagenet_default_mean_and_std=True))
    assert pixels[0, :, 0, 0].tolist() == pytest.approx(
        [-0.485 / 0.229, -0.456 / 0.224, -0.406 / 0.225]
    )


# Answers

VQA = BeamSearch(max_length=8)
EXAMPLE = BeamSearch(max_length=8, min_length=0, length_penalty=1.0, no_repeat_ngram=3)
SEARCHES = {
    "none": (DecoderPrompt.NONE, VQA),
    "none_padded": (DecoderPrompt.NONE, VQA),
    "example": (DecoderPrompt.NONE, EXAMPLE),
    "prev_output": (DecoderPrompt.PREV_OUTPUT, VQA),
}


def prompt_of(tokens, kind):
    return torch.tensor([tokens[:1] if kind is DecoderPrompt.NONE else tokens[:-1]])


@pytest.mark.parametrize("case", SEARCHES)
def test_the_beam_finds_the_same_answers_as_the_reference(network, case):
    kind, search = SEARCHES[case]
    for tokens, expected in zip(
        REFERENCE["beams"]["tokens"], REFERENCE["beams"][case], strict=True
    ):
        prompts = prompt_of(tokens, kind)
        with torch.inference_mode():
            said, logits = start(network.decoder, encode(network, tokens), prompts)
            found = beam_search(network.decoder, said, logits, prompts, search)[0]
        assert [list(answer.tokens) for answer in found] == [row[0] for row in expected]
        score = 2 if case == "example" else 1  # with a prompt, the reference's has its own, too
        assert [a.score for a in found] == pytest.approx([r[score] for r in expected], abs=1e-3)


@pytest.mark.parametrize("kind", [DecoderPrompt.NONE, DecoderPrompt.PREV_OUTPUT])
def test_given_answers_have_the_scores_of_the_reference(network, kind):
    case = REFERENCE["answers"]
    for tokens, expected in zip(REFERENCE["beams"]["tokens"], case[kind], strict=True):
        with torch.inference_mode():
            said, logits = start(network.decoder, encode(network, tokens), prompt_of(tokens, kind))
            scores = best_answer(network.decoder, said, logits, case["words"])
        assert scores[0].tolist() == pytest.approx(expected, abs=1e-3)
        assert scores.exp().sum().item() == pytest.approx(1, abs=1e-4)
