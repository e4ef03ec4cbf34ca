"""Answers that the length limit ends before yes or no: kept, counted apart, and not asked again."""

import json
import re
import sqlite3
from dataclasses import replace

import pytest
from asked_models import N_CALLS, finish
from made_recognizers import QUESTIONS, recognizer
from server_cases import IMAGES, answers, model_of, only_bad, outcomes
from stub_server import Result, Stub, completion

from vqa_state import models
from vqa_state.answers import store
from vqa_state.answers.answer import CUT_OFF, Answer, Reading
from vqa_state.answers.store import AnswerStore, CopyKey
from vqa_state.errors import ModelError, StoreError
from vqa_state.models import Failure
from vqa_state.models.address import ModelAddress
from vqa_state.models.length_limit import FIELD, cut_off_words, max_tokens_of, with_max_tokens
from vqa_state.models.server.model import ServerModel
from vqa_state.models.vision_check import Sight
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.report.frames import heatmap, image_answers, question_frame
from vqa_state.report.page import _heatmap
from vqa_state.study.collect import answer_table, plan
from vqa_state.study.vision_check import check_model
from vqa_state.testing.fake_model import ScriptedModel

BEGUN = Answer("Looking at the image, the door", at_limit=True)
KEY = CopyKey("ab" * 32, "rgb-shift", 0.1, 0, 0)


@pytest.mark.parametrize(
    ("text", "at_limit", "reading", "cut_off"),
    [
        ("The door in this picture is", True, Reading.INVALID, True),
        ("", True, Reading.INVALID, True),
        ("<think>The door", True, Reading.INVALID, True),
        ("Yes, the door is", True, Reading.YES, False),
        ("No, the light in the", True, Reading.NO, False),
        ("The door in this picture is", False, Reading.INVALID, False),
    ],
)
def test_only_what_ended_before_yes_or_no_is_cut_off(text, at_limit, reading, cut_off):
    answer = Answer(text, at_limit=at_limit)
    assert (answer.reading, answer.cut_off) == (reading, cut_off)


# The store


def old_store(path):
    """A store of version 1, as the program of then wrote it."""
    db = sqlite3.connect(path)
    db.executescript(store._MIGRATIONS[0])
    db.executescript(
        "INSERT INTO model VALUES (1, 'm'); INSERT INTO question VALUES (1, 'Open?');"
        "INSERT INTO answer VALUES (1, 1, 1, 'yes', 0.75); PRAGMA user_version = 1;"
    )
    values = (KEY.pixel_hash, KEY.kind, KEY.amount, KEY.seed, KEY.number)
    db.execute("INSERT INTO copy VALUES (1, ?, ?, ?, ?, ?)", values)
    db.commit()
    db.close()


def test_an_old_store_is_upgraded_in_place_and_keeps_its_answers(tmp_path):
    path = tmp_path / "answers.sqlite"
    old_store(path)
    with AnswerStore(path) as one, AnswerStore(path) as other:
        assert one.answers("m", KEY, ["Open?"]) == {"Open?": Answer("yes", 0.75)}
        other.save("m", [(KEY, "Closed?", BEGUN)])
        assert one.answers("m", KEY, ["Closed?"]) == {"Closed?": BEGUN}
    with sqlite3.connect(path) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (2,)
        assert db.execute("SELECT finish FROM answer").fetchall() == [(None,), ("length",)]
    db.close()


def test_an_upgrade_that_breaks_off_leaves_the_old_store(tmp_path, monkeypatch):
    path = tmp_path / "answers.sqlite"
    old_store(path)
    whole = store._MIGRATIONS
    monkeypatch.setattr(store, "_MIGRATIONS", (whole[0], whole[1] + "; SELECT broken"))
    with pytest.raises(StoreError):
        AnswerStore(path)
    monkeypatch.setattr(store, "_MIGRATIONS", whole)
    with AnswerStore(path) as again:
        assert again.answers("m", KEY, ["Open?"]) == {"Open?": Answer("yes", 0.75)}


def test_an_end_that_cannot_be_is_damage(tmp_path):
    with AnswerStore(tmp_path / "a.sqlite") as opened:
        opened.save("m", [(KEY, "Open?", BEGUN)])
        opened._db.execute("UPDATE answer SET finish = 'lunch'")
        with pytest.raises(StoreError, match=r"damaged .*ended by 'lunch'"):
            opened.answers("m", KEY, ["Open?"])


# Asking


