"""From answers to recognizers: repeatable, honest about test images, and true to the table."""

import dataclasses
import hashlib
import json

import pytest

from vqa_state.answers.answer import Answer
from vqa_state.answers.rates import count
from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.held_out import Baseline
from vqa_state.project.split import Split
from vqa_state.recognizer.recognizer import Recognizer
from vqa_state.report.frames import (
    MissedPicture,
    image_answers,
    missed_pictures,
    question_frame,
    score_frame,
    term_sentences,
)
from vqa_state.search.engines import Engine
from vqa_state.search.engines.paper import deap_search
from vqa_state.search.engines.restarts import N_RESTARTS
from vqa_state.search.exact import enumerate_subsets
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective
from vqa_state.search.proof import Badge
from vqa_state.study.build_recognizer import unchosen_recognizer
from vqa_state.study.collect import ask
from vqa_state.study.optimize import (
    optimize,
    recognizer_path,
    refresh,
    results,
)
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.votes.state import State

SMALL = SearchSettings(population=40, generations=8)


def by_pixels(image, question):
    """Answers that differ by picture, copy and question, with some invalid ones among them."""
    seen = hashlib.sha256(image.tobytes() + question.encode()).digest()[0]
    return Answer(("yes", "no", "door")[seen % 5 % 3])


@pytest.fixture
def model():
    return ScriptedModel(by_pixels)


@pytest.fixture
def asked(make_project, model):
    """A project whose questions were all asked."""
    project = make_project(n_train=4, n_test=4)
    project.search = SMALL
    project.model, project.fingerprint = model.name, model.fingerprint
    list(ask(project, model))
    project.save()
    return project


def tuned(project):
    reports = list(optimize(project))
    return reports, results(project)


def test_all_objectives_walk_together(asked):
    reports, found = tuned(asked)
    searching = [report for report in reports if not report.proving]
    n_steps = SMALL.generations + N_RESTARTS // 4
    assert [report.generation for report in searching] == list(range(n_steps + 1))
    assert set(found.searches) == set(Objective)
    assert all(one.finished and len(one.curve) == n_steps + 1 for one in found.searches.values())


def test_subsets_are_proved_best(asked):
    reports, found = tuned(asked)
    assert all(proof.finished for proof in reports[-1].proofs.values())
    counts = count(found.train)
    for objective, saved in found.searches.items():
        best = exact_best(counts, objective)
        assert saved.proof.badge is Badge.BEST
        assert saved.proof.value == saved.proof.bound == round(best.value, 6)
        fitness = Fitness(counts, objective)
        assert fitness.terms(saved.subset).value == best.value
        origin = Recognizer.load(recognizer_path(asked, objective)).origin
        assert (origin.engine, origin.proof) == (Engine.DEFAULT, saved.proof)


def exact_best(counts, objective):
    *_, last = enumerate_subsets(counts, objective)
    return last.terms


def test_the_papers_engine_is_its_one_search(asked):
    asked.engine = Engine.PAPER
    reports, found = tuned(asked)
    assert [report.generation for report in reports] == list(range(SMALL.generations + 1))
    *_, alone = deap_search(count(found.train), Objective.S_PLUS, settings=SMALL, seed=0)
    saved = found.searches[Objective.S_PLUS]
    assert saved.subset == alone.subset
    assert (saved.proof, saved.engine) == (None, Engine.PAPER)


def test_what_the_papers_engine_once_found_beside_is_passed_over(asked):
    _, found = tuned(asked)
    path = asked.folder / "searches" / "s_plus.json"
    paper = {"subset": [0], "value": 1.0, "n_recognized": 1}
    path.write_text(json.dumps(json.loads(path.read_bytes()) | {"paper": paper}))
    assert results(asked).searches == found.searches


