"""What goes wrong inside OFA costs the answers that it concerns, and never the run."""

import json
import shutil

import pytest
import torch
from model_zoo import CPU, ofa_folder
from pictures import draw
from safetensors.torch import load_file, save_file

from vqa_state.answers.answer import Answer
from vqa_state.models import Failure
from vqa_state.models.local.ofa import decoding
from vqa_state.models.local.ofa.model import OfaModel
from vqa_state.models.local.ofa.tokenizer import EOS

IMAGES = [draw(number, (40, 30)) for number in range(3)]
QUESTIONS = ["is the door open?", "is it on?", "is the light on?"]
PAIRS = {(image, question) for image in range(3) for question in range(3)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return ofa_folder(tmp_path_factory.mktemp("ofa"))


@pytest.fixture
def model(folder):
    return OfaModel(folder, "folder:ofa", CPU)


def outcomes(model):
    replies = list(model.answer(IMAGES, QUESTIONS))
    found = {(reply.image, reply.question): reply.outcome for reply in replies}
    assert len(replies) == len(PAIRS)
    assert set(found) == PAIRS
    return found


def failing_at(monkeypatch, target, name, calls, error):
    """The calls of these numbers raise `error`."""
    whole, seen = getattr(target, name), iter(range(1000))

    def sometimes(*args, **more):
        if next(seen) in calls:
            raise error
        return whole(*args, **more)

    monkeypatch.setattr(target, name, sometimes)


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (torch.OutOfMemoryError("CUDA out of memory"), "no memory left"),
        (RuntimeError("a kernel failed"), "a kernel failed"),
    ],
)
def test_an_image_that_cannot_be_seen_fails_alone(model, monkeypatch, error, says):
    whole = outcomes(model)
    failing_at(monkeypatch, model._network.encoder, "see", {1}, error)
    found = outcomes(model)
    for (image, question), outcome in found.items():
        if image == 1:
            assert isinstance(outcome, Failure)
            assert says in outcome.reason
        else:
            assert outcome == whole[image, question]


def test_questions_that_cannot_be_asked_fail_for_this_image_only(model, monkeypatch):
    whole = outcomes(model)
    failing_at(monkeypatch, decoding, "start", {1}, torch.OutOfMemoryError("none left"))
    found = outcomes(model)
    failed = {pair for pair, outcome in found.items() if isinstance(outcome, Failure)}
    answered = PAIRS - failed
    assert failed
    assert {image for image, _ in failed} == {0}
    assert {pair: found[pair] for pair in answered} == {pair: whole[pair] for pair in answered}


@pytest.mark.parametrize("answers", [[], ["yes", "no", "in the middle"]])
@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_weights_that_overflow_give_no_answers(folder, tmp_path, answers, value):
    broken = shutil.copytree(folder, tmp_path / "broken", ignore=shutil.ignore_patterns("*.bin"))
    said = json.loads((broken / "config.json").read_text()) | {"answers": answers}
    (broken / "config.json").write_text(json.dumps(said))
    weights = load_file(broken / "model.safetensors")
    weights["encoder.embed_tokens.weight"][:] = value
    save_file(weights, broken / "model.safetensors", {"format": "pt"})
    for outcome in outcomes(OfaModel(broken, "folder:broken", CPU)).values():
        assert isinstance(outcome, Failure)
        assert "overflow in float32" in outcome.reason


@pytest.mark.parametrize("value", [torch.inf, -torch.inf, torch.nan])
def test_one_question_that_overflows_leaves_its_neighbours_alone(model, monkeypatch, value):
    questions = ["is the door open?", "is the door on?"]  # of one length: they go together
    whole = [reply.outcome for reply in model.answer(IMAGES[:1], questions)]
    assert all(isinstance(outcome, Answer) for outcome in whole)
    begin = decoding.start

    def start(*args):
        said, logits = begin(*args)
        assert len(logits) == 2
        logits[0, 5] = value
        return said, logits

    monkeypatch.setattr(decoding, "start", start)
    first, second = (reply.outcome for reply in model.answer(IMAGES[:1], questions))
    assert isinstance(first, Failure)
    assert second == whole[1]


def test_a_search_that_overflows_on_its_way_gives_no_answer(model, monkeypatch):
    score = model._network.decoder.score_words
    calls = iter(range(1000))

    def later(x, words=None):
        logits = score(x, words)
        if next(calls) > 0:
            return torch.full_like(logits, torch.nan)
        logits[..., EOS] = -100  # else an empty answer would be found before
        return logits

    monkeypatch.setattr(model._network.decoder, "score_words", later)
    (reply,) = model.answer(IMAGES[:1], QUESTIONS[:1])
    assert isinstance(reply.outcome, Failure)
    assert "overflow" in reply.outcome.reason