def model_that_rambles(fingerprint="scripted/1"):
    """It answers all but the questions that begin with "Does"."""
    return ScriptedModel(
        lambda _, question: BEGUN if question.startswith("Does") else Answer("yes"),
        fingerprint=fingerprint,
    )


def test_a_cut_off_answer_is_bought_once_until_a_setting_changes(project):
    model = model_that_rambles()
    report = finish(project, model)
    assert (report.n_asked, report.n_failed, report.n_cut_off) == (N_CALLS, 0, N_CALLS // 2)
    model.asked.clear()
    again = finish(project, model)
    assert (again.n_asked, again.n_cut_off, model.asked) == (0, N_CALLS // 2, [])
    costs = plan(project, model.fingerprint)
    assert (costs.n_to_ask, costs.n_cut_off) == (0, N_CALLS // 2)
    assert finish(project, model_that_rambles("scripted/1; 64 tokens")).n_asked == N_CALLS


def test_it_is_invalid_makes_no_image_incomplete_and_is_shown_apart(project):
    finish(project, model_that_rambles())
    project.fingerprint = "scripted/1"
    table = answer_table(project, Split.TRAIN)
    assert table.complete.all()
    rambled = [question.text.startswith("Does") for question in table.questions]
    assert (table.verdicts[:, :, rambled] == 0).all()
    assert (table.cut_off == (table.verdicts == 0)).all()
    frame = heatmap(project)
    assert frame["cut_off"].tolist() == [float(one) for one in rambled] == frame["invalid"].tolist()
    assert "cut off" in _heatmap(frame)
    clear = question_frame(replace(table, verdicts=abs(table.verdicts), cut_off=None))
    assert "cut off" not in _heatmap(clear)
    image = table.image_ids[0]
    said = image_answers(project, image, {table.questions[n].text for n in range(16)})
    assert [one.cut_off for one in said] == [one.text == BEGUN.text for one in said]


def test_a_table_marks_invalid_answers_only(project):
    finish(project, model_that_rambles())
    project.fingerprint = "scripted/1"
    table = answer_table(project, Split.TRAIN)
    with pytest.raises(ValueError, match="mark invalid answers only"):
        replace(table, cut_off=table.verdicts == 1)


# Models


@pytest.mark.parametrize(
    ("text", "reason", "answer"),
    [
        ("", "length", Answer("", at_limit=True)),
        (None, "length", Answer("", at_limit=True)),
        ("", "MAX_TOKENS", Answer("", at_limit=True)),
        ("The door", "length", Answer("The door", at_limit=True)),
        ("Yes, the door is", "length", Answer("Yes, the door is", at_limit=True)),
        ("It is.", "stop", Answer("It is.")),
        ("It is.", None, Answer("It is.")),
        ("It is.", ["length"], Answer("It is.")),
    ],
)
def test_a_server_says_why_an_answer_ended(stub, text, reason, answer):
    stub.script = only_bad(answers(completion(text, finish_reason=reason)))
    assert outcomes(model_of(stub))[0, "bad"] == answer
    assert len(stub.calls) == 2  # it is no failure, so nothing is tried again


def test_a_refusal_is_no_cut_off_answer(stub):
    body = completion("", finish_reason="length")
    body["choices"][0]["message"]["refusal"] = "not this image"
    stub.script = only_bad(answers(body))
    assert isinstance(outcomes(model_of(stub))[0, "bad"], Failure)


def test_a_server_is_asked_for_as_many_tokens_as_the_address_says(stub, data_home):
    long = "<think>" + "so " * 3000 + "</think>Yes"
    stub.script = lambda call, _: Result(completion(long if call.body["max_tokens"] > 9 else "x"))
    name = f"server:{stub.url}?max_tokens=1000#m"
    models.choose(name)
    model = models.create(name)
    (reply,) = model.answer(IMAGES, ["Open?"])
    assert (stub.calls[-1].body["max_tokens"], reply.outcome.reading) == (1000, Reading.YES)
    usual = ServerModel(stub.url, "m", "x")
    assert "temperature 0, 8 tokens;" in usual.fingerprint
    assert model.fingerprint == usual.fingerprint.replace("8 tokens", "1000 tokens")


@pytest.mark.parametrize("text", ["0", "4097", "-1", "8.5", "", "many", "９"])
def test_a_length_that_is_none_is_refused_with_the_rule(text):
    with pytest.raises(ModelError, match=r"max_tokens, must be a whole number from 1 to 4096, got"):
        ModelAddress.parse(f"folder:/m?max_tokens={text}")


def test_the_length_is_kept_in_the_address_and_its_default_is_not():
    name = "server:http://127.0.0.1:8000/v1?prompt=%7Bquestion%7D"
    longer = with_max_tokens(f"{name}#m", 64)
    assert longer == f"{name}&max_tokens=64#m"
    assert max_tokens_of(longer) == 64
    assert with_max_tokens(longer, 8) == f"{name}#m"
    assert max_tokens_of("embedded") == 8
    assert with_max_tokens("embedded", 8) == "embedded"
    with pytest.raises(ModelError, match="of chat models and servers; the model 'embedded' has"):
        with_max_tokens("embedded", 9)


def test_the_message_names_the_setting_and_its_value():
    words = cut_off_words(3, "folder:/m?max_tokens=24")
    assert words.startswith(f"{CUT_OFF}: 3, for the length limit ended them before yes or no; ")
    assert f"raise --max-tokens (in the app: “{FIELD}”), 24 now" in words


def test_a_check_of_a_model_that_thinks_says_what_to_do_and_is_not_remembered(data_home):
    model = ScriptedModel(lambda *_: Answer("", at_limit=True), name="thinks")
    for _ in range(2):
        *_, last = check_model(model)
        found = last.result
        assert (found.sight, found.n_failed, found.n_cut_off) == (Sight.SILENT, 0, found.n_calls)
        assert found.warns
        assert re.search(r"no answer: .*raise --max-tokens .*, 8 now", found.sentence)


def test_a_model_that_sees_is_told_apart_by_its_whole_answers(data_home):
    def script(image, question):
        if question.startswith("Does"):
            return Answer("The", at_limit=True)
        return Answer("yes" if image.getpixel((128, 128))[0] % 2 else "no")

    *_, last = check_model(ScriptedModel(script, name="half", fingerprint="half/1"))
    assert last.result.n_cut_off == 12
    assert "No clear answer (cut off): 12" in last.result.sentence


# Recognizing


def test_a_verdict_counts_cut_off_answers_as_invalid_and_apart():
    one = recognizer()
    said = {
        (copy, text): BEGUN if text == QUESTIONS[2] else Answer("yes" if copy else "no")
        for copy in range(2)
        for text in QUESTIONS
    }
    verdict = one.verdict(one.votes(said))
    assert (verdict.n_invalid, verdict.n_cut_off) == (2, 2)
    plain = {key: replace(answer, at_limit=False) for key, answer in said.items()}
    other = one.verdict(one.votes(plain))
    assert (other.n_invalid, other.n_cut_off) == (2, 0)
    assert (other.state, other.confidence) == (verdict.state, verdict.confidence)


def test_a_recognizer_of_older_rules_of_reading_is_used_and_says_so():
    assert recognizer().caution == ""
    old = recognizer(parser_version=1)
    assert "parser_version 1" in old.caution
    assert "export it again" in old.caution


# The command line


def test_the_command_line_sets_the_length_keeps_it_and_names_it(run, tmp_path, make_project):
    project = make_project("door", n_train=2, n_test=0)
    with Stub(lambda call, _: Result(thought(call.body["max_tokens"]))) as stub:
        address = f"server:{stub.url}#m"
        code, out, _ = run("ask", project.folder, "--model", address)
        assert code == 0
        assert "; no clear answer (cut off): 128, " in out
        assert "--max-tokens" in out
        assert "8 now" in out
        _, out, _ = run("ask", project.folder, "--json")
        assert json.loads(out)["n_cut_off"] == 128
        n_before = len(stub.calls)
        _, out, _ = run("ask", project.folder, "--max-tokens", 64)
        assert "cut off" not in out
        assert len(stub.calls) > n_before
        assert Project.open(project.folder).model == f"server:{stub.url}?max_tokens=64#m"
        code, out, _ = run("models", "check", address, "--max-tokens", 32, "--json")
        assert json.loads(out)["n_cut_off"] == 0
        assert {call.body["max_tokens"] for call in stub.calls} == {8, 32, 64}
    code, _, err = run("ask", project.folder, "--model", "embedded", "--max-tokens", 9)
    assert code == 1
    assert "has its own length of answers" in err
    assert run("ask", project.folder, "--max-tokens", 0)[0] == 2


def thought(max_tokens):
    """Of a model that thinks before it answers: nothing, if it has no words left."""
    return completion("", finish_reason="length") if max_tokens < 20 else completion("Yes")
