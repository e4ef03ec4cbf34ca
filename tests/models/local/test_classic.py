"""Asking a network: blocks of one shape, failures that stay alone; loading of damaged folders."""

import shutil
from threading import Barrier, Thread

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from pictures import draw
from PIL import Image
from tiny_models import tiny_folder

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models import Failure
from vqa_state.models.address import Device, Precision
from vqa_state.models.local.blip import BlipModel
from vqa_state.models.local.classic import Said, TorchImageModel
from vqa_state.models.local.runtime import Runtime
from vqa_state.models.local.vilt import ViltModel

CPU = Runtime(Device.CPU, Precision.FLOAT32)
MODELS = {"blip": BlipModel, "vilt": ViltModel}


class Echo:
    """Answers with the image's width and the question's number of letters; notes every pass."""

    n_rows = 4
    max_tokens = 9
    steps = ()

    def __init__(self):
        self.passes = []
        self.looks = []
        self.fails = lambda what: None

    def read(self, question):
        return [ord(letter) for letter in question]

    def see(self, images):
        self.looks.append(len(images))
        self.fails(images)
        assert {image.mode for image in images} == {"RGB"}
        return [image.width for image in images]

    def say(self, seen, tokens):
        self.passes.append(tuple(tokens.shape))
        self.fails(tokens)
        return [Said((seen, *row), torch.tensor([0.0, 1.0])) for row in tokens.tolist()]

    def answer(self, said):
        return Answer(f"{said.tokens[0]}: {''.join(map(chr, said.tokens[1:]))}")


def asked(model, images, questions):
    """{(image, question): outcome}, after a look that none came twice."""
    replies = list(model.answer(images, questions))
    found = {(reply.image, reply.question): reply.outcome for reply in replies}
    assert len(found) == len(replies) == len(images) * len(questions)
    return found


def echo(network=None):
    return TorchImageModel(network or Echo(), "echo", CPU, "echo 1")


@settings(max_examples=40)
@given(st.lists(st.text("abc", max_size=9), max_size=30), st.integers(0, 3))
def test_every_pair_gets_its_own_answer_from_passes_of_one_shape(questions, n_images):
    network = Echo()
    images = [Image.new("L", (width, 2)) for width in range(1, n_images + 1)]
    for (image, question), outcome in asked(echo(network), images, questions).items():
        assert outcome == Answer(f"{image + 1}: {questions[question]}")
    assert {rows for rows, _ in network.passes} <= {4}
    assert network.looks == [1] * (n_images if questions else 0)


def test_a_question_that_is_too_long_fails_alone_and_says_why():
    found = asked(echo(), [draw(0), draw(1)], ["short", "far too long", "brief"])
    assert isinstance(found[0, 1], Failure)
    assert "12 tokens" in found[1, 1].reason
    assert "at most 9" in found[1, 1].reason
    assert isinstance(found[1, 2], Answer)


def test_an_image_is_not_looked_at_for_nothing():
    network = Echo()
    assert len(asked(echo(network), [draw(0)], ["far too long"])) == 1
    assert network.looks == []


def test_a_reply_comes_before_the_next_pass():
    network = Echo()
    replies = echo(network).answer([draw(0)], ["a", "bb", "ccc"])
    next(replies)
    assert len(network.passes) == 1


@pytest.mark.parametrize("error", [torch.OutOfMemoryError("no room"), RuntimeError("broken\nx")])
def test_a_pass_that_fails_costs_the_rest_of_its_image_only(error):
    network = Echo()

    def fails(what):
        if isinstance(what, torch.Tensor) and len(network.passes) == 2:
            raise error

    network.fails = fails
    found = asked(echo(network), [draw(0), draw(1)], ["a", "bb", "ccc"])
    failed = {pair for pair, outcome in found.items() if isinstance(outcome, Failure)}
    assert failed == {(0, 1), (0, 2)}
    reason = found[0, 1].reason
    assert "memory" in reason if isinstance(error, torch.OutOfMemoryError) else "broken" in reason


def test_an_image_that_fails_alone_fails_alone_among_others_too():
    network = Echo()

    def fails(what):
        if isinstance(what, list) and any(image.width == 7 for image in what):
            raise RuntimeError("a bad image")

    network.fails = fails
    model = echo(network)
    model._batch.size = 4
    images = [Image.new("RGB", (width, 5)) for width in (5, 6, 7, 8, 9)]
    found = asked(model, images, ["a"])
    assert [isinstance(found[i, 0], Failure) for i in range(5)] == [
        False,
        False,
        True,
        False,
        False,
    ]
    assert found[4, 0] == Answer("9: a")


def test_too_many_images_for_the_memory_go_in_smaller_batches():
    network = Echo()

    def fails(what):
        if isinstance(what, list) and len(what) > 1:
            raise torch.OutOfMemoryError("no room")

    network.fails = fails
    model = echo(network)
    model._batch.size = 4
    found = asked(model, [draw(number) for number in range(3)], ["a"])
    assert all(isinstance(outcome, Answer) for outcome in found.values())
    assert network.looks == [3, 2, 1, 1, 1]


