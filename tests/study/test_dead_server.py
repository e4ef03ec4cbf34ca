"""A model that stops answering ends the work: nothing is searched, and nothing is lost.

A search on part of the images needs a yes, says so in its files, and opens no test.
"""

import hashlib
import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import openai  # noqa: F401 - now, so that no test waits for it
import pytest
from pictures import draw, picture
from stub_server import Result, Stub, completion, free_port

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.answers.completeness import Completeness, SideAnswers
from vqa_state.cli import running
from vqa_state.errors import MissingAnswersError, NothingToSearchError
from vqa_state.images import read_picture
from vqa_state.images.augmentation import copies
from vqa_state.models import Failure
from vqa_state.project.project import Project
from vqa_state.project.searches import search_path
from vqa_state.project.split import Split
from vqa_state.recognizer.recognizer import Recognizer, read_recognizer
from vqa_state.recognizer.schema import content_digest
from vqa_state.report.page import report_page
from vqa_state.search.engines import Engine
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective
from vqa_state.study.answer_tables import read_tables
from vqa_state.study.assess import assess, assessment
from vqa_state.study.build_recognizer import unchosen_recognizer
from vqa_state.study.collect import ask
from vqa_state.study.export import recognizer_with
from vqa_state.study.leaderboard import standings
from vqa_state.study.optimize import is_optimized, optimize, recognizer_path, refresh, results
from vqa_state.study.transfer import recheck
from vqa_state.testing.fake_model import ScriptedModel

ROOT = Path(__file__).parent.parent.parent
TINY = SearchSettings(population=20, generations=3)
PER_IMAGE = 32  # 2 copies × 16 questions
TEXTS = ("yes", "no", "door")


def said_of(picture_of_it, question):
    return TEXTS[hashlib.sha256(picture_of_it + question.encode()).digest()[0] % 5 % 3]


def by_pixels(image, question):
    return Answer(said_of(image.tobytes(), question))


class Mortal:
    """Answers by the pixels until `left` calls are over; then every call fails."""

    def __init__(self, left=10**9):
        self.left = left

    def __call__(self, image, question):
        self.left -= 1
        return by_pixels(image, question) if self.left >= 0 else Failure("it died", for_all=True)


@pytest.fixture
def small(make_project):
    """Factory: six training and four test images; in an order that training images come first."""

    def make(folder="project", **more):
        project = make_project(folder, **({"n_train": 3, "n_test": 2} | more))
        project.search, project.engine, project.model = TINY, Engine.PAPER, "mortal"
        project.save()
        return project

    return make


@pytest.fixture
def mortal(registry):
    """A model whose life a test sets."""
    life = Mortal()
    models.register("mortal", lambda: ScriptedModel(life))
    return life


@pytest.fixture
def unassessed(monkeypatch):
    """An assessment of so few images is not what is tested here, and takes long."""

    def refused(*_):
        raise NothingToSearchError("too few images")
        yield

    monkeypatch.setattr(running, "assess", refused)


def asked(project, without=()):
    """Ask about all images but those at these places of the train or test side."""
    blind = {one.pixel_hash for one in without}
    kept = {key: one for key, one in project.images.items() if one.pixel_hash not in blind}
    whole, project.images = project.images, kept
    model = ScriptedModel(by_pixels)
    project.fingerprint, project.model = model.fingerprint, model.name
    list(ask(project, model))
    project.images = whole
    project.save()
    return project


def lacking(project, n_train=0, n_test=0):
    """Asked about all but the first images of each side."""
    sides = (project.labelled(Split.TRAIN)[:n_train], project.labelled(Split.TEST)[:n_test])
    return asked(project, [one for side in sides for one in side])


def copies_of(project, image):
    pixels = read_picture(project.read(image)).pixels
    return copies(pixels, image.pixel_hash, project.augmentation, project.seed)


