"""A recognizer on another model: what is lost is counted by image, and nothing paid twice."""

import numpy as np
import pytest

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.errors import RecognizerError
from vqa_state.project.project import Project
from vqa_state.recognizer.recognizer import Recognizer, recognize_all
from vqa_state.study.collect import ask
from vqa_state.study.optimize import optimize, recognizer_path
from vqa_state.study.transfer import Rechecked, recheck
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.votes.rules import VoteKind


def truth(project):
    """Label by the mean of the red channel, which survives the colour shift well enough here."""
    from vqa_state.images import read_picture

    return {
        np.asarray(read_picture(project.read(image)).pixels).mean(): image.label
        for image in project.images.values()
    }


def knowing(project, wrong=0, name="knowing"):
    """Answers by the nearest original's label, wrong about the first `wrong` test images."""
    known = truth(project)
    test = [image for image in project.images.values() if image.split == "test"]
    from vqa_state.images import read_picture

    lies = {np.asarray(read_picture(project.read(image)).pixels).mean() for image in test[:wrong]}

    def script(image, question):
        mean = min(known, key=lambda one: abs(one - np.asarray(image).mean()))
        label = -known[mean] if mean in lies else known[mean]
        says_open = "open" in question
        return Answer("yes" if (label > 0) == says_open else "no", 0.9)

    return ScriptedModel(script, name=name, fingerprint=f"{name}/1")


@pytest.fixture
def tuned(make_project, registry):
    """A project whose copies are hardly shifted, tuned on a model that knows it all."""
    from dataclasses import replace

    project = make_project(n_train=3, n_test=3)
    project.augmentation = replace(project.augmentation, amount=0.001)
    project.search = replace(project.search, population=20, generations=5)
    model = knowing(project)
    models.register("knowing", lambda: model)
    project.model, project.fingerprint = model.name, model.fingerprint
    project.save()
    list(ask(project, model))
    list(optimize(project))
    return Project.open(project.folder)


def rechecked(project, model):
    recognizer = Recognizer.load(recognizer_path(project, project.chosen))
    *_, last = recheck(recognizer, project, model)
    assert isinstance(last, Rechecked)
    return last


def test_the_same_answers_lose_nothing(tuned):
    found = rechecked(tuned, knowing(tuned, name="twin"))
    assert [(side.n_recognized, side.n_images, side.before) for side in found.sides] == [
        (6, 6, 6),
        (6, 6, 6),
    ]
    assert all(not side.lost and not side.gained for side in found.sides)
    assert "the same of the 6 test images" in found.says


def test_lost_images_are_named_and_tested(tuned):
    found = rechecked(tuned, knowing(tuned, wrong=2, name="worse"))
    train, test = found.sides
    assert (train.n_recognized, test.n_recognized, test.before) == (6, 4, 6)
    expected = [image.id for image in tuned.images.values() if image.split == "test"][:2]
    assert set(test.lost) == set(expected)
    assert "2 lost, 0 gained" in test.sentence
    assert "2 fewer images" in found.says
    assert test.interval.low < 4 / 6 < test.interval.high


def test_nothing_is_paid_twice(tuned):
    model = knowing(tuned, name="other")
    rechecked(tuned, model)
    n_asked = len(model.asked)
    assert n_asked > 0
    rechecked(tuned, model)
    assert len(model.asked) == n_asked


def test_a_vote_by_p_yes_pays_one_call_to_learn_that_there_is_none(tuned):
    plain = Recognizer.load(recognizer_path(tuned, tuned.chosen))
    recognizer = plain.model_copy(update={"vote": VoteKind.WEIGHTED_P_YES})
    silent = ScriptedModel(lambda image, question: Answer("yes"), name="silent", fingerprint="s/1")
    with pytest.raises(RecognizerError, match="gave none"):
        list(recheck(recognizer, tuned, silent))
    assert len(silent.asked) == 1
    *_, last = recheck(recognizer, tuned, knowing(tuned, name="sure"))
    assert isinstance(last, Rechecked)


def test_the_own_model_needs_no_call(tuned):
    model = knowing(tuned)
    rechecked(tuned, model)
    assert not model.asked


def test_the_project_is_left_as_it_is(tuned):
    before = (tuned.folder / "project.json").read_bytes()
    rechecked(tuned, knowing(tuned, name="other"))
    assert (tuned.folder / "project.json").read_bytes() == before


def test_answers_of_the_own_model_that_are_gone_are_not_guessed(tuned):
    for path in tuned.folder.glob("answers.sqlite*"):
        path.unlink()
    found = rechecked(tuned, knowing(tuned, name="other"))
    assert all(side.before is None for side in found.sides)
    assert found.says == ""
    assert "not known here" in found.sides[0].sentence


def test_many_recognizers_give_what_each_gives_alone_and_share_calls(tuned):
    recognizers = [
        Recognizer.load(path) for path in sorted((tuned.folder / "recognizers").iterdir())
    ]
    model = knowing(tuned)
    images = [tuned.read(image) for image in tuned.images.values()]
    for image in images:
        alone = [one.recognize(image, model) for one in recognizers]
        model.asked.clear()
        together = recognize_all(image, recognizers, model)
        n_union = len({q.text for one in recognizers for q in one.questions})
        assert len(model.asked) == n_union * recognizers[0].copies.n_copies
        for one, other in zip(alone, together, strict=True):
            assert (one.state, one.votes, one.reason) == (other.state, other.votes, other.reason)


def test_no_recognizers_give_no_verdicts(tuned):
    image = next(iter(tuned.images.values()))
    assert recognize_all(tuned.read(image), []) == []
