"""One suite over all models: what `VQAModel` promises holds for every family."""

import tempfile
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from model_zoo import zoo
from PIL import Image

from vqa_state.answers.parse import Answer
from vqa_state.models import Failure

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

QUESTIONS = ("Is this door open?", "Does this image look like the door is closed?", "Is it on?")
FAMILIES = (
    "embedded", "fake", "blip", "vilt", "ofa", "server", "idefics3", "gemma3", "llava",
    "paligemma", "smolvlm", "qwen2_5_vl", "qwen3_vl", "internvl",
)  # fmt: skip


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    return zoo(tmp_path_factory.mktemp("zoo"))


@pytest.fixture(scope="module", params=FAMILIES)
def kind(kinds, request):
    found = kinds[request.param]
    if found.lacks:
        pytest.skip(f"{found.name} is not run: it needs pip install {' '.join(found.lacks)}")
    return found


@pytest.fixture(scope="module")
def model(kind):
    with warnings.catch_warnings():  # a mark does not reach a fixture of the module
        warnings.filterwarnings("ignore", "__array__ implementation", DeprecationWarning)
        return kind.make()


def noise(seed, size=(48, 36), mode="RGB"):
    pixels = np.random.default_rng(seed).integers(0, 256, (size[1], size[0], 3), np.uint8)
    return Image.fromarray(pixels).convert(mode)


def outcomes(model, images, questions):
    """By (image, question); a pair that comes twice is an error."""
    found = {}
    for reply in model.answer(images, questions):
        assert (reply.image, reply.question) not in found
        found[reply.image, reply.question] = reply.outcome
    return found


def texts(found):
    return {pair: one.text for pair, one in found.items()}


def test_the_suite_knows_every_kind(kinds):
    assert set(FAMILIES) == set(kinds)


def test_every_pair_is_replied_to_exactly_once(model):
    found = outcomes(model, [noise(1), noise(2)], QUESTIONS)
    assert set(found) == {(i, q) for i in range(2) for q in range(len(QUESTIONS))}
    assert all(isinstance(one, Answer) for one in found.values())
    assert all(one.p_yes is None or 0 <= one.p_yes <= 1 for one in found.values())


def test_empty_lists_yield_nothing(model):
    assert not outcomes(model, [], QUESTIONS)
    assert not outcomes(model, [noise(1)], [])
    assert not outcomes(model, [], [])


def test_one_question(model):
    assert set(outcomes(model, [noise(1)], QUESTIONS[:1])) == {(0, 0)}


def test_three_hundred_questions(model):
    many = [f"Is the door number {number} open?" for number in range(300)]
    assert len(outcomes(model, [noise(1)], many)) == 300


@pytest.mark.parametrize("mode", ["L", "P", "1", "RGBA"])
def test_grey_and_palette_images_are_answered(model, mode):
    found = outcomes(model, [noise(1, mode=mode)], QUESTIONS[:1])
    assert isinstance(found[0, 0], Answer)


@pytest.mark.parametrize("size", [(1, 1), (8000, 12)])
def test_strange_sizes_are_answered_or_fail_with_a_sentence(model, size):
    found = outcomes(model, [noise(1, size), noise(2)], QUESTIONS[:1])
    assert isinstance(found[1, 0], Answer)  # one strange image never ends the work
    strange = found[0, 0]
    assert isinstance(strange, Answer) or (isinstance(strange, Failure) and strange.reason)


def test_a_large_image_is_answered(model):
    assert isinstance(outcomes(model, [noise(3, (8000, 6000))], QUESTIONS[:1])[0, 0], Answer)


def test_threads_may_share_a_model(model):
    images = [noise(seed) for seed in range(4)]
    alone = [texts(outcomes(model, [image], QUESTIONS)) for image in images]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda i: texts(outcomes(model, [i], QUESTIONS)), images))
    assert alone == together


def test_an_answer_may_be_left_alone_in_the_middle(model):
    replies = model.answer([noise(1), noise(2)], QUESTIONS)
    next(replies)
    replies.close()
    assert len(outcomes(model, [noise(1)], QUESTIONS)) == len(QUESTIONS)


def test_the_same_input_gets_the_same_answer_alone_and_in_a_batch(kind, model):
    if not kind.is_local:
        pytest.skip("a server promises nothing of the kind")
    images = [noise(seed) for seed in range(3)]
    many = [*QUESTIONS, *(f"Is the door number {number} open?" for number in range(20))]
    batch = outcomes(model, images, many)
    assert batch == outcomes(model, images, many)
    for i, image in enumerate(images):
        for q in (0, 1, 7, 22):
            (single,) = outcomes(model, [image], [many[q]]).values()
            assert single.text == batch[i, q].text
            if single.p_yes is not None:
                assert single.p_yes == pytest.approx(batch[i, q].p_yes, abs=1e-4)


def test_a_model_says_who_it_is(model):
    assert model.name
    assert model.fingerprint
    assert tempfile.gettempdir() not in model.fingerprint
    assert all(isinstance(note, str) and note for note in model.notes)