def files(project):
    """What a search leaves, by name."""
    folders = (project.folder / "recognizers", project.folder / "searches")
    paths = [path for folder in folders if folder.exists() for path in folder.iterdir()]
    return {f"{path.parent.name}/{path.name}": path.read_bytes() for path in paths}


# ---- counts --------------------------------------------------------------------------------


def test_what_is_missing_is_counted_by_image_and_answer(small):
    project = lacking(small(), n_train=2, n_test=1)
    answers = read_tables(project).answers
    assert (answers.train.n_complete, answers.train.n_missing) == (4, 2 * PER_IMAGE)
    assert answers.lacks == (
        "2 of 6 training images lack 64 answers and 1 of 4 test images lacks 32 answers"
    )
    assert (answers.part, answers.part_is_searchable) == ("4 of 6", True)


@pytest.mark.parametrize(
    ("train", "test", "words"),
    [
        ((4, 4, 0, 2), (2, 2, 0, 2), ()),
        ((4, 4, 0, 2), (0, 0, 0, 0), ()),
        ((4, 3, 1, 2), (0, 0, 0, 0), ("3 of 4 training images", "Ask the model")),
        ((4, 3, 1, 2), (2, 2, 0, 2), ("lacks 1 answer)", "The test stays closed. Ask")),
        ((4, 4, 0, 2), (2, 1, 7, 1), ("stays closed until all its answers are there: 1 of 2",)),
    ],
)
def test_the_limits_of_a_search_are_told(train, test, words):
    answers = Completeness(SideAnswers("training", *train), SideAnswers("test", *test))
    assert len(answers.limits) == len(words)
    assert all(word in said for word, said in zip(words, answers.limits, strict=True))


# ---- in a program --------------------------------------------------------------------------


def test_a_search_on_part_of_the_images_needs_a_yes(small):
    project = lacking(small(), n_train=2)
    with pytest.raises(MissingAnswersError, match="2 of 6 training images lack 64 answers; ask"):
        next(optimize(project))
    assert files(project) == {}
    list(optimize(project, incomplete=True))
    found = results(project)
    assert (found.train.n_images, found.test, is_optimized(project)) == (4, None, True)
    assert (found.evaluation.n_left_out_train, found.evaluation.n_left_out_test) == (2, 0)


def test_a_recognizer_of_a_part_says_so_and_has_no_test_score(small):
    project = lacking(small(), n_train=2)
    list(optimize(project, incomplete=True))
    found = results(project)
    made = [Recognizer.load(recognizer_path(project, one)) for one in Objective]
    made += [unchosen_recognizer(project, found), recognizer_with(project, found, None)]
    for one in made:
        content = json.loads(one.to_bytes())
        assert content["incomplete"] == {"n_images": 4, "n_labelled": 6}
        assert (content["schema_version"], content["scores"]["test"]) == (4, None)
        assert read_recognizer(one.to_bytes(), "it").to_bytes() == one.to_bytes()


def test_a_yes_without_need_changes_no_byte(small):
    plain, agreed = (asked(small(name)) for name in ("one", "two"))
    list(optimize(plain))
    list(optimize(agreed, incomplete=True))
    assert files(plain) == files(agreed)
    assert not any(b"incomplete" in content for content in files(plain).values())
    assert json.loads(files(plain)["recognizers/s_plus.json"])["schema_version"] == 3


def test_the_rest_of_the_answers_makes_it_the_undisturbed_search(small):
    whole, late = asked(small("whole")), lacking(small("late"), n_train=2, n_test=1)
    list(optimize(whole))
    list(optimize(late, incomplete=True))
    asked(late)
    assert results(late) is None  # a search on a part is none on all
    list(optimize(late))
    assert files(late) == files(whole)


def test_complete_images_of_one_state_are_no_part_to_search_on(small):
    project = small()
    asked(project, [one for one in project.labelled(Split.TRAIN) if one.label > 0])
    for yes in (False, True):
        with pytest.raises(MissingAnswersError, match="all of one state"):
            next(optimize(project, incomplete=yes))


