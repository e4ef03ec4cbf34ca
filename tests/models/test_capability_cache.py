"""What this machine keeps of models: once written always found, and never believed if damaged."""

import json
from dataclasses import replace

import pytest

from vqa_state.models.capability_cache import KnownModel, known_as, known_model, remember
from vqa_state.models.vision_check import Sight

ONE = KnownModel("a name", "a/1", Sight.TELLS, 0.5, 0.25, 100, 7)


@pytest.fixture(autouse=True)
def file(data_home):
    """Where they are kept."""
    return data_home / "known_models.json"


def test_what_is_kept_is_found_by_fingerprint_and_by_name():
    assert known_model("a/1") is known_as("a name") is None
    remember(ONE)
    assert known_model("a/1") == known_as("a name") == ONE
    newer = replace(ONE, fingerprint="a/2", sight=Sight.BLIND)
    remember(newer)
    assert known_as("a name") == newer
    assert known_model("a/1") == ONE


def test_what_is_not_found_out_anew_stays_known():
    remember(ONE)
    remember(KnownModel("a name", "a/1", image=1.0, question=0.0))
    assert known_model("a/1") == replace(ONE, image=1.0, question=0.0)
    remember(KnownModel("another", "a/1", Sight.SEES))
    assert known_model("a/1") == replace(
        ONE, name="another", sight=Sight.SEES, image=1.0, question=0.0
    )


@pytest.mark.parametrize(
    "change",
    [
        {"sight": "clairvoyant"},
        {"sight": ["tells"]},
        {"image": "fast"},
        {"image": -1.0},
        {"image": float("nan")},
        {"question": None},
        {"megabytes": True},
        {"gpu_megabytes": -1},
        {"name": None},
        {"fingerprint": 3},
    ],
)
def test_a_damaged_record_is_not_believed(file, change):
    remember(ONE)
    remember(replace(ONE, fingerprint="a/2"))
    records = json.loads(file.read_text())
    records[0] |= change
    file.write_text(json.dumps(records))
    assert known_model("a/1") is None
    assert known_model("a/2") is not None


@pytest.mark.parametrize("content", ["", "{", "{}", "3", "[[]]", "[" * 100_000, "[null, 3]"])
def test_a_damaged_file_is_as_good_as_none(file, content):
    file.parent.mkdir()
    file.write_text(content)
    assert known_model("a/1") is None
    remember(ONE)
    assert known_model("a/1") == ONE


def test_a_place_that_cannot_be_written_ends_nothing(file):
    file.parent.write_text("a file where a folder should be")
    remember(ONE)
    assert known_model("a/1") is None


def test_the_file_stays_small(file):
    for number in range(205):
        remember(replace(ONE, fingerprint=f"a/{number}"))
    assert len(json.loads(file.read_text())) == 200
    assert known_model("a/4") is None
    assert known_model("a/5") is not None


def test_numbers_that_cannot_be_are_refused():
    for change in ({"image": None}, {"image": -1}, {"megabytes": -1}):
        with pytest.raises(ValueError, match=r"known together|no such number"):
            replace(ONE, **change)
