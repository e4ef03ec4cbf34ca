"""What is asked after a change, a stop or a failure: only what lacks, and never twice."""

from dataclasses import replace

import numpy as np
import pytest
from asked_models import N_CALLS, finish, same, tables, telling
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pictures import picture

from vqa_state.answers.answer import Answer
from vqa_state.answers.store import AnswerStore
from vqa_state.errors import NothingToSearchError, ProjectError, StoreError
from vqa_state.images.augmentation import Augmentation, AugmentationKind
from vqa_state.models import Failure
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.questions.grid import Question, QuestionGrid
from vqa_state.study.collect import answer_table, ask, plan
from vqa_state.testing.fake_model import ScriptedModel


@pytest.mark.parametrize(
    "change",
    [
        lambda p: setattr(p, "seed", 1),
        lambda p: setattr(p, "augmentation", Augmentation(amount=0.2, n_copies=2)),
        lambda p: setattr(
            p, "augmentation", Augmentation(AugmentationKind.GAUSSIAN_NOISE, n_copies=2)
        ),
    ],
    ids=["seed", "amount", "kind"],
)
def test_other_copies_are_asked_about_anew_and_the_old_come_back(project, change):
    model = ScriptedModel(telling)
    finish(project, model)
    before, settings_before = tables(project), (project.seed, project.augmentation)
    change(project)
    assert not answer_table(project, Split.TRAIN).complete.any()
    assert finish(project, model).n_asked == N_CALLS
    assert not same(tables(project), before)
    project.seed, project.augmentation = settings_before
    model.asked.clear()
    finish(project, model)
    assert model.asked == []
    assert same(tables(project), before)


def test_another_fingerprint_is_asked_anew(project, scripted):
    finish(project, scripted)
    other = ScriptedModel(lambda image, question: Answer("no"), fingerprint="scripted/2")
    assert finish(project, other).n_asked == N_CALLS
    assert (answer_table(project, Split.TRAIN).verdicts[:, :, 0] == -1).all()
    project.fingerprint = scripted.fingerprint
    assert (answer_table(project, Split.TRAIN).verdicts[:, :, 0] == 1).all()


