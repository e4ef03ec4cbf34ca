"""ViLT, beside one forward a question in plain transformers."""

import json
import shutil

import pytest
import torch
from pictures import draw
from tiny_models import tiny_folder

from vqa_state.answers.answer import Answer
from vqa_state.embedded_training.experiments import questions_about
from vqa_state.models import Failure
from vqa_state.models.address import Device, Precision
from vqa_state.models.local.runtime import Runtime
from vqa_state.models.local.vilt import ViltModel

CPU = Runtime(Device.CPU, Precision.FLOAT32)
QUESTIONS = [question.text for question in questions_about("cabinet")]


@pytest.fixture(scope="module")
def model():
    return ViltModel(tiny_folder("vilt"), "folder:tiny", CPU)


@pytest.fixture(scope="module")
def naive():
    """(image, question) → logits and label."""
    from transformers import AutoProcessor, ViltForQuestionAnswering

    folder = tiny_folder("vilt")
    processor = AutoProcessor.from_pretrained(folder, backend="pil")
    network = ViltForQuestionAnswering.from_pretrained(folder)

    @torch.inference_mode()
    def ask(image, question):
        logits = network(**processor(images=image, text=question, return_tensors="pt")).logits[0]
        return logits, network.config.id2label[logits.argmax().item()]

    return ask


def test_answers_are_those_of_one_forward_a_question(model, naive):
    images = [draw(0, (48, 48)), draw(1, (20, 90)), draw(2, (200, 60)), draw(5, (300, 299))]
    said = {(i, q): one for i, q, one in model.generations(images, QUESTIONS)}
    replies = {(one.image, one.question): one.outcome for one in model.answer(images, QUESTIONS)}
    seen = set()
    for i, image in enumerate(images):
        for q, question in enumerate(QUESTIONS):
            logits, label = naive(image, question)
            assert (said[i, q].logits - logits).abs().max() < 1e-4
            p_yes = torch.softmax(logits[:2].double(), 0)[0].item()  # the labels yes and no
            assert replies[i, q].text == label
            assert replies[i, q].p_yes == pytest.approx(p_yes, abs=2e-6)
            seen.add(label)
    assert len(seen) >= 4  # one answer to everything would prove nothing


def test_an_answer_has_the_same_digits_whatever_is_asked_beside(model):
    image = draw(2, (60, 40))
    together = {q: one for _, q, one in model.generations([image], QUESTIONS)}
    for q, question in enumerate(QUESTIONS):
        ((_, _, alone),) = model.generations([image], [question])
        assert torch.equal(together[q].logits, alone.logits)


def test_rows_that_go_through_together_get_their_own_answers(model):
    image = draw(2, (60, 40))
    alone = {q: one for _, q, one in model.generations([image], QUESTIONS)}
    wide = ViltModel(tiny_folder("vilt"), "folder:tiny", CPU)
    wide._network.n_rows = 32
    for _, q, one in wide.generations([image], QUESTIONS):
        assert (one.logits - alone[q].logits).abs().max() < 1e-4


def test_a_question_longer_than_the_position_table_fails(model):
    said = list(model.answer([draw(0)], ["door " * 38, "door " * 39]))
    outcomes = {reply.question: reply.outcome for reply in said}
    assert isinstance(outcomes[0], Answer)
    assert isinstance(outcomes[1], Failure)


def test_an_image_is_embedded_once_for_300_questions(model, monkeypatch):
    network, calls = model._network._embeddings.patch_embeddings, []
    forward = network.forward
    monkeypatch.setattr(network, "forward", lambda *a, **k: calls.append(1) or forward(*a, **k))
    questions = [f"is door {number} open?" for number in range(300)]
    assert len({reply.question for reply in model.answer([draw(0)], questions)}) == 300
    assert len(calls) == 1


def changed(tmp_path, **settings):
    """A copy of the tiny folder with these settings in its config.json."""
    folder = shutil.copytree(tiny_folder("vilt"), tmp_path / "changed")
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(config | settings))
    return ViltModel(folder, "folder:changed", CPU)


def renamed(tmp_path, old, new):
    labels = tiny_folder("vilt") / "config.json"
    named = json.loads(labels.read_text())["id2label"]
    id2label = {number: new if label == old else label for number, label in named.items()}
    label2id = {label: int(number) for number, label in id2label.items()}
    return changed(tmp_path, id2label=id2label, label2id=label2id)


def p_yes_of(model):
    (reply,) = model.answer([draw(0)], ["is this door open?"])
    return reply.outcome.p_yes


def test_yes_and_no_count_in_any_spelling(model, tmp_path):
    assert p_yes_of(renamed(tmp_path, "yes", "Yes")) == p_yes_of(model) is not None


def test_without_a_label_no_nobody_knows_how_sure_it_is(tmp_path):
    assert p_yes_of(renamed(tmp_path, "no", "never")) is None


def test_where_patches_are_limited_the_same_ones_are_taken_each_time(tmp_path):
    model = changed(tmp_path, max_image_length=7)
    images = [draw(0, (64, 64)), draw(1, (64, 90))]
    assert [seen.shape[1] for seen, _ in model._network.see(images)] == [8, 8]
    first = [said.logits for _, _, said in model.generations(images, QUESTIONS[:3])]
    again = [said.logits for _, _, said in model.generations(images, QUESTIONS[:3])]
    assert all(torch.equal(one, other) for one, other in zip(first, again, strict=True))
