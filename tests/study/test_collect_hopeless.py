"""A model that says that no call will work ends the run, unless it was one image alone."""

from dataclasses import dataclass, field

import pytest

from vqa_state.answers.answer import Answer
from vqa_state.models import Failure, Reply
from vqa_state.study.collect import ask, plan

N_IMAGES, N_PAIRS = 6, 32


@dataclass
class Model:
    """Gives up on the images that it is called with at some times."""

    hopeless: object
    name: str = "written"
    fingerprint: str = "written/1"
    seen: list = field(default_factory=list)

    def answer(self, images, questions):
        self.seen.append(images[0].tobytes())
        gives_up = self.hopeless(len(self.seen) - 1, images[0].tobytes())
        for i in range(len(images)):
            for q in range(len(questions)):
                gone = gives_up and (i, q) != (0, 0)
                yield Reply(i, q, Failure("gone", for_all=True) if gone else Answer("yes"))


def finish(project, model):
    for last in ask(project, model):
        assert last.n_stored + last.n_asked + last.n_failed + last.n_left == last.n_calls
    assert last.n_left == 0
    assert not last.stopped
    return last


def test_two_images_one_after_another_end_the_run_and_lose_nothing(project):
    model = Model(lambda number, image: True)
    last = finish(project, model)
    assert len(model.seen) == 2
    assert (last.n_asked, last.n_failed) == (2, last.n_calls - 2)
    assert last.last_failure == "gone"
    assert plan(project, model.fingerprint).n_stored == 2
    model.hopeless = lambda number, image: False
    assert finish(project, model).n_asked == last.n_failed


@pytest.mark.parametrize("n_bad", [1, 2, 3])
def test_bad_images_in_a_row_cost_their_own_answers_only(project, n_bad):
    order = Model(lambda number, image: False, fingerprint="order")
    finish(project, order)
    assert len(set(order.seen)) == N_IMAGES
    bad = set(order.seen[:n_bad])
    model = Model(lambda number, image: image in bad)
    last = finish(project, model)
    assert last.n_failed == n_bad * (N_PAIRS - 1)
    assert plan(project, model.fingerprint).n_to_ask == last.n_failed
    model.hopeless = lambda number, image: False
    assert finish(project, model).n_failed == 0


def test_other_failures_end_nothing(project):
    class Failing(Model):
        def answer(self, images, questions):
            for reply in super().answer(images, questions):
                yield Reply(reply.image, reply.question, Failure("no"))

    model = Failing(lambda number, image: False)
    assert finish(project, model).n_failed == N_IMAGES * N_PAIRS
    assert len(model.seen) == N_IMAGES


def test_a_run_that_gave_up_on_its_last_image_has_one_last_report(make_project):
    project = make_project(n_train=1, n_test=0)
    model = Model(lambda number, image: True)
    reports = list(ask(project, model))
    assert [report.n_failed for report in reports if report.n_left == 0] == [62]
