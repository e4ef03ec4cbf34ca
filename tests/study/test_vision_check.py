"""The look at a new model: one that drops the image is found out, and the time is a fair guess."""

import random
import time

import pytest

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models import Failure, Reply, create
from vqa_state.models.vision_check import N_CALLS, PROBES, Sight
from vqa_state.study.collect import AskPlan
from vqa_state.study.vision_check import Pace, check_model, first_look
from vqa_state.testing.fake_model import ScriptedModel


@pytest.fixture(autouse=True)
def _own_home(data_home):
    """Nothing is known of any model."""


def looked_at(script):
    *_, last = check_model(ScriptedModel(script))
    assert last.n_done == last.n_total
    return last.result


def is_grey(image):
    return image.getcolors(4) == [(256 * 256, (128, 128, 128))]


def mean(image):
    return image.convert("L").resize((1, 1)).getpixel((0, 0))


def truth(image, question):
    """Right about every probe."""
    known = {p.tobytes(): n for probe in PROBES for n, p in enumerate(probe.pictures())}
    is_positive = known.get(image.tobytes(), 0) in (0, 3)
    return Answer("yes" if is_positive ^ question.startswith("Does") else "no")


@pytest.mark.parametrize(
    ("script", "sight", "says"),
    [
        (lambda i, q: Answer("yes"), Sight.BLIND, "may drop the image"),
        (lambda i, q: Answer(q), Sight.BLIND, "may drop the image"),
        (lambda i, q: Answer("yes", 0.9), Sight.BLIND, "may drop the image"),
        (lambda i, q: Answer("no" if is_grey(i) else "yes"), Sight.SEES, "said the same about"),
        (lambda i, q: Answer("grey" if is_grey(i) else "?"), Sight.SEES, "said the same about"),
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
    assert found.warns == (sight is not Sight.TELLS)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("middle", [0.5, 0.7, 0.999])
def test_noise_in_p_yes_is_no_sight(seed, middle):
    rng = random.Random(seed)

    def blind(image, question):
        p_yes = min(1.0, middle + rng.uniform(-0.004, 0.004))
        return Answer("yes" if p_yes > 0.5 else "no", p_yes)

    assert looked_at(blind).sight is Sight.BLIND


def test_a_number_in_every_answer_is_no_sight():
    number = iter(range(10**6))
    assert looked_at(lambda i, q: Answer(f"Yes. [{next(number)}]")).sight is Sight.BLIND
    assert looked_at(lambda i, q: Answer(f"request {next(number)}")).sight is Sight.BLIND


def test_a_missing_p_yes_is_no_sight():
    number = iter(range(10**6))
    answers = Answer("yes", 0.7), Answer("yes")
    assert looked_at(lambda i, q: answers[next(number) % 3 == 0]).sight is Sight.BLIND


def test_readings_that_vary_by_themselves_are_no_sight():
    seen = []

    def blind(image, question):  # another answer to each picture, also to the one shown twice
        seen.append(question)
        return Answer("yes" if seen.count(question) in (1, 3) else "no")

    assert looked_at(blind).sight is Sight.BLIND


def test_another_wording_of_the_same_answer_is_no_sight():
    assert looked_at(lambda i, q: Answer(f"Yes, {mean(i)}.")).sight is Sight.BLIND


def test_a_p_yes_that_hardly_moves_is_no_sight():
    assert looked_at(lambda i, q: Answer("yes", 0.7 + mean(i) / 255 / 110)).sight is Sight.BLIND


def test_failures_are_told_and_never_timed():
    number = iter(range(10**6))

    def mostly_down(image, question):
        n = next(number)
        return Failure("status 500") if n >= 8 else truth(image, question)

    found = looked_at(mostly_down)
    assert found.sight is Sight.TELLS
    assert found.pace is None
    assert f"{found.n_failed} of {found.n_calls} calls failed: status 500" in found.sentence
    assert found.n_failed == found.n_calls - 8 > 0
    assert found.warns


def test_one_answer_is_too_little_to_tell():
    number = iter(range(10**6))
    found = looked_at(lambda i, q: Failure("status 500") if next(number) else Answer("yes"))
    assert found.sight is Sight.SILENT
    assert "too few answers" in found.sentence


def test_a_model_that_answers_nothing_is_asked_about_one_thing_only():
    model = ScriptedModel(lambda i, q: Failure("gone"))
    *_, last = check_model(model)
    assert (last.result.n_calls, len(model.asked)) == (8, 8)


class Broken:
    """Gives one reply and breaks."""

    name, fingerprint, notes = "broken", "broken/1", ()

    def answer(self, images, questions):
        yield Reply(0, 0, Answer("yes"))
        raise ModelError("out of memory")


def test_a_model_that_breaks_is_told():
    *_, last = check_model(Broken())
    assert last.result.sight is Sight.SILENT
    assert "out of memory" in last.result.sentence


def test_the_embedded_model_tells_states_apart():
    *_, last = check_model(create("embedded"))
    assert last.result.sight is Sight.TELLS
    assert last.result.fingerprint == create("embedded").fingerprint
    assert last.result.memory.process > 0


# ---- before a run --------------------------------------------------------------------------


def test_a_model_is_looked_at_once_and_remembered():
    model = ScriptedModel(lambda i, q: Answer("yes"))
    for n_asked in (N_CALLS, N_CALLS):
        *_, last = first_look(model)
        assert last.result.sight is Sight.BLIND
        assert last.result.warns
        assert len(model.asked) == n_asked
    other = ScriptedModel(truth, fingerprint="scripted/2")
    *_, last = first_look(other)
    assert last.result.sight is Sight.TELLS


def test_a_look_ends_at_the_first_thing_that_is_clear():
    model = ScriptedModel(truth)
    *_, last = first_look(model)
    assert last.result.sight is Sight.TELLS
    assert len(model.asked) == 8


def test_what_failed_is_looked_at_again():
    number = iter(range(10**6))
    down = ScriptedModel(lambda i, q: Failure("busy") if next(number) < 12 else Answer("yes"))
    *_, last = first_look(down)
    assert last.result.sight is Sight.SILENT
    *_, last = first_look(down)
    assert last.result.n_failed == 4
    *_, last = first_look(down)
    assert (last.result.sight, last.result.n_failed) == (Sight.BLIND, 0)
    n_asked = len(down.asked)
    *_, last = first_look(down)
    assert len(down.asked) == n_asked


# ---- a stop --------------------------------------------------------------------------------


class Hanging:
    """Hangs in every call, and gives up when it is told to."""

    name, fingerprint, notes = "hanging", "hanging/1", ()

    def answer(self, images, questions):
        raise AssertionError("it cannot be stopped so")

    def answer_until(self, images, questions, stop):
        until = time.monotonic() + 20
        while not stop() and time.monotonic() < until:
            time.sleep(0.01)
        yield from ()


@pytest.mark.parametrize("look", [check_model, first_look])
def test_a_stop_ends_a_call_that_hangs(look):
    began = time.monotonic()
    reports = list(look(Hanging(), lambda: time.monotonic() - began > 0.2))
    assert time.monotonic() - began < 1
    assert all(one.result is None for one in reports)


@pytest.mark.parametrize("look", [check_model, first_look])
def test_a_stop_ends_any_other_model_after_the_reply_at_hand(look):
    model = ScriptedModel(lambda i, q: Answer("yes"))
    reports = list(look(model, lambda: len(model.asked) > 2))
    assert [(one.n_done, one.result) for one in reports] == [(1, None), (2, None), (3, None)]
    assert len(model.asked) == 3


def test_a_stop_while_it_is_timed_finds_nothing():
    model = ScriptedModel(lambda i, q: Answer("yes"))
    reports = list(check_model(model, lambda: len(model.asked) > N_CALLS + 1))
    assert all(one.result is None for one in reports)
    assert len(model.asked) == N_CALLS + 2


# ---- pictures and times --------------------------------------------------------------------


def test_the_probes_are_two_different_pictures_and_one_twice():
    for probe in PROBES:
        positive, negative, blank, again = probe.pictures()
        assert positive.size == negative.size == blank.size == again.size == (256, 256)
        assert len({one.tobytes() for one in (positive, negative, blank, again)}) == 4
        changed = [a != b for a, b in zip(positive.tobytes(), again.tobytes(), strict=True)]
        assert sum(changed) == 1


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
