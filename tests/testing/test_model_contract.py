"""Every rule of a model catches a model that breaks it."""

import itertools
import tempfile

import pytest

from vqa_state.answers.answer import Answer
from vqa_state.models import Failure, Reply
from vqa_state.testing import DETERMINISTIC_RULES, RULES, ScriptedModel, check_model


class Broken(ScriptedModel):
    """A model with one fault; it says yes else."""

    def __init__(self, fault, **options):
        super().__init__(lambda image, question: Answer("yes", 0.9), **options)
        self.fault = fault

    def answer(self, images, questions):
        yield from self.fault(images, questions, list(super().answer(images, questions)))


def twice(images, questions, replies):
    yield from replies[:1]
    yield from replies


def first_only(images, questions, replies):
    yield from replies[:1]


def always(images, questions, replies):
    yield from replies or [Reply(0, 0, Answer("yes"))]


def of_others(images, questions, replies):
    yield from replies
    yield Reply(len(images), 0, Answer("yes"))


def at_most_a_hundred(images, questions, replies):
    yield from replies[:100]


def fails_if(condition, reason="no"):
    def fault(images, questions, replies):
        for reply in replies:
            fails = condition(images[reply.image])
            yield Reply(reply.image, reply.question, Failure(reason)) if fails else reply

    return fault


def counting():
    numbers = itertools.count()

    def fault(images, questions, replies):
        yield from (Reply(r.image, r.question, Answer(str(next(numbers)))) for r in replies)

    return fault


@pytest.mark.parametrize(
    ("rule", "fault"),
    [
        ("replies once to every pair", twice),
        ("replies once to every pair", first_only),
        ("replies once to every pair", of_others),
        ("yields nothing for nothing", always),
        ("answers one question", fails_if(lambda image: True)),
        ("answers three hundred questions", at_most_a_hundred),
        ("answers grey and palette images", fails_if(lambda image: image.mode == "P")),
        ("survives strange sizes", fails_if(lambda image: image.width == 1, reason="")),
        ("survives strange sizes", fails_if(lambda image: image.height > 12)),
        ("answers a large image", fails_if(lambda image: image.width == 8000)),
        ("may be shared by threads", counting()),
        ("repeats its answers", counting()),
    ],
)
def test_a_rule_catches_who_breaks_it(rule, fault):
    with pytest.raises(AssertionError):
        (RULES | DETERMINISTIC_RULES)[rule](Broken(fault))


@pytest.mark.parametrize(
    "options",
    [
        {"name": ""},
        {"fingerprint": ""},
        {"fingerprint": f"weights of {tempfile.gettempdir()}/model"},
    ],
    ids=str,
)
def test_a_model_without_a_name_of_its_own_is_caught(options):
    with pytest.raises(AssertionError):
        RULES["names itself"](ScriptedModel(lambda image, question: Answer("yes"), **options))


def test_a_model_that_is_left_in_the_middle_and_then_silent_is_caught():
    calls = []

    def silent(images, questions, replies):
        calls.append(1)
        yield from replies if len(calls) == 1 else []

    with pytest.raises(AssertionError):
        RULES["may be left in the middle"](Broken(silent))


def test_the_check_names_model_and_rule():
    with pytest.raises(AssertionError, match="Broken breaks 'replies once to every pair': it"):
        check_model(Broken(twice))


def test_a_server_need_not_repeat_itself():
    model = Broken(lambda images, questions, replies: replies)
    check_model(model, deterministic=False)
    check_model(model)
