"""The commands, run as a user runs them."""

import hashlib
import json
from contextlib import contextmanager

import pytest
from made_recognizers import recognizer
from pictures import draw, encode, picture
from typer.testing import CliRunner

from vqa_state import cli, models
from vqa_state.answers.answer import Answer
from vqa_state.cli import running
from vqa_state.models import Failure
from vqa_state.project.project import Project
from vqa_state.recognizer.recognizer import Recognizer, WeightedQuestion, read_recognizer
from vqa_state.search.objectives import Objective
from vqa_state.study.optimize import recognizer_path
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.votes.rules import VoteKind

runner = CliRunner()
QUICK = ["--population", "30", "--generations", "5"]


def by_pixels(image, question):
    seen = hashlib.sha256(image.tobytes() + question.encode()).digest()[0]
    return Answer(("yes", "no", "door")[seen % 5 % 3])


@pytest.fixture
def scripted_model(registry):
    models.register("scripted", lambda: ScriptedModel(by_pixels))


@pytest.fixture
def photos(tmp_path):
    for number in range(16):
        folder = tmp_path / "photos" / ("open" if number % 2 else "closed")
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{number}.png").write_bytes(picture(number))
    (tmp_path / "photos" / "open" / "text.jpg").write_text("no picture")
    return tmp_path / "photos"


@pytest.fixture
def folder(run, tmp_path, photos, scripted_model):
    folder = tmp_path / "project"
    assert run("new", folder, "--name", "door")[0] == 0
    assert run("add", folder, photos)[0] == 0
    assert run("ask", folder, "--model", "scripted", "--copies", 2)[0] == 0
    return folder


def test_the_whole_road(run, tmp_path, folder, photos):
    code, out, _ = run("optimize", folder, *QUICK, "--seed", 3, "--json")
    document = json.loads(out)
    names = [row["subset"] for row in document["subsets"]]
    assert (code, names[:4]) == (0, ["s+", "s'+", "s-", "s'-"])
    code, out, _ = run("report", folder, "--csv", tmp_path / "csv")
    assert code == 0
    assert "Is the door open?" in out
    assert (tmp_path / "csv" / "scores.csv").exists()
    code, out, _ = run("export", folder, tmp_path / "r.json", "--objective", "s-")
    assert (code, Recognizer.load(tmp_path / "r.json").origin.objective) == (0, Objective.S_MINUS)
    code, out, _ = run("recognize", tmp_path / "r.json", photos / "open" / "1.png", "--json")
    verdict = json.loads(out)[0]
    assert verdict["state"] in {"positive", "negative", "unknown"}
    assert code == (3 if verdict["state"] == "unknown" else 0)
    assert verdict["milliseconds"] > 0


def test_all_questions_are_exported_until_a_choice_is_named(run, tmp_path, folder):
    run("optimize", folder, *QUICK)
    out = tmp_path / "r.json"
    code, said, _ = run("export", folder, out, "--all-questions")
    every, written = Project.open(folder).grid.build().questions, Recognizer.load(out)
    assert (code, written.origin, written.vote) == (0, None, VoteKind.PAPER)
    assert [question.text for question in written.questions] == [one.text for one in every]
    assert f"without a choice, {len(every)} questions" in said
    document = json.loads(run("export", folder, out, "--json")[1])  # it is kept
    assert (document["objective"], Recognizer.load(out)) == (None, written)
    run("export", folder, out, "--vote", "paper", "--coverage", 1)  # which all have, too
    assert Recognizer.load(out) == written
    said = run("export", folder, out, "--objective", "s-")[1]
    assert Recognizer.load(out).origin.objective is Objective.S_MINUS
    assert "no longer all questions" in said
    assert "no longer" not in run("export", folder, out, "--objective", "s-")[1]
    run("export", folder, out, "--all-questions")
    assert "`export` writes all questions instead" in run("report", folder)[1]
    run("export", folder, out, "--chosen-questions")
    assert Recognizer.load(out).origin.objective is Objective.S_MINUS
    code, _, err = run("export", folder, out, "--all-questions", "--vote", "threshold")
    assert (code, "leave out --objective, --vote and" in err) == (2, True)