def test_searches_of_version_1_are_still_read(asked):
    _, found = tuned(asked)
    for objective, saved in found.searches.items():
        content = saved.model_dump(mode="json", exclude={"engine", "proof"})
        path = asked.folder / "searches" / f"{objective.name.lower()}.json"
        path.write_text(json.dumps(content | {"schema_version": 1}))
    again = refresh(asked)
    assert {o: s.subset for o, s in again.searches.items()} == {
        o: s.subset for o, s in found.searches.items()
    }


def test_a_stop_while_proving_keeps_a_bound(asked):
    last_generation = SMALL.generations + N_RESTARTS // 4
    seen = iter(range(last_generation + 1))  # asked once a report of the search, then by the proofs
    *_, last = optimize(asked, lambda: next(seen, None) is None)
    assert last.stopped
    assert last.searched
    saved = results(asked).searches
    assert not all(one.finished for one in saved.values())


def test_recognizing_the_test_images_gives_the_test_table(asked, model):
    _, found = tuned(asked)
    for objective in Objective:
        row = next(r for r in found.evaluation.rows if r.name == objective)
        recognizer = Recognizer.load(recognizer_path(asked, objective))
        verdicts = {
            image: recognizer.recognize(asked.image_path(image), model)
            for image in asked.labelled(Split.TEST)
        }
        states = {1: State.POSITIVE, -1: State.NEGATIVE}
        right = sum(verdict.state is states[i.label] for i, verdict in verdicts.items())
        rates = sorted(rate(verdict, image.label) for image, verdict in verdicts.items())
        missed = {i.id for i, verdict in verdicts.items() if verdict.state is not states[i.label]}
        n_invalid = sum(verdict.n_invalid for verdict in verdicts.values())
        n_calls = sum(verdict.n_calls for verdict in verdicts.values())
        assert right == row.test.n_recognized
        assert n_invalid / n_calls == row.test.R_invalid
        assert sum(rates) / len(rates) == pytest.approx(row.test.R_ave, abs=1e-15)
        assert missed == {one.image_id for one in row.test_missed}
        assert recognizer.scores.test.n_recognized == row.test.n_recognized
        assert len(recognizer.questions) == row.test.n_used


def rate(verdict, label):
    """C / (C + W) of one image, 0 without a valid answer. Source: paper II-A."""
    right = verdict.n_positive if label > 0 else verdict.n_negative
    valid = verdict.n_positive + verdict.n_negative
    return right / valid if valid else 0.0


def test_twice_gives_the_same_bytes(asked):
    tuned(asked)
    first = {o: recognizer_path(asked, o).read_bytes() for o in Objective}
    tuned(asked)
    assert first == {o: recognizer_path(asked, o).read_bytes() for o in Objective}


def test_adding_in_another_order_gives_the_same_bytes(asked, tmp_path, model):
    tuned(asked)
    other = dataclasses.replace(asked, images=dict(reversed(asked.images.items())))
    first = recognizer_path(asked, Objective.S_PLUS).read_bytes()
    tuned(other)
    assert first == recognizer_path(other, Objective.S_PLUS).read_bytes()


def test_test_labels_never_change_what_is_chosen(asked):
    _, before = tuned(asked)
    for image in asked.labelled(Split.TEST):
        asked.set_labels([image.id], -image.label)
    _, after = tuned(asked)
    subsets = [{o: one.subset for o, one in found.searches.items()} for found in (before, after)]
    assert subsets[0] == subsets[1]
    assert question_frame(before.train).equals(question_frame(after.train))


def test_changed_training_label_makes_results_stale(asked):
    tuned(asked)
    image = asked.labelled(Split.TRAIN)[0]
    asked.set_labels([image.id], -image.label)
    assert results(asked) is None


def test_recognizer_files_follow_the_test_images(asked):
    tuned(asked)
    moved = asked.labelled(Split.TEST)[0]
    asked.set_splits([moved.id], Split.UNUSED)
    found = refresh(asked)
    recognizer = Recognizer.load(recognizer_path(asked, Objective.S_PLUS))
    assert found.test.n_images == recognizer.scores.test.n_images == 7


