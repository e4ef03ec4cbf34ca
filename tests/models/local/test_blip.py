"""BLIP, beside one generate call a question in plain transformers."""

import pytest
import torch
from pictures import draw
from tiny_models import tiny_folder

from vqa_state.answers.answer import Answer
from vqa_state.embedded_training.experiments import questions_about
from vqa_state.models import Failure
from vqa_state.models.address import Device, Precision
from vqa_state.models.local.blip import MAX_ANSWER_TOKENS, BlipModel
from vqa_state.models.local.runtime import Runtime

CPU = Runtime(Device.CPU, Precision.FLOAT32)
QUESTIONS = [question.text for question in questions_about("cabinet")]


@pytest.fixture(scope="module")
def model():
    return BlipModel(tiny_folder("blip"), "folder:tiny", CPU)


@pytest.fixture(scope="module")
def naive():
    """(image, question) → tokens with their end, first-step logits, text."""
    from transformers import AutoProcessor, BlipForQuestionAnswering

    folder = tiny_folder("blip")
    processor = AutoProcessor.from_pretrained(folder, backend="pil")
    network = BlipForQuestionAnswering.from_pretrained(folder)

    def ask(image, question):
        inputs = processor(images=image, text=question, return_tensors="pt")
        found = network.generate(
            **inputs,
            max_new_tokens=MAX_ANSWER_TOKENS,
            do_sample=False,
            output_logits=True,
            return_dict_in_generate=True,
        )
        text = processor.decode(found.sequences[0], skip_special_tokens=True)
        return found.sequences[0, 1:].tolist(), found.logits[0][0], text

    ask.tokenizer = processor.tokenizer
    return ask


def test_answers_are_those_of_one_generate_call_a_question(model, naive):
    images, seen = [draw(0, (48, 48)), draw(1, (20, 90))], set()
    said = {(i, q): one for i, q, one in model.generations(images, QUESTIONS)}
    replies = {(one.image, one.question): one.outcome for one in model.answer(images, QUESTIONS)}
    yes, no = naive.tokenizer.convert_tokens_to_ids(["yes", "no"])
    for i, image in enumerate(images):
        for q, question in enumerate(QUESTIONS):
            tokens, logits, text = naive(image, question)
            expected = tokens[: tokens.index(102)] if 102 in tokens else tokens
            assert list(said[i, q].tokens) == expected
            assert (said[i, q].logits - logits).abs().max() < 1e-4
            p_yes = torch.softmax(logits[[yes, no]].double(), 0)[0].item()
            assert replies[i, q].text == text
            assert replies[i, q].p_yes == pytest.approx(p_yes, abs=2e-5)
            seen.add((i, text))
    assert len(seen) >= 16  # one answer to everything would prove nothing
    assert any(said[0, q].tokens != said[1, q].tokens for q in range(len(QUESTIONS)))


def test_an_answer_has_the_same_digits_whatever_is_asked_beside(model):
    image = draw(2, (60, 40))
    together = {q: one for _, q, one in model.generations([image], QUESTIONS)}
    backwards = {63 - q: one for _, q, one in model.generations([image], QUESTIONS[::-1])}
    for q, question in list(enumerate(QUESTIONS))[::5]:
        ((_, _, alone),) = model.generations([image], [question])
        assert together[q].tokens == backwards[q].tokens == alone.tokens
        assert torch.equal(together[q].logits, alone.logits)
        assert torch.equal(backwards[q].logits, alone.logits)


def test_several_images_seen_together_get_their_own_answers():
    model = BlipModel(tiny_folder("blip"), "folder:tiny", CPU)
    images = [draw(number, (40, 40)) for number in range(5)]
    one_by_one = {(i, q): said for i, q, said in model.generations(images, QUESTIONS[:9])}
    model._batch.size = 3
    for i, q, said in model.generations(images, QUESTIONS[:9]):
        assert said.tokens == one_by_one[i, q].tokens
        assert (said.logits - one_by_one[i, q].logits).abs().max() < 1e-4


def test_a_question_longer_than_the_position_table_fails(model):
    said = list(model.answer([draw(0)], ["door " * 510, "door " * 511]))
    outcomes = {reply.question: reply.outcome for reply in said}
    assert isinstance(outcomes[0], Answer)
    assert isinstance(outcomes[1], Failure)


def test_an_image_is_encoded_once_for_300_questions(model, monkeypatch):
    network, calls = model._network._parts.model.vision_model, []
    forward = network.forward
    monkeypatch.setattr(network, "forward", lambda *a, **k: calls.append(1) or forward(*a, **k))
    questions = [f"is door {number} open?" for number in range(300)]
    assert len({reply.question for reply in model.answer([draw(0)], questions)}) == 300
    assert len(calls) == 1
