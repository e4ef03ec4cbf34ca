"""Asking: every answer is bought once, stored before it is counted, and a failure stays a gap."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pictures import picture

from vqa_state import asking
from vqa_state.answers import MISSING, Answer
from vqa_state.asking import answer_table, ask, plan
from vqa_state.augment import Augmentation, AugmentationKind, copies
from vqa_state.errors import ModelError, NothingToSearchError, ProjectError, StoreError
from vqa_state.images import pixel_hash
from vqa_state.models.base import Failure, Reply
from vqa_state.models.fake import ScriptedModel
from vqa_state.project import Project
from vqa_state.questions import Question, QuestionGrid
from vqa_state.splits import Split
from vqa_state.store import AnswerStore

N_CALLS = 6 * 2 * 16


def telling(image, question):
    """An answer that depends on the picture and the question, now and then invalid."""
    value = int(pixel_hash(image)[:8], 16) ^ len(question) * 2654435761
    text = ("yes", "no", "hard to say")[value % 3]
    return Answer(text, (value % 101) / 100 if value % 2 else None)


@dataclass
class Model:
    """A model whose replies a test writes down whole."""

    reply: object
    name: str = "written"
    fingerprint: str = "written/1"

    def answer(self, images, questions):
        return self.reply(images, questions)


def every(images, questions):
    for i in range(len(images)):
        for q in range(len(questions)):
            yield Reply(i, q, Answer("yes"))


def finish(project, model, **options):
    """Ask to the end; every report on the way must add up, and be in the store already."""
    last = None
    for report in ask(project, model, **options):
        assert report.n_stored + report.n_asked + report.n_failed + report.n_left == report.n_calls
        assert min(report.n_stored, report.n_asked, report.n_failed, report.n_left) >= 0
        if report.n_asked + report.n_failed == 0:
            assert report.seconds_left is None
        else:
            assert report.seconds_left >= 0
        assert last is None or report.n_asked >= last.n_asked
        assert plan(project, model.fingerprint).n_stored == report.n_stored + report.n_asked
        last = report
    project.fingerprint = model.fingerprint
    return last


def tables(project):
    return [answer_table(project, split) for split in (Split.TRAIN, Split.TEST)]


def same(one, other):
    return all(
        a.image_ids == b.image_ids
        and a.questions == b.questions
        and (a.verdicts == b.verdicts).all()
        and np.array_equal(a.p_positive, b.p_positive, equal_nan=True)
        and (a.labels == b.labels).all()
        for a, b in zip(one, other, strict=True)
    )


def test_everything_is_asked_once(project, scripted):
    before = plan(project, scripted.fingerprint)
    assert (before.n_images, before.n_copies, before.n_questions) == (6, 2, 16)
    assert (before.n_calls, before.n_stored, before.n_to_ask) == (N_CALLS, 0, N_CALLS)
    report = finish(project, scripted)
    assert (report.n_asked, report.n_failed, report.n_left) == (N_CALLS, 0, 0)
    assert not report.stopped
    assert report.seconds_left == 0
    assert len(scripted.asked) == N_CALLS
    assert set(Counter(question for _, question in scripted.asked).values()) == {12}


def test_a_stored_answer_is_never_asked_again(project, scripted):
    finish(project, scripted)
    scripted.asked.clear()
    report = finish(project, scripted)
    assert (report.n_stored, report.n_asked) == (N_CALLS, 0)
    assert scripted.asked == []
    assert plan(project, scripted.fingerprint).n_to_ask == 0


def test_the_model_sees_the_shifted_copies(project):
    seen = set()

    def look(image, question):
        seen.add(image.tobytes())
        return Answer("yes")

    finish(project, ScriptedModel(look))
    expected = set()
    for image in project.labelled(Split.TRAIN, Split.TEST):
        pixels = asking.read_picture(project.read(image)).pixels
        expected |= {
            copy.tobytes()
            for copy in copies(pixels, image.pixel_hash, project.augmentation, project.seed)
        }
        assert pixels.tobytes() not in seen
    assert seen == expected


def test_the_table_holds_what_was_said(project):
    model = ScriptedModel(telling)
    finish(project, model)
    for split, table in zip((Split.TRAIN, Split.TEST), tables(project), strict=True):
        images = project.labelled(split)
        assert table.image_ids == tuple(image.id for image in images)
        assert table.questions == project.questions()
        assert table.labels.tolist() == [image.label for image in images]
        assert table.complete.all()
        for i, image in enumerate(images):
            pixels = asking.read_picture(project.read(image)).pixels
            shifted = copies(pixels, image.pixel_hash, project.augmentation, project.seed)
            for c, copy in enumerate(shifted):
                for q, question in enumerate(table.questions):
                    said = telling(copy, question.text)
                    assert table.verdicts[i, c, q] == said.verdict(question.yes_means)
                    p = table.p_positive[i, c, q]
                    if said.p_yes is None:
                        assert np.isnan(p)
                    else:
                        share = said.p_yes if question.yes_means > 0 else 1 - said.p_yes
                        assert p == np.float32(share)


def test_a_failure_stays_missing_and_is_asked_again(project):
    broken = True

    def script(image, question):
        if broken and "this door" in question:
            return Failure("the line is down")
        return Answer("no", 0.0)

    model = ScriptedModel(script)
    report = finish(project, model)
    assert (report.n_asked, report.n_failed, report.n_left) == (
        N_CALLS * 3 // 4,
        N_CALLS // 4,
        0,
    )
    assert report.last_failure == "the line is down"
    table = answer_table(project, Split.TRAIN)
    missing = np.array(["this door" in question.text for question in table.questions])
    assert (table.verdicts[:, :, missing] == MISSING).all()
    assert np.isnan(table.p_positive[:, :, missing]).all()
    assert (table.verdicts[:, :, ~missing] != MISSING).all()
    assert not table.complete.any()
    broken = False
    model.asked.clear()
    report = finish(project, model)
    assert (report.n_stored, report.n_asked) == (N_CALLS * 3 // 4, N_CALLS // 4)
    assert all("this door" in question for _, question in model.asked)
    assert answer_table(project, Split.TRAIN).complete.all()


def test_a_model_that_breaks_off_loses_nothing_that_it_said(project):
    def breaks_off(images, questions):
        yield Reply(0, 3, Answer("yes"))
        yield Reply(1, 0, Answer("no"))
        raise ModelError("out of memory; choose a smaller model")

    report = finish(project, Model(breaks_off))
    assert (report.n_asked, report.n_failed) == (12, N_CALLS - 12)
    assert report.last_failure == "out of memory; choose a smaller model"
    report = finish(project, Model(every))
    assert (report.n_stored, report.n_asked) == (12, N_CALLS - 12)


def test_a_model_that_repeats_itself_is_not_counted_twice(project):
    def repeats(images, questions):
        yield from every(images, questions)
        yield Reply(0, 0, Answer("no"))
        yield Reply(0, 0, Failure("again"))

    report = finish(project, Model(repeats))
    assert (report.n_asked, report.n_failed) == (N_CALLS, 0)
    assert (answer_table(project, Split.TRAIN).verdicts[0, 0, 0]) == 1


def test_a_model_that_omits_pairs_leaves_them_missing(project):
    def omits(images, questions):
        return (reply for reply in every(images, questions) if reply.question != 2)

    report = finish(project, Model(omits))
    assert report.n_failed == 12
    assert report.last_failure == "the model gave no reply to this question"
    assert (answer_table(project, Split.TRAIN).verdicts[:, :, 2] == MISSING).all()
    assert finish(project, Model(every)).n_asked == 12


def test_a_model_that_answers_what_nobody_asked_is_not_heard(project):
    def invents(images, questions):
        for i, q in ((-1, 0), (0, -1), (len(images), 0), (0, len(questions))):
            yield Reply(i, q, Answer("no"))
        yield from every(images, questions)

    report = finish(project, Model(invents))
    assert (report.n_asked, report.n_failed) == (N_CALLS, 0)
    assert (answer_table(project, Split.TRAIN).verdicts != 0).all()


@pytest.mark.parametrize("text", ["\ud800", "\x00", "", "é" * 10_000, "'; DROP TABLE answer; --"])
def test_a_strange_answer_ends_nothing(project, text):
    report = finish(project, ScriptedModel(lambda image, question: Answer(text, np.float32(0.5))))
    assert report.n_asked == N_CALLS
    assert (answer_table(project, Split.TRAIN).verdicts == 0).all()


def test_another_exception_keeps_what_was_stored(project, monkeypatch):
    monkeypatch.setattr(asking, "_BITE_SECONDS", -1)

    def falls(images, questions):
        yield Reply(0, 0, Answer("yes"))
        yield Reply(0, 1, Answer("yes"))
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        finish(project, Model(falls))
    assert plan(project, "written/1").n_stored == 2


def test_a_damaged_image_file_ends_nothing(project, scripted):
    damaged = project.labelled(Split.TRAIN)[1]
    path = project.image_path(damaged)
    good = path.read_bytes()
    path.write_bytes(good[:50])
    report = finish(project, scripted)
    assert (report.n_asked, report.n_failed) == (N_CALLS - 32, 32)
    assert damaged.name in report.last_failure
    table = answer_table(project, Split.TRAIN)
    assert table.complete.tolist() == [True, False, True, True]
    path.unlink()
    assert finish(project, scripted).n_failed == 32
    path.write_bytes(good)
    assert finish(project, scripted).n_asked == 32


def test_an_image_that_is_decoded_otherwise_is_not_asked_about(project, scripted):
    image = project.labelled(Split.TEST)[0]
    project.images[image.id] = replace(image, pixel_hash="0" * 64)
    report = finish(project, scripted)
    assert report.n_failed == 32
    assert "decoded differently here" in report.last_failure


@pytest.mark.parametrize("after", [0, 1, 5, 31, 32, 33, N_CALLS - 1, N_CALLS])
def test_stop_ends_within_one_bite_and_keeps_what_came(project, scripted, after):
    report = finish(project, scripted, stop=lambda: len(scripted.asked) >= after)
    assert len(scripted.asked) == after
    assert (report.n_asked, report.n_failed) == (after, 0)
    assert report.stopped == (after < N_CALLS)
    scripted.asked.clear()
    report = finish(project, scripted)
    assert (report.n_stored, report.n_asked) == (after, N_CALLS - after)
    assert len(scripted.asked) == N_CALLS - after


def test_a_stop_between_two_reports_is_told_in_the_last(project, scripted, monkeypatch):
    monkeypatch.setattr(asking, "_BITE_SECONDS", -1)
    stopped = []
    for report in ask(project, scripted, stop=lambda: bool(stopped)):
        last = report
        if report.n_asked >= N_CALLS - 3:
            stopped.append(True)
    assert last.stopped
    assert len(scripted.asked) == N_CALLS - 3


def test_a_slow_model_is_stored_answer_by_answer(project, scripted, monkeypatch):
    monkeypatch.setattr(asking, "_BITE_SECONDS", -1)
    counts = [report.n_asked for report in ask(project, scripted)]
    assert sorted(set(counts)) == list(range(N_CALLS + 1))


def test_a_reader_that_walks_away_loses_nothing(project, scripted):
    reports = ask(project, scripted)
    next(reports)
    assert next(reports).n_asked == 32
    reports.close()
    assert plan(project, scripted.fingerprint).n_stored == 32


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
