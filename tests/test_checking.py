"""The look at a new model: one that drops the image is found out, and the time is a fair guess."""

import time

import pytest

from vqa_state.answers import Answer
from vqa_state.asking import AskPlan
from vqa_state.checking import PROBES, Pace, Sight, check_model
from vqa_state.models import create
from vqa_state.models.base import Failure
from vqa_state.models.fake import ScriptedModel


def looked_at(script):
    *_, last = check_model(ScriptedModel(script))
    assert last.n_done == last.n_total
    return last.result


def is_grey(image):
    return image.getcolors(4) == [(256 * 256, (128, 128, 128))]


def mean(image):
    return sum(image.convert("L").resize((1, 1)).getpixel((0, 0)) for _ in (0,))


@pytest.mark.parametrize(
    ("script", "sight", "says"),
    [
        (lambda i, q: Answer("yes"), Sight.BLIND, "may drop the image"),
        (lambda i, q: Answer(q), Sight.BLIND, "may drop the image"),
        (lambda i, q: Answer("yes", 0.9), Sight.BLIND, "may drop the image"),
        (lambda i, q: Answer("no" if is_grey(i) else "yes"), Sight.SEES, "said the same about"),
        (lambda i, q: Answer("yes" if mean(i) > 90 else "no"), Sight.TELLS, "tells the states"),
        (lambda i, q: Answer("yes", mean(i) / 255), Sight.TELLS, "tells the states"),
        (lambda i, q: Failure("the server is gone"), Sight.SILENT, "the server is gone"),
    ],
)
def test_what_a_model_sees(script, sight, says):
    found = looked_at(script)
    assert found.sight is sight
    assert says in found.sentence
    assert (found.pace is None) == (sight is Sight.SILENT)


def test_the_embedded_model_tells_states_apart():
    *_, last = check_model(create("embedded"))
    assert last.result.sight is Sight.TELLS
    assert last.result.fingerprint == create("embedded").fingerprint


def test_a_stop_ends_it_after_the_thing_being_shown():
    reports = list(check_model(ScriptedModel(lambda i, q: Answer("yes")), lambda: True))
    assert [(one.n_done, one.result) for one in reports] == [(6, None)]


def test_the_probes_are_two_different_pictures_each():
    for probe in PROBES:
        positive, negative = probe.pictures()
        assert positive.size == negative.size == (256, 256)
        assert positive.tobytes() != negative.tobytes()


def test_the_time_is_a_line_through_images_and_questions():
    plan = AskPlan(n_images=10, n_copies=2, n_questions=5, n_stored=50)
    assert Pace(1.0, 0.1).seconds(plan) == pytest.approx(10 * (1.0 + 0.5))
    assert Pace(1.0, 0.1).seconds(AskPlan(1, 1, 4, 4)) == 0


def test_the_pace_of_a_slow_question_is_seen():
    def slow(image, question):
        if "number" in question:
            time.sleep(0.01)
        return Answer("yes")

    assert looked_at(slow).pace.question >= 0.009
