"""What the test images say, their labels and their answers, never reaches a choice.

Two worlds with one training side. In one, the model answers otherwise about the test images, they
have other labels, or they are other images. All that is chosen, kept or shown before a look must be
the same.
"""

from dataclasses import replace

import pytest
from pictures import picture
from study.test_assess import Colours, without_time
from tuned_project import MODEL, unsure

from vqa_state.answers.answer import Answer
from vqa_state.images import pixel_hash, read_picture
from vqa_state.images.augmentation import copies
from vqa_state.models import Failure
from vqa_state.project.split import Split
from vqa_state.report.frames import heatmap, term_sentences
from vqa_state.search.genetic import SearchSettings
from vqa_state.study.assess import assess
from vqa_state.study.build_recognizer import paper_recognizer, unchosen_recognizer
from vqa_state.study.collect import ask
from vqa_state.study.export import recognizer_with
from vqa_state.study.frontier_marks import marked_points
from vqa_state.study.leaderboard import standings
from vqa_state.study.optimize import optimize, results
from vqa_state.study.suggest import hints
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.votes.rules import VoteKind

# Perceptual hashes: the one between differs from both others by 6 bits, they from each other by 12.
HERE, BETWEEN, THERE = "0" * 16, "0" * 14 + "3f", "0" * 13 + "fff"


def flipped(image, question):
    said = unsure(image, question)
    other = {"yes": "no", "no": "yes"}.get(said.text, said.text)
    return Answer(other, 1 - said.p_yes)


def perfect(labels):
    """It knows every label: what a search would love to see."""

    def answer(image, question):
        says_yes = labels[pixel_hash(image)] > 0
        return Answer("yes" if says_yes else "no", float(says_yes))

    return answer


def silent(image, question):
    return Answer("door", 0.5)


def without_shares(image, question):
    return Answer(unsure(image, question).text, None)


def failing(image, question):
    return Failure("no answer")


def held_out_copies(project):
    """Label of every copy of a test image that the model will see, by its pixels."""
    found = {}
    for image in project.labelled(Split.TEST):
        pixels = read_picture(project.read(image)).pixels
        for copy in copies(pixels, image.pixel_hash, project.augmentation, project.seed):
            found[pixel_hash(copy)] = image.label
    return found


def world(make_project, folder, about_test, change):
    """A project that was walked to its end; `change` is made before anything is searched."""
    project = make_project(folder, n_train=4, n_test=3)
    project.search = SearchSettings(population=20, generations=4)
    project.model, project.fingerprint = MODEL.name, MODEL.fingerprint
    for image, looks in zip(project.labelled(Split.TRAIN), (HERE, THERE), strict=False):
        project.images[image.id] = replace(image, looks=looks)
    held_out = held_out_copies(project)
    about_test = perfect(held_out) if about_test == "perfect" else about_test
    change(project)
    project.save()

    def answer(image, question):
        script = about_test if pixel_hash(image) in held_out else unsure
        return script(image, question)

    list(ask(project, ScriptedModel(answer)))
    list(optimize(project))
    return project


def chosen_in(project):
    """All that was chosen, and all that a person sees without looking at the test."""
    *_, last = assess(project, features=Colours, n_resamples=4)
    found, kept = results(project), last.assessment
    table, hinted = standings(project.chosen, found, kept), hints(project, found, kept)
    files = [recognizer_with(project, found, kept, k, 0.8) for k in kept.votes]
    files += [paper_recognizer(project, found, objective) for objective in found.searches]
    files.append(unchosen_recognizer(project, found))
    return {
        "searches": {o: s.model_dump_json() for o, s in found.searches.items()},
        "assessment": without_time(without_test_sides(kept, project)),
        "recognizers": [
            one.model_copy(
                update={"scores": one.scores.model_copy(update={"test": None})}
            ).to_bytes()
            for one in files
        ],
        "shown": (table.recommendation, table.warnings, table.badges, term_sentences(found)),
        "rows": [(r.name, r.train, r.estimate, r.recommended, r.early_calls) for r in table.rows],
        "marks": marked_points(found),
        "hints": repr(hinted),
        "heatmap": heatmap(project).to_csv(),
        "baselines": [(row.name, row.subset) for row in found.evaluation.rows],
    }


def without_test_sides(kept, project):
    """What the rival sees in each test image is kept, but chooses nothing."""
    trained = {image.id for image in project.labelled(Split.TRAIN)}
    sides = {image_id: side for image_id, side in kept.rival.sides.items() if image_id in trained}
    return kept.model_copy(update={"rival": kept.rival.model_copy(update={"sides": sides})})


def nothing(project):
    pass


def other_labels(project):
    for image in project.labelled(Split.TEST):
        project.set_labels([image.id], -image.label)


def one_state(project):
    project.set_labels([image.id for image in project.labelled(Split.TEST)], 1)


def add_one(project):
    image = project.add(picture(50), "added.png", 1).image
    project.set_splits([image.id], Split.TEST)


def remove_one(project):
    project.set_splits([project.labelled(Split.TEST)[0].id], Split.UNUSED)


def remove_all(project):
    project.set_splits([image.id for image in project.labelled(Split.TEST)], Split.UNUSED)


def bridge(project):
    """A test image that looks like two training images, which do not look like each other."""
    image = project.labelled(Split.TEST)[0]
    project.images[image.id] = replace(image, looks=BETWEEN)


@pytest.fixture(scope="module")
def as_it_was():
    return {}


CHANGES = [
    pytest.param(flipped, nothing, id="opposite answers"),
    pytest.param("perfect", nothing, id="perfect answers"),
    pytest.param(silent, other_labels, id="no clear answer, opposite labels"),
    pytest.param(without_shares, nothing, id="no probabilities"),
    pytest.param(failing, nothing, id="failed calls"),
    pytest.param(unsure, other_labels, id="opposite labels"),
    pytest.param(unsure, one_state, id="one state only"),
    pytest.param(unsure, add_one, id="one image more"),
    pytest.param(unsure, remove_one, id="one image less"),
    pytest.param(unsure, remove_all, id="no test image"),
    pytest.param(unsure, bridge, id="a look-alike of two training images"),
]


@pytest.mark.parametrize(("about_test", "change"), CHANGES)
def test_it_reaches_no_choice(make_project, as_it_was, about_test, change):
    if not as_it_was:
        as_it_was.update(chosen_in(world(make_project, "as it was", unsure, nothing)))
    project = world(make_project, "changed", about_test, change)
    now = chosen_in(project)
    for part, was in as_it_was.items():
        assert now[part] == was, part
    assert set(VoteKind) == {kind for kind in VoteKind if kind.value in now["assessment"]}