def test_without_a_complete_image_a_yes_is_not_enough(small):
    project = lacking(small(), n_train=6)
    with pytest.raises(MissingAnswersError, match="no training image has all its answers yet"):
        next(optimize(project, incomplete=True))


def test_a_search_on_a_part_without_a_yes_counts_as_none(small):
    """As programs wrote it that did not ask."""
    project = lacking(small(), n_train=2)
    list(optimize(project, incomplete=True))
    for objective in Objective:
        path = search_path(project, objective)
        content = json.loads(path.read_text())
        del content["incomplete"]
        path.write_text(json.dumps(content))
    assert (results(project), is_optimized(project), refresh(project)) == (None, False, None)
    assert not recognizer_path(project, Objective.S_PLUS).exists()


def test_the_test_is_opened_whole_or_not_at_all(small):
    whole, project = asked(small("whole")), lacking(small(), n_test=1)
    list(optimize(whole))
    list(optimize(project))  # no training image lacks anything
    found = results(project)
    assert (found.test, found.incomplete, found.evaluation.n_left_out_test) == (None, None, 1)
    assert Recognizer.load(recognizer_path(project, Objective.S_PLUS)).scores.test is None
    asked(project)
    assert refresh(project).test.n_images == 4
    assert files(project) == files(whole)


def test_a_new_label_without_answers_is_told_and_not_searched_around(small, run):
    project = asked(small())
    list(optimize(project))
    new = project.add(picture(50), "new.png", 1).image
    project.set_splits([new.id], Split.TRAIN)
    project.save()
    assert results(project) is None
    with pytest.raises(MissingAnswersError, match="1 of 7 training images lacks 32 answers"):
        next(optimize(project))
    code, _, err = run("report", project.folder)
    assert code == 1
    assert "1 of 7 training images lacks 32 answers: run `python -m vqa_state ask`" in flat(err)


# ---- what never opens the test -------------------------------------------------------------


class Reds:
    """Features for the rival: it remembers how many copies it was shown."""

    fingerprint, n_features = "reds", 1

    def __init__(self):
        self.n_shown = 0

    def __call__(self, images):
        import numpy as np

        for one in images:
            self.n_shown += 1
            yield np.asarray(one, np.float32).mean(axis=(0, 1))[:1]


def test_assess_shows_the_rival_no_test_image_and_the_report_opens_none(small):
    project = lacking(small(n_train=4, n_test=2), n_train=2)
    list(optimize(project, incomplete=True))
    list(assess(project, features=Reds, n_resamples=2))
    found = results(project)
    kept = assessment(project, found)
    tests = {one.id for one in project.labelled(Split.TEST)}
    assert kept.rival.sides
    assert not tests & set(kept.rival.sides)
    table = standings(project.chosen, found, kept)
    assert all(row.test is None for row in table.rows)
    assert (table.sentences, table.comparisons) == ((), ())
    page = report_page(project, found, kept, table)
    assert "The search saw 6 of 8 training images" in page
    assert "The test stays closed." in page
    assert "4 test images (closed)" in page
    assert "looked at" not in page


def test_recheck_leaves_the_test_of_a_part_closed(small):
    project = lacking(small(), n_train=2)
    list(optimize(project, incomplete=True))
    other = ScriptedModel(by_pixels, name="other", fingerprint="other/1")
    recognizer = Recognizer.load(recognizer_path(project, project.chosen))
    *_, last = recheck(recognizer, project, other)
    assert [side.split for side in last.sides] == [Split.TRAIN]


def test_recheck_opens_a_test_whole_or_not_at_all(small):
    project = asked(small())
    list(optimize(project))
    recognizer = Recognizer.load(recognizer_path(project, project.chosen))
    blind = [copy.tobytes() for copy in copies_of(project, project.labelled(Split.TEST)[0])]

    def script(image, question):
        return Failure("no") if image.tobytes() in blind else by_pixels(image, question)

    other = ScriptedModel(script, name="other", fingerprint="other/1")
    *_, last = recheck(recognizer, project, other)
    train, test = last.sides
    assert (train.n_images, train.n_left_out) == (6, 0)
    assert (test.n_images, test.n_left_out, last.says) == (0, 1, "")
    assert "Answers about 1 test images are missing" in test.sentence


