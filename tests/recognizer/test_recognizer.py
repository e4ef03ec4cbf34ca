"""The file: same choice, same bytes; damage, newer versions and unknown fields are refused."""

import hashlib
import io
import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_recognizers import QUESTIONS, recognizer, saying
from pictures import draw, encode
from PIL import Image
from pydantic import ValidationError

from vqa_state.answers.answer import Answer
from vqa_state.errors import ImageError, ModelError, RecognizerError
from vqa_state.models import Failure
from vqa_state.recognizer.recognizer import (
    Recognizer,
    WeightedQuestion,
    read_recognizer,
)
from vqa_state.recognizer.schema import content_digest
from vqa_state.recognizer.verdict import Vote
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.votes.rules import VoteKind
from vqa_state.votes.state import State


def test_round_trip_gives_the_same_bytes(tmp_path):
    one = recognizer()
    one.save(tmp_path / "r.json")
    again = Recognizer.load(tmp_path / "r.json")
    assert again.to_bytes() == one.to_bytes() == (tmp_path / "r.json").read_bytes()


@pytest.mark.parametrize(
    ("said", "state", "n_positive", "n_negative", "n_invalid"),
    [
        (("yes", "no", "yes"), State.POSITIVE, 6, 0, 0),
        (("no", "yes", "yes"), State.NEGATIVE, 2, 4, 0),
        (("yes", "yes", "none"), State.UNKNOWN, 2, 2, 2),  # a tie
        (("none", "door", "open"), State.UNKNOWN, 0, 0, 6),  # no answer
        (("yes", "none", "none"), State.POSITIVE, 2, 0, 4),  # invalid answers do not vote
    ],
)
def test_verdict(said, state, n_positive, n_negative, n_invalid):
    model = saying(a=said[0], b=said[1], c=said[2])
    verdict = recognizer().recognize(draw(1), model)
    assert verdict.state is state
    counted = (verdict.n_positive, verdict.n_negative, verdict.n_invalid)
    assert counted == (n_positive, n_negative, n_invalid)
    assert verdict.n_calls == len(verdict.votes) == 6
    assert verdict.reason


def test_weights_and_threshold_decide():
    questions = (
        WeightedQuestion(text=QUESTIONS[0], yes_means=1, weight=5),
        WeightedQuestion(text=QUESTIONS[1], yes_means=-1),
        WeightedQuestion(text=QUESTIONS[2], yes_means=1),
    )
    model = saying(a="yes", b="yes", c="no")
    weighted = {"questions": questions, "vote": VoteKind.WEIGHTED_ANSWERS}
    assert recognizer(**weighted).recognize(draw(1), model).state is State.POSITIVE
    strict = recognizer(**weighted, threshold=0.9)
    assert strict.recognize(draw(1), model).state is State.NEGATIVE


@given(st.lists(st.sampled_from([-1, 0, 1]), min_size=6, max_size=6))
def test_paper_vote_is_a_majority_of_integers(said):
    places = [(copy, text) for copy in range(2) for text in QUESTIONS]
    votes = [
        Vote(text, copy, Answer("x"), one) for (copy, text), one in zip(places, said, strict=True)
    ]
    expected = {1: State.POSITIVE, -1: State.NEGATIVE, 0: State.UNKNOWN}
    balance = sum(said)
    assert recognizer().verdict(votes).state is expected[(balance > 0) - (balance < 0)]


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "LA", "L", "P", "I;16", "1"])
def test_path_bytes_and_picture_give_the_same_votes(tmp_path, mode):
    seen = []

    def script(image, _):
        seen.append(image.tobytes())
        return Answer("yes")

    drawn = draw(4).convert("L" if mode == "I;16" else mode)
    if mode == "I;16":
        drawn = Image.fromarray(np.asarray(drawn, np.uint16) * 257)
    if "A" in mode:
        drawn.putalpha(Image.linear_gradient("L").resize(drawn.size))
    data = encode(drawn)
    (tmp_path / "picture.png").write_bytes(data)
    opened = Image.open(io.BytesIO(data))
    assert opened.mode == mode
    for form in (tmp_path / "picture.png", str(tmp_path / "picture.png"), data, opened):
        recognizer().recognize(form, ScriptedModel(script))
    shown = [seen[start : start + 6] for start in range(0, 24, 6)]
    assert shown[1:] == shown[:-1]