def test_tune_twice_gives_the_same_bytes_and_asks_nothing_again(run, folder):
    run("optimize", folder, *QUICK)
    code, _, err = run("tune", folder)
    first = recognizer_path(Project.open(folder), Objective.S_PLUS).read_bytes()
    assert code == 0
    assert "0 of 512 answers asked" in err
    run("tune", folder)
    assert recognizer_path(Project.open(folder), Objective.S_PLUS).read_bytes() == first


def test_what_it_is_worth_and_every_vote_exported(run, tmp_path, folder, photos):
    run("optimize", folder, *QUICK)
    code, _, err = run("export", folder, tmp_path / "r.json", "--vote", "threshold")
    assert (code, "run `python -m vqa_state assess" in " ".join(err.split())) == (1, True)
    code, out, _ = run("assess", folder, "--json")
    document = json.loads(out)
    assert code == 0
    assert {"recommendation", "badges", "warnings", "sentences", "coverage"} <= set(document)
    assert document["frontier"]
    assert document["recognizers"][0]["estimate"]["share"] is not None
    page = tmp_path / "page" / "r.html"
    code, out, _ = run("report", folder, "--html", page)
    assert code == 0
    assert "Recommended: the vote by" in out
    assert "<svg" in page.read_text()
    code, out, _ = run(
        "export", folder, tmp_path / "r.json", "--vote", "weighted answers", "--coverage", 0.8
    )
    recognizer = Recognizer.load(tmp_path / "r.json")
    assert (code, recognizer.vote, recognizer.abstain.coverage) == (0, "weighted answers", 0.8)
    picture = photos / "open" / "1.png"
    whole = json.loads(run("recognize", tmp_path / "r.json", picture, "--json")[1])[0]
    early = json.loads(run("recognize", tmp_path / "r.json", picture, "--json", "--stop-early")[1])
    assert early[0]["state"] == whole["state"]
    assert early[0]["n_calls"] + early[0]["n_skipped"] == whole["n_calls"]
    code, _, err = run("export", folder, tmp_path / "r.json", "--vote", "weighted p_yes")
    assert (code, "no probabilities" in err) == (1, True)


def test_the_vote_and_coverage_of_an_export_are_kept(run, tmp_path, folder):
    run("optimize", folder, *QUICK)
    run("assess", folder)
    run("export", folder, tmp_path / "a.json", "--vote", "threshold", "--coverage", 0.7)
    assert run("export", folder, tmp_path / "b.json")[0] == 0
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    run("export", folder, tmp_path / "c.json", "--vote", "paper", "--coverage", 1)
    plain = recognizer_path(Project.open(folder), Objective.S_PLUS).read_bytes()
    assert Recognizer.load(tmp_path / "c.json").questions == read_questions(plain)


def read_questions(data):
    return read_recognizer(data, "it").questions


def test_a_failed_call_costs_one_image_and_not_the_others(run, tmp_path, folder, photos):
    run("optimize", folder, *QUICK)
    run("export", folder, tmp_path / "r.json")
    calls = []

    def failing_first(image, question):
        calls.append(question)
        return Failure("the server was busy") if len(calls) == 1 else by_pixels(image, question)

    models.register("elsewhere", lambda: ScriptedModel(failing_first))
    pictures = [photos / "open" / "1.png", photos / "open" / "3.png"]
    for early in ([], ["--stop-early"]):
        calls.clear()
        code, out, _ = run(
            "recognize", tmp_path / "r.json", *pictures, "--model", "elsewhere", "--json", *early
        )
        first, second = json.loads(out)
        assert (code, "busy" in first["error"], "state" in second) == (1, True, True)