# ---- on the command line -------------------------------------------------------------------


def project_of(project):
    """As it is on disk by now."""
    return Project.open(project.folder)


def flat(text):
    return " ".join(text.split())


def test_tune_ends_where_answers_are_missing_and_goes_on(run, small, mortal, unassessed):
    whole, project = small("whole"), small("project")
    assert run("tune", whole.folder)[0] == 0
    mortal.left = 8 * PER_IMAGE + 5
    code, out, err = run("tune", project.folder)
    assert (code, out, files(project)) == (3, "", {})
    answers, said = read_tables(project_of(project)).answers, flat(err)
    assert f"{answers.lacks} (the last failure: it died). Nothing was searched" in said
    assert answers.train.n_missing + answers.test.n_missing == 2 * PER_IMAGE - 5
    assert f"search on the {answers.train.n_complete} complete training images with --inc" in said
    assert Project.open(project.folder).test_looks == 0
    mortal.left = 10**9
    assert run("tune", project.folder)[0] == 0
    assert files(project) == files(whole)
    assert Project.open(project.folder).test_looks == Project.open(whole.folder).test_looks == 1


def test_tune_and_optimize_take_a_yes_and_count_no_look(run, tmp_path, small, mortal, unassessed):
    project = small()
    assert run("ask", small("looked at").folder)[0] == 0  # later it is asked without a look
    mortal.left = 8 * PER_IMAGE + 5
    code, out, _ = run("tune", project.folder, "--incomplete")
    train = read_tables(project_of(project)).answers.train
    assert (code, train.whole, train.n_states) == (3, False, 2)
    saw = f"The search saw {train.n_complete} of 6 training images"
    assert saw in flat(out)
    assert "The test stays closed." in flat(out)
    code, _, err = run("optimize", project.folder)
    assert (code, f"{train.lacks}; ask the model for them" in flat(err)) == (3, True)
    assert run("optimize", project.folder, "--incomplete")[0] == 0
    code, out, _ = run("report", project.folder, "--json", "--html", tmp_path / "page.html")
    shown = json.loads(out)
    assert (code, len(shown["limits"])) == (0, 2)
    assert {row["test_n_images"] for row in shown["subsets"]} == {None}
    assert {row["test"] for row in shown["recognizers"]} == {None}
    _, out, _ = run("export", project.folder, tmp_path / "r.json")
    assert saw in flat(out)
    assert read_recognizer((tmp_path / "r.json").read_bytes(), "it").scores.test is None
    mortal.left = 10**9
    assert run("recheck", project.folder, tmp_path / "r.json", "--model", "mortal")[0] == 0
    assert Project.open(project.folder).test_looks == 0


def test_an_image_that_cannot_be_read_ends_tune(run, small, mortal, unassessed):
    project = small()
    gone = project.labelled(Split.TRAIN)[0]
    data = project.image_path(gone).read_bytes()
    project.image_path(gone).unlink()
    code, _, err = run("tune", project.folder)
    assert (code, files(project)) == (3, {})
    said = f"1 of 6 training images lacks 32 answers (the last failure: the file of {gone.name} is"
    assert said in flat(err)
    project.image_path(gone).write_bytes(data)
    assert run("tune", project.folder)[0] == 0


def test_a_stop_while_asking_says_what_is_missing(run, small, registry, unassessed):
    import signal

    project = small()
    n_seen = []

    def interrupting(image, question):
        n_seen.append(question)
        if len(n_seen) == 3 * PER_IMAGE:
            signal.raise_signal(signal.SIGINT)
        return by_pixels(image, question)

    models.register("mortal", lambda: ScriptedModel(interrupting))
    code, out, err = run("tune", project.folder, "--incomplete")
    assert (code, out, files(project)) == (3, "", {})
    assert "training images lack" in flat(err)
    assert "run the same command again" in flat(err)