def test_more_copies_ask_only_about_the_new_ones(project, scripted):
    finish(project, scripted)
    project.augmentation = Augmentation(n_copies=3)
    report = finish(project, scripted)
    assert (report.n_stored, report.n_asked) == (N_CALLS, N_CALLS // 2)


def test_one_more_question_asks_only_that(project, scripted):
    finish(project, scripted)
    scripted.asked.clear()
    project.grid = replace(project.grid, custom=(Question("Could a cat walk in?", 1),))
    assert finish(project, scripted).n_asked == 12
    assert {question for _, question in scripted.asked} == {"Could a cat walk in?"}


def test_one_more_image_asks_only_about_that(project, scripted):
    finish(project, scripted)
    image = project.add(picture(70), "new.png", 1).image
    project.set_splits([image.id], Split.TRAIN)
    assert finish(project, scripted).n_asked == 32


def test_a_change_of_meaning_asks_nothing(project, scripted):
    finish(project, scripted)
    before = answer_table(project, Split.TRAIN)
    phrases = tuple(replace(phrase, yes_means=-phrase.yes_means) for phrase in project.grid.phrases)
    project.grid = replace(project.grid, phrases=phrases)
    project.set_labels([next(iter(project.images))], -1)
    assert finish(project, scripted).n_asked == 0
    after = answer_table(project, Split.TRAIN)
    assert (after.verdicts == -before.verdicts).all()
    assert np.allclose(after.p_positive, 1 - before.p_positive)


def test_files_with_the_same_pixels_share_their_answers(project, scripted):
    twin = project.add(picture(0, "BMP"), "twin.bmp", 1).image
    project.set_splits([twin.id], Split.TRAIN)
    report = finish(project, scripted)
    assert (report.n_calls, report.n_asked, report.n_left) == (N_CALLS, N_CALLS, 0)
    assert len(scripted.asked) == N_CALLS
    assert answer_table(project, Split.TRAIN).complete.tolist() == [True] * 5


def test_changes_during_a_run_do_not_reach_its_answers(project):
    model = ScriptedModel(telling)
    undisturbed = None
    for _ in ask(project, model):
        if undisturbed is None:
            undisturbed = project.augmentation, project.seed
        project.augmentation = Augmentation(AugmentationKind.GAUSSIAN_NOISE, 0.5, n_copies=2)
        project.seed = 7
    project.augmentation, project.seed = undisturbed
    project.fingerprint = model.fingerprint
    disturbed = tables(project)
    project.store_path.unlink()
    finish(project, model)
    assert same(tables(project), disturbed)


def test_the_order_of_adding_does_not_matter(make_project):
    def table_of(folder, order):
        project = make_project(folder, n_train=0, n_test=0)
        for number in order:
            image = project.add(picture(number), f"{number}.png", 1 if number % 2 else -1).image
            project.set_splits([image.id], Split.TRAIN)
        finish(project, ScriptedModel(telling))
        return [answer_table(project, Split.TRAIN)]

    assert same(table_of("one", range(5)), table_of("other", (3, 1, 4, 0, 2)))


def test_unlabelled_and_unused_images_are_not_asked_about(project, scripted):
    first, second, *_ = project.images
    project.set_labels([first], None)
    project.set_splits([second], Split.UNUSED)
    assert finish(project, scripted).n_asked == N_CALLS - 2 * 32


def test_nothing_to_ask_is_told(make_project, scripted):
    project = make_project(n_train=0, n_test=0)
    with pytest.raises(NothingToSearchError, match=r"no labelled image on .*; add images and give"):
        plan(project, "m")
    with pytest.raises(NothingToSearchError, match="no labelled image"):
        next(ask(project, scripted))
    with pytest.raises(NothingToSearchError, match="was asked yet; ask the model first"):
        answer_table(project, Split.TRAIN)
    full = make_project("other")
    full.grid = QuestionGrid()
    with pytest.raises(ProjectError, match="has no questions"):
        plan(full, "m")


def test_a_side_without_images_is_an_empty_table(make_project, scripted):
    project = make_project(n_test=0)
    finish(project, scripted)
    assert answer_table(project, Split.TEST).verdicts.shape == (0, 2, 16)


def test_a_full_disk_is_told_and_keeps_the_earlier_answers(project, scripted, monkeypatch):
    prepare = AnswerStore._prepare

    def small(store):
        prepare(store)
        store._db.execute("PRAGMA max_page_count = 12")

    monkeypatch.setattr(AnswerStore, "_prepare", small)
    long = ScriptedModel(lambda image, question: Answer("yes " * 100))
    with pytest.raises(StoreError, match="nothing that was stored is lost"):
        finish(project, long)
    stored = plan(project, long.fingerprint).n_stored
    assert 0 < stored < N_CALLS
    monkeypatch.undo()
    assert finish(project, long).n_stored == stored
    assert answer_table(project, Split.TRAIN).complete.all()


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    ends=st.lists(st.integers(0, 60), max_size=5),
    failing=st.sets(st.integers(0, 15), max_size=3),
)
def test_any_stops_and_failures_end_in_the_same_table(
    make_project, tmp_path_factory, ends, failing
):
    folder = tmp_path_factory.mktemp("asking")
    project = make_project(folder, n_train=1, n_copies=1)
    texts = [question.text for question in project.questions()]
    flaky = ScriptedModel(
        lambda image, question: (
            Failure("not now") if texts.index(question) in failing else telling(image, question)
        )
    )
    for end in ends:
        flaky.asked.clear()
        finish(project, flaky, stop=lambda end=end: len(flaky.asked) >= end)
        assert len(flaky.asked) <= max(end, 0)
    finish(project, ScriptedModel(telling))
    whole = make_project(folder / "whole", n_train=1, n_copies=1)
    finish(whole, ScriptedModel(telling))
    assert same(tables(project), tables(whole))
    assert Project.open(project.folder).images == whole.images


def test_two_at_once_never_pay_for_the_same_answers(project, scripted):
    first = ask(project, scripted)
    next(first)
    with pytest.raises(ProjectError, match=r"being asked by another .* ask again"):
        next(ask(project, scripted))
    list(first)
    assert len(scripted.asked) == plan(project, scripted.fingerprint).n_calls
    assert next(ask(project, scripted)).n_left == 0  # the lock is free again