def test_numbers_that_overflow_are_a_failure():
    class Broken(Echo):
        def say(self, seen, tokens):
            return [Said((0,), torch.tensor([0.0, float("nan")]))] * len(tokens)

    outcome = asked(echo(Broken()), [draw(0)], ["a"])[0, 0]
    assert isinstance(outcome, Failure)
    assert "float32" in outcome.reason


@pytest.mark.parametrize("family", MODELS)
class TestEveryFamily:
    def test_threads_get_what_one_gets(self, family):
        model = MODELS[family](tiny_folder(family), "m", CPU)
        images, questions = [draw(0), draw(1)], ["is this door open?", "is it on", "water?"]
        alone, found, start = asked(model, images, questions), [], Barrier(4)

        def work():
            start.wait()
            found.append(asked(model, images, questions))

        threads = [Thread(target=work) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert found == [alone] * 4

    def test_images_of_every_kind_and_size(self, family):
        model = MODELS[family](tiny_folder(family), "m", CPU)
        images = [Image.new("RGB", size, "red") for size in ((1, 1), (3, 1), (1, 3), (3, 3))]
        images += [Image.new("RGB", size, "red") for size in ((8000, 1), (1, 8000), (8000, 8000))]
        images += [draw(0).convert("L"), draw(0).convert("P"), draw(0).convert("RGBA")]
        found = asked(model, images, ["is the door open?"])
        assert all(isinstance(outcome, Answer) for outcome in found.values())

    def test_a_prompt_goes_around_the_question(self, family):
        asks = "tell me , {question} yes or no"
        bare = MODELS[family](tiny_folder(family), "m", CPU)
        prompted = MODELS[family](tiny_folder(family), "m", CPU, asks)
        questions = ["is this door open?", "is it on"]
        whole = [asks.replace("{question}", question) for question in questions]
        assert asked(prompted, [draw(3)], questions) == asked(bare, [draw(3)], whole)

    def test_half_precision_gives_answers(self, family):
        model = MODELS[family](tiny_folder(family), "m", Runtime(Device.CPU, Precision.BFLOAT16))
        assert isinstance(asked(model, [draw(0)], ["is it on"])[0, 0], Answer)
        assert model.notes == ("It runs on the processor in bfloat16.",)

    def test_the_global_random_state_stays_as_it_is(self, family):
        model = MODELS[family](tiny_folder(family), "m", CPU)
        before = torch.get_rng_state()
        asked(model, [draw(0)], ["is it on"])
        assert torch.equal(torch.get_rng_state(), before)
        assert torch.is_grad_enabled()

    def test_the_fingerprint_names_all_that_changes_an_answer(self, family, tmp_path):
        kind, folder = MODELS[family], tiny_folder(family)
        moved = shutil.copytree(folder, tmp_path / "moved")
        assert kind(moved, "other name", CPU).fingerprint == kind(folder, "m", CPU).fingerprint
        resized = shutil.copytree(folder, tmp_path / "resized")
        settings = resized / "processor_config.json"
        text = settings.read_text()
        assert '"resample": 3' in text
        settings.write_text(text.replace('"resample": 3', '"resample": 2'))
        different = {
            kind(folder, "m", CPU).fingerprint,
            kind(folder, "m", Runtime(Device.CPU, Precision.BFLOAT16)).fingerprint,
            kind(folder, "m", CPU, "so: {question}").fingerprint,
            kind(tiny_folder(family, seed=1), "m", CPU).fingerprint,
            kind(resized, "m", CPU).fingerprint,
        }
        assert len(different) == 5
        assert not any(str(folder) in fingerprint for fingerprint in different)

    @pytest.mark.parametrize(
        "file", ["config.json", "model.safetensors", "processor_config.json", "tokenizer.json"]
    )
    @pytest.mark.parametrize("how", ["missing", "cut", "empty"])
    def test_a_damaged_folder_says_what_to_do(self, family, file, how, tmp_path):
        folder = shutil.copytree(tiny_folder(family), tmp_path / "damaged")
        data = (folder / file).read_bytes()
        (folder / file).unlink()
        if how != "missing":
            (folder / file).write_bytes(data[: len(data) // 2] if how == "cut" else b"")
        with pytest.raises(ModelError, match="copy"):
            MODELS[family](folder, "m", CPU)

    def test_weights_that_are_not_there_are_not_made_up(self, family, tmp_path):
        from safetensors.torch import load_file, save_file

        folder = shutil.copytree(tiny_folder(family), tmp_path / "lacking")
        weights = load_file(folder / "model.safetensors")
        lost = sorted(name for name in weights if "query.weight" in name)[0]
        del weights[lost]
        save_file(weights, folder / "model.safetensors", {"format": "pt"})
        with pytest.raises(ModelError, match=f"lacks 1 weights, for example {lost}"):
            MODELS[family](folder, "m", CPU)