def test_reproduce_ends_where_answers_are_missing(run, small, tmp_path, mortal, monkeypatch):
    from vqa_state.cli import reproducing

    small("samples/door")
    monkeypatch.setattr(reproducing, "EXPERIMENTS", ("door",))
    where = ["--out", tmp_path / "out", "--projects", tmp_path / "samples", "--model", "mortal"]
    mortal.left = 4 * PER_IMAGE
    code, _, err = run("reproduce", *where)
    assert code == 3
    assert "Nothing was searched; what was answered is kept. This is door; when the" in flat(err)
    assert files(Project.open(tmp_path / "out" / "door")) == {}


def dying(port, n_calls):
    """A server that answers by the picture and goes away after so many calls."""
    server = Stub(port=port)

    def script(call, handler):
        if call.number == n_calls:
            threading.Thread(target=server.__exit__, args=(None,) * 3).start()
        if call.number >= n_calls:
            return handler.reset()
        if "messages" not in call.body:
            return Result({"data": [{"id": "m"}]})
        shown = call.body["messages"][0]["content"][0]["image_url"]["url"]
        return Result(completion(said_of(shown.encode(), call.question)))

    server.script = script
    return server


def tune(folder, home):
    """`tune` in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "vqa_state", "tune", str(folder)],
        env=os.environ | {"PYTHONPATH": str(ROOT), "VQA_STATE_HOME": str(home)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_server_that_dies_ends_tune_and_comes_back_to_the_same_bytes(run, small, unassessed):
    port, home = free_port(), os.environ["VQA_STATE_HOME"]
    address = f"server:http://127.0.0.1:{port}/v1#m"
    whole, project = (small(name, n_train=2, n_test=1) for name in ("whole", "project"))
    with dying(port, 10**9) as server:
        assert run("tune", whole.folder, "--model", address)[0] == 0
        n_calls = len(server.calls)
    project.model = address
    project.save()
    server = dying(port, n_calls // 2)
    server.__enter__()
    ended = tune(project.folder, home)
    said = flat(ended.stderr)
    assert (ended.returncode, ended.stdout, files(project)) == (3, "", {})
    assert "To go on, start the server and run the same command again" in said
    assert "nothing answers at http://127.0.0.1" in said or "connection" in said
    after = Project.open(project.folder)
    assert (after.test_looks, not read_tables(after).answers.train.n_complete) == (0, False)
    with dying(port, 10**9):
        assert run("tune", project.folder)[0] == 0
    assert files(project) == files(whole)


# ---- the file ------------------------------------------------------------------------------


def of_part(small):
    project = lacking(small(), n_train=2)
    list(optimize(project, incomplete=True))
    return json.loads(recognizer_path(project, Objective.S_PLUS).read_bytes())


def test_a_file_about_a_part_that_cannot_be_is_refused(small):
    content = of_part(small)
    train = content["scores"]["train"]
    wrong = [
        content | {"schema_version": 3},
        {key: value for key, value in content.items() if key != "incomplete"},
        content | {"incomplete": {"n_images": 4, "n_labelled": 4}},
        content | {"incomplete": {"n_images": 3, "n_labelled": 6}},
        content | {"scores": {"train": train, "test": train}},
    ]
    for one in (content, *wrong):
        one["digest"] = content_digest(one)
        data = json.dumps(one).encode()
        if one is content:
            assert read_recognizer(data, "it").incomplete.n_labelled == 6
        else:
            with pytest.raises(Exception, match="it cannot be used at"):
                read_recognizer(data, "it")


def test_it_recognizes_as_any_other(small):
    content = of_part(small)
    recognizer = read_recognizer(json.dumps(content).encode(), "it")
    whole = recognizer.model_copy(update={"incomplete": None, "schema_version": 3})
    model = ScriptedModel(by_pixels)
    assert recognizer.recognize(draw(3), model).votes == whole.recognize(draw(3), model).votes
