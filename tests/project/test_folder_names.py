"""What folders say of the pictures in them, and what is told where they say nothing."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pictures import picture
from project.test_importing import empty, outcome, write, zipped

from vqa_state.errors import ProjectError
from vqa_state.project.folder_names import folder_label, why_no_label
from vqa_state.project.importing import add_files, add_folder, add_zip
from vqa_state.project.project import StateNames

__all__ = ["empty"]  # a fixture

STATES = StateNames("geöffnet", "nicht offen")


@pytest.mark.parametrize("form", ["NFC", "NFD"])
@pytest.mark.parametrize(
    ("folder", "label"),
    [
        ("geöffnet", 1), ("GEÖFFNET", 1), (" Geöffnet ", 1), ("geoffnet", None), ("offen", None),
        ("nicht offen", -1), ("Nicht_Offen", -1), ("nicht-offen", -1), ("NICHT  OFFEN", -1),
        ("nicht_-_offen", None), ("_nicht_offen", -1), ("nichtoffen", None),
        ("nicht\u2011offen", -1),
    ],
)  # fmt: skip
def test_a_folder_is_a_state_in_any_case_accent_and_space(form, folder, label):
    name = unicodedata.normalize(form, folder)
    assert folder_label(f"photos/{name}/1.png", STATES) == label
    turned = StateNames(unicodedata.normalize("NFD", "geöffnet"), "nicht-offen")
    assert folder_label(f"photos/{name}/1.png", turned) == label


def test_what_tells_the_states_apart_is_never_passed_over():
    signs = StateNames("+1", "-1")
    assert [signs.label(name) for name in ("+1", "-1", "1", "_1")] == [1, -1, None, None]
    twins = StateNames("on-off", "on off")
    assert [twins.label(name) for name in ("on-off", "On Off", "on_off")] == [1, -1, None]


words = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1, max_size=9)


@given(words, words)
def test_a_state_is_found_by_its_own_name_however_it_is_written(positive, negative):
    try:
        states = StateNames(positive, negative)
    except ProjectError:  # one name for both
        return
    for label, name in ((1, states.positive), (-1, states.negative)):
        for form in ("NFC", "NFD"):
            written = unicodedata.normalize(form, name)
            assert states.label(written) == label
            assert states.label(f" {written} ") == label


@pytest.mark.parametrize(
    ("name", "folder", "reason"),
    [
        ("auf/1.png", "auf", "folder 'auf' is none of open, closed"),
        ("photos/auf/1.png", "photos/auf", "folder 'photos/auf' is none of open, closed"),
        ("train/auf/1.png", "train/auf", "folder 'train/auf' is none of open, closed"),
        ("1.png", "", "no folder names a state"),
        ("Test/1.png", "", "no folder names a state"),
        ("../1.png", "", "no folder names a state"),
        ("a\x1bb/1.png", "a\ufffdb", "folder 'a\ufffdb' is none of open, closed"),
    ],
)
def test_why_folders_give_no_label(name, folder, reason):
    assert why_no_label(name, StateNames("open", "closed")) == (folder, reason)


def test_a_folder_without_end_is_shortened():
    folder, reason = why_no_label(f"{'x' * 5000}/auf/1.png", StateNames("open", "closed"))
    assert folder.endswith("x/auf")
    assert folder.startswith("…")
    assert len(reason) < 150


FILES = {
    "open/1.png": picture(1),
    "auf/2.png": picture(2),
    "auf/3.png": picture(3),
    "4.png": picture(4),
    "zu/test/5.png": picture(5),
}


def test_what_got_no_label_is_told_by_folder(tmp_path, empty):
    report = add_zip(empty, zipped(*FILES.items()))
    assert [(one.name, one.reason) for one in report.unlabelled] == [
        ("auf/2.png", "folder 'auf' is none of open, not open"),
        ("auf/3.png", "folder 'auf' is none of open, not open"),
        ("4.png", "no folder names a state"),
        ("zu/test/5.png", "folder 'zu/test' is none of open, not open"),
    ]
    assert report.reasons()[0] == ("folder 'auf' is none of open, not open", 2)
    assert report.sentence() == (
        "5 added; 4 without a label, the most: folder 'auf' is none of open, not open"
    )
    images = [empty.images[one.image_id] for one in report.unlabelled]
    assert [image.name for image in images] == ["auf/2.png", "auf/3.png", "4.png", "zu/test/5.png"]
    assert all(image.label is None for image in images)
    again = add_folder(empty, write(tmp_path / "open", {"2.png": FILES["auf/2.png"]}))
    assert again.sentence() == "0 added; 1 already there (same bytes)"  # and labelled by now
    again = add_folder(empty, write(tmp_path / "more", {"3.png": FILES["auf/3.png"]}))
    assert again.sentence() == (
        "0 added; 1 already there (same bytes); 1 without a label: folder 'more' is none of open, "
        "not open"
    )


def test_a_label_for_all_leaves_none_without(empty):
    assert add_files(empty, FILES.items(), -1).unlabelled == ()


def test_an_image_is_told_once_and_not_if_a_later_file_labels_it(empty):
    one, other = picture(1), picture(2)
    files = [("a.png", one), ("b/a.png", one), ("b.png", other), ("open/b.png", other)]
    report = add_files(empty, files)
    assert [image.name for image in empty.images.values()] == ["a.png", "b.png"]
    assert [(u.name, u.reason) for u in report.unlabelled] == [
        ("b/a.png", "folder 'b' is none of open, not open")
    ]
    assert outcome(empty, report)["b.png"] == (1, None)
