"""Asking: every answer is bought once, stored before it is counted, and a failure stays a gap."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from asked_models import N_CALLS, Model, every, finish, tables, telling

from vqa_state.answers.answer import Answer
from vqa_state.answers.table import MISSING
from vqa_state.errors import ModelError
from vqa_state.images.augmentation import copies
from vqa_state.models import Failure, Reply
from vqa_state.project.split import Split
from vqa_state.study import collect
from vqa_state.study.collect import answer_table, ask, plan
from vqa_state.testing.fake_model import ScriptedModel


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
        pixels = collect.read_picture(project.read(image)).pixels
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
            pixels = collect.read_picture(project.read(image)).pixels
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
    monkeypatch.setattr(collect, "_BITE_SECONDS", -1)

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
    monkeypatch.setattr(collect, "_BITE_SECONDS", -1)
    stopped = []
    for report in ask(project, scripted, stop=lambda: bool(stopped)):
        last = report
        if report.n_asked >= N_CALLS - 3:
            stopped.append(True)
    assert last.stopped
    assert len(scripted.asked) == N_CALLS - 3


def test_a_slow_model_is_stored_answer_by_answer(project, scripted, monkeypatch):
    monkeypatch.setattr(collect, "_BITE_SECONDS", -1)
    counts = [report.n_asked for report in ask(project, scripted)]
    assert sorted(set(counts)) == list(range(N_CALLS + 1))


def test_a_reader_that_walks_away_loses_nothing(project, scripted):
    reports = ask(project, scripted)
    next(reports)
    assert next(reports).n_asked == 32
    reports.close()
    assert plan(project, scripted.fingerprint).n_stored == 32
