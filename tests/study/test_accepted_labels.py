"""A label that a vote suggested teaches, and never tests, whatever is divided afterwards."""

import io
from collections import deque

import pytest
from pictures import encode, picture
from PIL import Image
from tuned_project import MODEL, tuned_copy

from vqa_state.errors import ProjectError
from vqa_state.evaluation.label_ranking import Suggestion
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.study.optimize import results
from vqa_state.study.suggest import accept, ask_unlabelled, hints


@pytest.fixture
def with_accepted(make_project):
    """A divided project, and six images with accepted labels."""
    project = make_project(n_train=3, n_test=3)
    new = [project.add(picture(100 + n), f"{n}.png").image.id for n in range(6)]
    accept(project, tuple(Suggestion(one, (-1) ** n, 0.9) for n, one in enumerate(new)))
    return project, new


def sides(project, ids):
    return {project.images[one].split for one in ids}


@pytest.mark.parametrize("seed", range(5))
def test_dividing_again_leaves_accepted_labels_in_training(with_accepted, seed):
    project, new = with_accepted
    project.seed = seed
    project.assign_splits(train_share=0.2, afresh=True)
    assert sides(project, new) == {Split.TRAIN}
    project.set_splits(new, None)
    project.assign_splits(train_share=0.2)
    assert sides(project, new) == {Split.TRAIN}


def test_only_a_label_of_a_person_may_test(with_accepted):
    project, new = with_accepted
    with pytest.raises(ProjectError, match="label it yourself first"):
        project.set_splits(new, Split.TEST)
    assert sides(project, new) == {Split.TRAIN}
    project.set_labels(new[:1], project.images[new[0]].label)
    project.set_splits(new[:1], Split.TEST)
    assert project.images[new[0]].split is Split.TEST


def test_what_was_accepted_is_kept_in_the_file(with_accepted):
    project, new = with_accepted
    project.save()
    again = Project.open(project.folder)
    assert {image.id for image in again.images.values() if image.accepted} == set(new)
    again.set_labels(new, None)
    assert not any(image.accepted for image in again.images.values())
    assert sides(again, new) == {None}


def test_an_image_not_used_stays_unused(with_accepted):
    project, new = with_accepted
    project.set_labels(new[:1], None)
    project.set_splits(new[:1], Split.UNUSED)
    project.set_labels(new[:1], 1, accepted=True)
    assert project.images[new[0]].split is Split.UNUSED


def test_no_label_is_suggested_to_a_twin_of_a_test_image(make_project, tmp_path):
    project = tuned_copy(make_project, tmp_path)
    twins = {}
    for image in project.labelled(Split.TRAIN, Split.TEST):
        pixels = Image.open(io.BytesIO(project.read(image))).resize((64, 48))
        twins[project.add(encode(pixels), "twin").image.id] = image.split
    assert len(project.look_alikes()) == len(twins)
    found = results(project)
    deque(ask_unlabelled(project, found, None, MODEL), maxlen=0)
    suggested = {twins[one.image_id] for one in hints(project, found, None).suggestions}
    assert suggested == {Split.TRAIN}