def test_suggested_labels_are_kept_only_if_accepted(run, tmp_path, folder):
    run("optimize", folder, *QUICK)
    for number in (100, 101):
        (tmp_path / f"new{number}.png").write_bytes(picture(number))
        run("add", folder, tmp_path / f"new{number}.png")
    suggested = json.loads(run("label", folder, "--suggest", "--json")[1])
    new = {i.id for i in Project.open(folder).images.values() if i.name.startswith("new")}
    assert {one["id"] for one in suggested} <= new
    assert all(Project.open(folder).images[image_id].label is None for image_id in new)
    assert run("label", folder, "--accept")[0] == 2
    code, out, _ = run("label", folder, "--suggest", "--accept", "--json")
    assert (code, [one["id"] for one in json.loads(out)]) == (0, [o["id"] for o in suggested])
    images = Project.open(folder).images
    assert all(images[one["id"]].split == "train" for one in suggested)
    assert all(images[one["id"]].label is not None for one in suggested)


def test_the_papers_engine_is_kept(run, folder):
    assert run("optimize", folder, *QUICK, "--engine", "paper")[0] == 0
    project = Project.open(folder)
    assert project.engine == "paper"
    origin = Recognizer.load(recognizer_path(project, Objective.S_PLUS)).origin
    assert (origin.engine, origin.proof, origin.generations) == ("paper", None, 5)


def test_add_reports_refused_files_and_goes_on(run, tmp_path, photos):
    run("new", tmp_path / "p", "--name", "door")
    code, out, err = run("add", tmp_path / "p", photos, "--json")
    document = json.loads(out)
    assert (code, len(document["added"])) == (0, 16)
    assert "text.jpg" in err
    assert "not a picture" in document["refused"][0]["reason"]
    assert len(json.loads(run("add", tmp_path / "p", photos, "--json")[1])["already_there"]) == 16


def test_add_says_what_got_no_label_and_why(run, tmp_path):
    states = "--positive", "offen", "--negative", "geschlossen"
    run("new", tmp_path / "p", "--name", "door", *states)
    for number, name in enumerate(("auf/1.png", "auf/2.png", "geschlossen/3.png", "4.png")):
        path = tmp_path / "photos" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(picture(number))
    code, out, err = run("add", tmp_path / "p", tmp_path / "photos" / "auf")
    assert code == 0
    assert "2 added; 2 without a label: folder 'auf' is none of offen, geschlossen. 2 images" in out
    assert "put them in folders named 'offen' and 'geschlossen' and add them again" in err
    given = (tmp_path / "photos", tmp_path / "photos" / "4.png")
    code, out, err = run("add", tmp_path / "p", *given)
    assert "3 without a label, the most: folder 'photos/auf' is none of" in out
    assert "without a label: folder 'photos/auf' is none of offen, geschlossen (2)" in err
    assert "without a label: no folder names a state (1)" in err
    document = json.loads(run("add", tmp_path / "p", *given, "--json")[1])
    assert {"name": "4.png", "reason": "no folder names a state"} in document["unlabelled"]
    assert len(document["unlabelled"]) == 3
    _, out, err = run("add", tmp_path / "p", tmp_path / "photos" / "4.png", "--state", "offen")
    assert "without" not in out + err


@pytest.mark.parametrize(
    ("text", "counts", "sentence"),
    [
        ("no", "0 for open, 2 for closed", "closed (100% of the valid votes speak for closed;"),
        ("yes", "2 for open, 0 for closed", "open (100% of the valid votes speak for open;"),
        ("door", "0 for open, 0 for closed", "unknown (no answer was a clear yes or no;"),
    ],
)
def test_a_verdict_is_told_by_the_share_of_its_state(
    run, tmp_path, photos, registry, text, counts, sentence
):
    models.register("scripted", lambda: ScriptedModel(lambda *_: Answer(text)))
    question = WeightedQuestion(text="Is this door open?", yes_means=1)
    recognizer(questions=(question,), calls_per_image=2).save(tmp_path / "r.json")
    out = run("recognize", tmp_path / "r.json", photos / "open" / "1.png")[1]
    assert sentence in out
    assert counts in out