@pytest.mark.parametrize(
    "damage",
    [
        {"subset": [999]},
        {"subset": []},
        {"subset": [0, 0]},
        {"curve": []},
        {"objective": "s-"},
        None,
    ],
)
def test_damaged_search_counts_as_none(asked, damage):
    tuned(asked)
    path = asked.folder / "searches" / "s_plus.json"
    content = json.loads(path.read_text())
    path.write_text("{" if damage is None else json.dumps(content | damage))
    assert results(asked) is None
    assert refresh(asked) is None
    assert not recognizer_path(asked, Objective.S_PLUS).exists()


def test_every_term_is_told(asked):
    _, found = tuned(asked)
    said = term_sentences(found)
    assert [sentence.split(":")[0] for sentence in said] == [one.value for one in Objective]
    for sentence, report in zip(said, found.searches.values(), strict=True):
        assert f"= {report.proof.value:.3f}, " in sentence
        assert "above all questions by" in sentence or "no better than all" in sentence


def test_every_missed_image_is_told(asked):
    _, found = tuned(asked)
    for row in found.evaluation.rows:
        missed = missed_pictures(asked, row)
        assert len(missed) == len(row.train_missed) + len(row.test_missed)
    silent = MissedPicture("a.png", "open", "test", 0, 0, 12)
    assert silent.sentence() == "test: a.png is open: no answer (12 invalid)"


def test_all_questions_recognize_what_their_row_says(asked, model):
    _, found = tuned(asked)
    row = next(row for row in found.evaluation.rows if row.name is Baseline.S_ALL)
    written = unchosen_recognizer(asked, found)
    assert (written.origin, len(written.questions)) == (None, found.train.n_questions)
    for table, side in ((found.train, row.train), (found.test, row.test)):
        for image_id, right in zip(table.image_ids, side.recognized, strict=True):
            image = asked.images[image_id]
            own = State.POSITIVE if image.label > 0 else State.NEGATIVE
            said = written.recognize(asked.image_path(image), model)
            assert (said.state is own) is bool(right)
    assert written.scores.train.n_recognized == row.train.n_recognized
    assert written.scores.test.R_img_interval is not None


def test_stop_keeps_the_best_and_says_so(asked):
    stops = iter([False, False, True])
    reports = list(optimize(asked, lambda: next(stops)))
    assert reports[-1].generation == 2
    recognizer = Recognizer.load(recognizer_path(asked, Objective.S_PLUS))
    assert (recognizer.origin.finished, recognizer.origin.generations) == (False, 2)


def test_without_test_images_the_report_says_so(asked):
    asked.set_splits([image.id for image in asked.labelled(Split.TEST)], Split.UNUSED)
    _, found = tuned(asked)
    assert found.test is None
    assert score_frame(found.evaluation)["test_n_recognized"].isna().all()
    assert Recognizer.load(recognizer_path(asked, Objective.S_PLUS)).scores.test is None


def test_one_state_only_is_refused(asked):
    asked.set_labels([i.id for i in asked.labelled(Split.TRAIN)], 1)
    with pytest.raises(NothingToSearchError):
        next(optimize(asked))


def test_without_answers_the_error_says_what_to_do(project):
    with pytest.raises(NothingToSearchError, match="ask the model first"):
        next(optimize(project))


def test_raw_answers_of_an_image(asked):
    image = asked.labelled(Split.TRAIN)[0]
    text = asked.questions()[0].text
    answers = image_answers(asked, image.id, {text})
    assert [answer.copy for answer in answers] == [0, 1]
    assert all(answer.text in {"yes", "no", "door"} for answer in answers)


def test_files_of_two_runs_are_no_result(asked):
    """A kill between the four files leaves some of the run before."""
    list(optimize(asked))
    old = (asked.folder / "searches" / "s_plus.json").read_bytes()
    asked.search_seed = 1
    list(optimize(asked))
    assert results(asked) is not None
    (asked.folder / "searches" / "s_plus.json").write_bytes(old)
    assert results(asked) is None