def test_a_device_is_no_picture():
    with pytest.raises(ImageError, match="is no file"):
        recognizer().recognize("/dev/zero", saying(a="yes", b="no", c="yes"))


def test_grey_frame_is_read():
    model = saying(a="yes", b="no", c="yes")
    assert recognizer().recognize(Image.new("L", (1, 1)), model).state is State.POSITIVE


def test_failed_call_is_an_error_never_a_verdict():
    model = ScriptedModel(lambda _, q: Failure("timed out") if q == QUESTIONS[1] else Answer("yes"))
    with pytest.raises(ModelError, match=r"2 of 6 calls to scripted failed \(timed out\)"):
        recognizer().recognize(draw(1), model)


def test_another_model_is_refused():
    model = ScriptedModel(lambda *_: Answer("yes"), fingerprint="scripted/2")
    with pytest.raises(RecognizerError, match=r"are for 'scripted/1'.*optimize"):
        recognizer().recognize(draw(1), model)


def test_model_is_loaded_by_name_and_kept(registry):
    made = []

    def factory():
        made.append(saying(a="yes", b="no", c="yes"))
        return made[-1]

    registry["scripted"] = factory
    one = recognizer()
    one.recognize(draw(1))
    one.recognize(draw(2))
    assert len(made) == 1


def test_unreadable_picture(tmp_path):
    with pytest.raises(ImageError, match="check the path"):
        recognizer().recognize(tmp_path / "none.png", saying(a="yes", b="no", c="yes"))


def changed(**changes) -> bytes:
    """A file with other content whose digest does not know of it."""
    return json.dumps(json.loads(recognizer().to_bytes()) | changes).encode()


UPSIDE_DOWN = {"share": 0.5, "low": 0.6, "high": 0.9, "n_images": 9, "n_resamples": 3}


def with_weight(weight) -> bytes:
    content = json.loads(recognizer().to_bytes())
    content["questions"][0]["weight"] = weight
    return json.dumps(content).encode()


def with_score(**fields) -> bytes:
    content = json.loads(recognizer().to_bytes())
    content["scores"]["train"] |= fields
    return json.dumps(content).encode()


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"", "is no JSON file or is damaged"),
        (b"[" * 100_000, "is no JSON file or is damaged"),
        (b"\xff\xfe", "is no JSON file or is damaged"),
        (b"[]", "is no recognizer file"),
        (b'{"schema_version": "1"}', "is no recognizer file"),
        (changed(schema_version=0), "is no recognizer file"),
        (changed(schema_version=5), "schema version 5; this program reads up to 4"),
        (changed(calls_per_image=6, vote="threshold"), "digest does not fit"),
        (changed(name="other"), "digest does not fit"),
        (changed(surprise=1), "cannot be used at surprise"),
        (changed(threshold=1.5), "cannot be used at threshold"),
        (changed(questions=[]), "cannot be used at questions"),
        (changed(calls_per_image=7), "calls_per_image must be copies × questions = 6"),
        (changed(states={"positive": "\x1b[2Jopen", "negative": "closed"}), "control characters"),
        (changed(states={"positive": "Unknown", "negative": "closed"}), "word for no verdict"),
        (changed(states={"positive": "open", "negative": "OPEN"}), "two different names"),
        (changed(name="   "), "is empty"),
        (changed(vote="paper", threshold=0.3), "has the threshold 0.5"),
        (with_weight(7), "every question the weight 1"),
        (with_score(n_recognized=-1), "greater than or equal to 0"),
        (with_score(n_recognized=11), "11 of 10 images"),
        (with_score(n_images=0), "greater than or equal to 1"),
        (
            changed(estimate=UPSIDE_DOWN),
            "is not from",
        ),
        (changed(parser_version=99), "cannot be used at parser_version"),
        (b" " * 6_000_000, "has more than 5 MB"),
    ],
)
def test_bad_files_are_refused_with_a_sentence(data, sentence):
    with pytest.raises(RecognizerError, match=sentence):
        read_recognizer(data, "r.json")