def test_labels_and_sides_by_hand(run, folder):
    images = json.loads(run("label", folder, "--json")[1])
    one = images[0]["id"]
    run("label", folder, one[:10], "--state", "open", "--split", "unused")
    image = Project.open(folder).images[one]
    assert (image.label, image.split) == (1, "unused")
    run("label", folder, "--divide", "0.75")
    sides = [image.split for image in Project.open(folder).images.values()]
    assert sides.count("train") == 5 + 6  # of 7 closed and 8 open ones
    run("label", folder, one, "--state", "none")
    assert Project.open(folder).images[one].label is None


def test_grid_by_options(run, folder):
    arguments = ["--wording", "water | in {article} sink", "--phrase", "running"]
    own = ["--yes-negative", "Is the sink dry?", "--off", "Is water running in a sink?"]
    document = json.loads(run("grid", folder, *arguments, *own, "--json")[1])
    texts = [question["text"] for question in document["questions"]]
    assert "Is water not running in the sink?" in texts
    assert document["switched_off"] == ["Is water running in a sink?"]
    assert {"text": "Is the sink dry?", "yes_means": -1} in document["questions"]
    assert len(texts) == 16


def test_every_setting_is_kept_and_used(run, folder):
    settings = {"crossover": 0.6, "mutation": 0.3, "bit-flip": 0.1, "tournament": 3, "alpha": 50}
    options = [part for key, value in settings.items() for part in (f"--{key}", value)]
    code, _, _ = run("optimize", folder, *QUICK, *options, "--beta", 0.2, "--seed", 9)
    assert code == 0
    project = Project.open(folder)
    recognizer = Recognizer.load(recognizer_path(project, Objective.S_PLUS))
    assert recognizer.origin.settings == project.search
    assert (project.search.crossover, project.search.tournament) == (0.6, 3)
    assert (recognizer.origin.weights.alpha, recognizer.origin.weights.beta) == (50, 0.2)
    assert recognizer.origin.seed == 9


def test_cost_asks_nothing(run, folder):
    code, out, _ = run("ask", folder, "--cost", "--copies", 3)
    assert code == 0
    assert "16 images × 3 copies × 16 questions = 768 calls, 512 in the store, 256 to ask" in out
    assert Project.open(folder).augmentation.n_copies == 2


def test_failed_calls_are_said_and_asked_again(run, folder, registry):
    registry["scripted"] = lambda: ScriptedModel(
        lambda image, q: Failure("busy") if "Does" in q else by_pixels(image, q),
        fingerprint="scripted/2",
    )
    code, out, _ = run("ask", folder)
    assert code == 3
    assert "256 failed (busy): run it again" in out
    registry["scripted"] = lambda: ScriptedModel(by_pixels, fingerprint="scripted/2")
    code, out, _ = run("ask", folder)
    assert (code, "256 of 512 answers asked" in out) == (0, True)


def test_a_stopped_search_says_so(run, folder, monkeypatch):
    run("optimize", folder, *QUICK)

    @contextmanager
    def at_once():
        yield lambda: True

    monkeypatch.setattr(running, "interruptible", at_once)
    code, out, err = run("optimize", folder, "--json")
    assert (code, json.loads(out)["finished"]) == (3, False)
    assert "stopped by you at generation 0 of 105" in err


def test_a_project_that_changes_meanwhile_loses_nothing(run, folder, monkeypatch):
    real = running.optimize

    def meanwhile(project, stop, **named):
        yield from real(project, stop, **named)
        other = Project.open(folder)
        other.test_looks = 7
        other.save()

    monkeypatch.setattr(running, "optimize", meanwhile)
    code, out, _ = run("optimize", folder, *QUICK)
    assert code == 0
    assert "looked at 8 times" in out
    assert Project.open(folder).test_looks == 8


def test_one_bad_picture_ends_nothing(run, tmp_path, folder, photos):
    run("optimize", folder, *QUICK)
    run("export", folder, tmp_path / "r.json")
    pictures = [photos / "open" / "text.jpg", photos / "open" / "1.png", tmp_path / "none.png"]
    code, out, err = run("recognize", tmp_path / "r.json", *pictures, "--json")
    records = json.loads(out)
    assert code == 1
    assert ["error" in record for record in records] == [True, False, True]
    assert "not a picture" in err


