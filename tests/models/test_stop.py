"""A stop ends a local model after the forward pass in flight, in the middle of a generation."""

from concurrent.futures import ThreadPoolExecutor
from functools import wraps

import pytest
from model_zoo import zoo
from pictures import draw
from transformers.models.blip.modeling_blip_text import BlipTextLMHeadModel
from transformers.models.idefics3.modeling_idefics3 import Idefics3ForConditionalGeneration
from transformers.models.vilt.modeling_vilt import ViltPooler

from vqa_state.answers.answer import Answer
from vqa_state.models import Interruptible
from vqa_state.models.local.ofa.network import Decoder

IMAGES = [draw(0, (60, 40)), draw(1, (60, 40))]
QUESTIONS = [f"is the door number {number} open?" for number in range(5)]

#: The class whose every call is one step of an answer.
STEPS = {
    "blip": BlipTextLMHeadModel,
    "vilt": ViltPooler,
    "ofa": Decoder,
    "idefics3": Idefics3ForConditionalGeneration,
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    kinds = zoo(tmp_path_factory.mktemp("zoo"))
    return {family: kinds[family].make() for family in STEPS}


@pytest.fixture(scope="module")
def wholes(made):
    return {family: outcomes(model.answer(IMAGES, QUESTIONS)) for family, model in made.items()}


@pytest.fixture(params=STEPS)
def family(request):
    return request.param


@pytest.fixture
def steps(family, monkeypatch):
    """Notes every step; `after` of them the user stops, while the last one is in flight."""

    class Steps:
        n, after = 0, None

        def stop(self):
            return self.after is not None and self.n >= self.after

    counting, forward = Steps(), STEPS[family].forward

    @wraps(forward)  # generation reads its signature
    def counted(self, *args, **more):
        counting.n += 1
        return forward(self, *args, **more)

    monkeypatch.setattr(STEPS[family], "forward", counted)
    return counting


def outcomes(replies):
    found = {(reply.image, reply.question): reply.outcome for reply in replies}
    assert all(isinstance(outcome, Answer) for outcome in found.values())
    return found


@pytest.mark.parametrize("after", [1, 3, 7])
def test_no_step_begins_after_the_stop(made, wholes, family, steps, after):
    steps.after = after
    replies = outcomes(made[family].answer_until(IMAGES, QUESTIONS, steps.stop))
    assert steps.n == after
    assert len(replies) < len(IMAGES) * len(QUESTIONS)
    assert replies == {pair: wholes[family][pair] for pair in replies}


def test_who_never_stops_gets_the_same_answers(made, family, steps):
    model = made[family]
    assert isinstance(model, Interruptible)
    whole = outcomes(model.answer(IMAGES, QUESTIONS))
    n, steps.n = steps.n, 0
    assert outcomes(model.answer_until(IMAGES, QUESTIONS, lambda: False)) == whole
    assert steps.n == n


def test_a_stop_before_the_first_step_asks_nothing(made, family, steps):
    assert not outcomes(made[family].answer_until(IMAGES, QUESTIONS, lambda: True))
    assert steps.n == 0


def test_the_stop_of_one_caller_leaves_the_others_alone(made, wholes, family):
    model, whole = made[family], wholes[family]

    def asked(number):
        polls = iter(range(100_000))
        stop = (lambda: next(polls) >= number) if number else (lambda: False)
        return outcomes(model.answer_until(IMAGES, QUESTIONS, stop))

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(asked, [0, 2, 0, 5]))
    assert found[0] == found[2] == whole
    assert len(found[1]) < len(whole)