def test_questions_are_asked_as_a_project_asks_them():
    """Else answers to them would never be found in a store."""
    assert WeightedQuestion(text=" Is  the door\topen?", yes_means=1).text == "Is the door open?"
    with pytest.raises(ValidationError, match="control characters"):
        WeightedQuestion(text="Is it\x00 open?", yes_means=1)
    with pytest.raises(ValidationError, match="is empty"):
        WeightedQuestion(text="   ", yes_means=1)


def test_missing_file(tmp_path):
    with pytest.raises(RecognizerError, match="check the path"):
        Recognizer.load(tmp_path / "none.json")


def test_every_changed_character_is_found():
    data = recognizer().to_bytes()
    for position in range(0, len(data) - 70, 7):
        if chr(data[position]).isalnum():
            other = b"0" if data[position : position + 1] != b"0" else b"1"
            with pytest.raises(RecognizerError):
                read_recognizer(data[:position] + other + data[position + 1 :], "r.json")


def test_loading_needs_neither_gradio_nor_a_search_library(tmp_path):
    recognizer().save(tmp_path / "r.json")
    code = (
        "import sys\nfrom vqa_state.recognizer.recognizer import Recognizer\n"
        f"Recognizer.load({str(tmp_path / 'r.json')!r})\n"
        "print({'gradio', 'deap', 'torch', 'pandas'} & set(sys.modules))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "set()"


def test_files_of_version_2_are_read_and_written_anew():
    content = json.loads(recognizer().to_bytes()) | {"schema_version": 2}
    content["digest"] = content_digest(content)
    old = read_recognizer(json.dumps(content).encode(), "r.json")
    assert old.to_bytes() == recognizer().to_bytes()


def test_questions_that_nothing_chose_have_no_origin():
    unchosen = recognizer(origin=None)
    assert read_recognizer(unchosen.to_bytes(), "r.json").origin is None
    assert json.loads(unchosen.to_bytes())["origin"] is None
    model = saying(a="yes", b="no", c="no")
    assert unchosen.recognize(draw(1), model).votes == recognizer().recognize(draw(1), model).votes


def version_1(**changes) -> bytes:
    """A file as the first version wrote it."""
    content = json.loads(recognizer().to_bytes())
    for field in ("vote", "estimate", "digest"):
        del content[field]
    del content["origin"]["proof"]
    content |= {"schema_version": 1, "abstain": "tie"} | changes
    for question in content["questions"]:
        question["weight"] = 1.0
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    digest = hashlib.sha256(canonical.encode()).hexdigest()
    return json.dumps(content | {"digest": digest}).encode()


def test_files_of_version_1_are_read_and_written_anew():
    old = read_recognizer(version_1(), "r.json")
    assert (old.schema_version, old.vote, old.abstain.min_sureness) == (3, VoteKind.PAPER, 0)
    model = saying(a="yes", b="no", c="no")
    assert old.recognize(draw(1), model).state is State.POSITIVE
    assert read_recognizer(old.to_bytes(), "r.json").to_bytes() == old.to_bytes()
    with pytest.raises(RecognizerError, match="digest does not fit"):
        read_recognizer(version_1().replace(b'"door"', b'"gate"'), "r.json")


@pytest.mark.parametrize(
    "changes",
    [
        {"vote": "threshold", "threshold": 0.1234567},  # six digits are written
        {"vote": "majority"},
        {"abstain": {"min_sureness": 2}},
    ],
)
def test_votes_that_no_program_writes_are_refused(changes):
    with pytest.raises(RecognizerError, match="cannot be used at"):
        read_recognizer(changed(**changes), "r.json")