def test_one_bad_path_ends_nothing(run, tmp_path, photos):
    run("new", tmp_path / "p", "--name", "door", "--seed", 5)
    code, out, _ = run("add", tmp_path / "p", photos / "open" / "1.png", "nowhere", "--json")
    document = json.loads(out)
    assert (code, len(document["added"]), document["refused"][0]["name"]) == (0, 1, "nowhere")
    project = Project.open(tmp_path / "p")
    assert (len(project.images), project.seed) == (1, 5)


def test_a_refused_name_leaves_no_project(run, tmp_path):
    assert run("new", tmp_path / "p", "--name", "a|b")[0] == 1
    assert run("new", tmp_path / "p", "--name", "door")[0] == 0


def test_the_same_picture_under_both_states_is_told(run, tmp_path, photos):
    (photos / "closed" / "again.png").write_bytes((photos / "open" / "1.png").read_bytes())
    run("new", tmp_path / "p", "--name", "door")
    code, _, err = run("add", tmp_path / "p", photos)
    assert code == 0
    assert "it keeps that label: change it by hand" in " ".join(err.split())


def test_look_alikes_are_told_when_they_are_added(run, tmp_path):
    pixels = draw(1, (320, 240))
    for number, quality in enumerate((95, 60)):
        (tmp_path / f"{number}.jpg").write_bytes(encode(pixels, "JPEG", quality=quality))
    run("new", tmp_path / "p", "--name", "door")
    _, _, err = run("add", tmp_path / "p", tmp_path / "0.jpg", tmp_path / "1.jpg")
    assert "look alike" in err


def test_an_antonym_alone_replaces_the_negative_phrase(run, folder):
    document = json.loads(run("grid", folder, "--antonym", "shut", "--json")[1])
    texts = {question["text"] for question in document["questions"]}
    assert {"Is the door open?", "Is the door shut?"} <= texts
    assert "Is the door closed?" not in texts


def test_an_own_question_is_added_once(run, folder):
    for _ in range(2):
        document = json.loads(run("grid", folder, "--yes-positive", "Is it ajar?", "--json")[1])
    assert document["duplicates"] == []


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["ask", "nowhere"], 1, "holds no project"),
        (["ask", "{folder}", "--model", "gpt"], 1, "unknown model 'gpt'; choose one of"),
        (["ask", "{folder}", "--copies", "0"], 2, "--copies"),
        (["optimize", "{folder}", "--beta", "2"], 2, "beta must be"),
        (["report", "{folder}"], 1, "run `python -m vqa_state optimize`"),
        (["export", "{folder}", "x.json"], 1, "run `python -m vqa_state optimize`"),
        (["label", "{folder}", "no-such", "--state", "open"], 1, "no image is named 'no-such'"),
        (["add", "{folder}", "no-such"], 1, "check the path"),
        (["add", "{folder}", "{folder}", "--state", "ajar"], 1, "'ajar' is no state"),
        (["new", "{folder}", "--name", "x"], 1, "holds a project already"),
        (["grid", "{folder}", "--wording", "water | in sink"], 1, "must hold {article} once"),
        (["recognize", "none.json", "x.png"], 1, "check the path"),
        (["grid", "{folder}", "--off", "No such question?"], 2, "there is no question"),
        (["label", "{folder}", "--state", "open"], 2, "need the names or ids"),
    ],
)
def test_mistakes_end_in_a_sentence(run, folder, arguments, code, sentence):
    given = [argument.replace("{folder}", str(folder)) for argument in arguments]
    ended, _, err = run(*given)
    assert ended == code
    assert sentence in " ".join(err.split())
    assert "Traceback" not in err


def test_every_command_has_help():
    for name in [
        "new",
        "add",
        "label",
        "grid",
        "ask",
        "optimize",
        "assess",
        "tune",
        "report",
        "export",
        "recognize",
    ]:
        shown = runner.invoke(cli.app, [name, "--help"])
        assert shown.exit_code == 0
        assert "Usage:" in shown.output
