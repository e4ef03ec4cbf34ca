"""Folders and ZIP files: labels by their folders, nothing written elsewhere, nothing unbounded."""

import io
import os
import random
import struct
import tracemalloc
import warnings
import zipfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pictures import picture

from vqa_state.errors import ImageError, ProjectError
from vqa_state.images import reading
from vqa_state.project import importing
from vqa_state.project.importing import add_files, add_folder, add_zip
from vqa_state.project.project import Project, StateNames
from vqa_state.project.split import Split


@pytest.fixture
def empty(tmp_path):
    return Project.create(tmp_path / "home" / "p", "door", StateNames("open", "not open"))


def zipped(*entries, compression=zipfile.ZIP_DEFLATED):
    """The bytes of a ZIP of (name, content) entries."""
    out = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", compression) as archive:
        warnings.simplefilter("ignore")  # two entries may have one name
        for name, content in entries:
            archive.writestr(zipfile.ZipInfo(name), content, compression)
    return out.getvalue()


def write(folder, files):
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder


def outcome(project, report):
    """Names, labels and splits of the added images."""
    added = (project.images[image_id] for image_id in report.added)
    return {image.name.rpartition("/")[2]: (image.label, image.split) for image in added}


TREE = {
    "open/1.png": picture(1),
    "not_open/2.jpg": picture(2, "JPEG"),
    "Not Open/deeper/3.png": picture(3),
    "4.png": picture(4),
    "test/OPEN/5.png": picture(5),
    "open/train/6.png": picture(6),
    "unused/7.png": picture(7),
    "open/not open/8.png": picture(8),
    "test/train/9.png": picture(9),
}
LABELLED = {
    "1.png": (1, None),
    "2.jpg": (-1, None),
    "3.png": (-1, None),
    "4.png": (None, None),
    "5.png": (1, Split.TEST),
    "6.png": (1, Split.TRAIN),
    "7.png": (None, Split.UNUSED),
    "8.png": (-1, None),
    "9.png": (None, Split.TRAIN),
}


def test_folders_give_labels_and_sides(tmp_path, empty):
    report = add_folder(empty, write(tmp_path / "pictures", TREE))
    assert outcome(empty, report) == LABELLED
    assert report.refused == report.already_there == ()
    assert report.sentence() == "9 added"


def test_a_zip_does_what_its_folder_does(empty):
    assert outcome(empty, add_zip(empty, zipped(*TREE.items()))) == LABELLED


def test_backslashes_of_old_zip_programs_are_folders(empty):
    data = zipped(("open\\test\\1.png", picture(1)))
    assert outcome(empty, add_zip(empty, data)) == {"1.png": (1, Split.TEST)}


def test_a_label_for_all_gives_way_to_a_folder(tmp_path, empty):
    report = add_folder(empty, write(tmp_path / "pictures", TREE), -1)
    labels = {name: label for name, (label, _) in outcome(empty, report).items()}
    assert labels == {name: label or -1 for name, (label, _) in LABELLED.items()}


def test_the_folder_itself_may_be_named_as_a_state(tmp_path, empty):
    report = add_folder(empty, write(tmp_path / "open", {"1.png": picture(1)}))
    assert outcome(empty, report) == {"1.png": (1, None)}


def test_one_file_may_be_given_as_a_folder(tmp_path, empty):
    path = write(tmp_path, {"1.png": picture(1)}) / "1.png"
    assert outcome(empty, add_folder(empty, path, 1)) == {"1.png": (1, None)}


def test_a_state_with_an_underscore_is_found(tmp_path):
    project = Project.create(tmp_path / "p", "tap", StateNames("is_running", "off"))
    data = zipped(("is_running/1.png", picture(1)))
    assert outcome(project, add_zip(project, data)) == {"1.png": (1, None)}


def test_files_by_name_and_content(empty):
    archive = zipped(("open/2.png", picture(2)), ("3.png", picture(3)))
    report = add_files(empty, [("1.png", picture(1)), ("not open/more.zip", archive)], 1)
    assert outcome(empty, report) == {"1.png": (1, None), "2.png": (1, None), "3.png": (-1, None)}
    report = add_files(empty, [("not open/more", zipped(("4.png", picture(4))))])
    assert outcome(empty, report) == {"4.png": (-1, None)}


def test_a_zip_in_a_folder_is_opened_and_one_in_a_zip_is_not(tmp_path, empty):
    inner = zipped(("open/1.png", picture(1)), ("2.png", picture(2)))
    outer = zipped(("inner.zip", inner), ("3.png", picture(3)))
    folder = write(tmp_path / "pictures", {"not open/a.zip": inner, "b.zip": outer})
    report = add_folder(empty, folder)
    assert outcome(empty, report) == {
        "1.png": (1, None),
        "2.png": (-1, None),
        "3.png": (None, None),
    }
    assert [refused.name for refused in report.refused] == ["pictures/inner.zip"]


HIDDEN = ["__MACOSX/._1.png", "open/.hidden.png", ".git/1.png", "open/Thumbs.db", "desktop.ini"]


def test_what_systems_leave_behind_is_passed_over(tmp_path, empty):
    files = dict.fromkeys(HIDDEN, b"junk") | {"open/1.png": picture(1)}
    for report in (
        add_zip(empty, zipped(*files.items())),
        add_folder(empty, write(tmp_path / "pictures", files)),
    ):
        assert len(report.added) + len(report.already_there) == 1
        assert report.refused == ()


def test_bad_files_are_counted_and_named_and_end_nothing(tmp_path, empty):
    files = {"open/a.jpg": b"text", "open/b.gif": picture(1, "GIF"), "open/c.png": picture(2)}
    for report in (
        add_zip(empty, zipped(*files.items())),
        add_folder(empty, write(tmp_path / "pictures", files)),
        add_files(empty, files.items()),
    ):
        assert len(report.refused) == 2
        assert [refused.name.rpartition("/")[2] for refused in report.refused] == ["a.jpg", "b.gif"]
        assert "use JPEG, PNG" in report.refused[0].reason
        assert "2 refused, the first: " in report.sentence()
        assert len(empty.images) == 1


def test_the_same_bytes_are_told(empty):
    add_files(empty, [("1.png", picture(1))])
    report = add_files(empty, [("again.png", picture(1)), ("2.png", picture(2))])
    assert report.sentence() == "1 added; 1 already there (same bytes)"


def test_a_missing_folder_is_refused(tmp_path, empty):
    for path in (tmp_path / "none", tmp_path / ("n" * 5000)):
        with pytest.raises(ImageError, match=r"there is no file or folder .*check the path"):
            add_folder(empty, path)


def test_links_are_not_followed(tmp_path, empty):
    secret = write(tmp_path / "secret", {"1.png": picture(1)})
    folder = write(tmp_path / "pictures", {"2.png": picture(2)})
    (folder / "link.png").symlink_to(secret / "1.png")
    (folder / "links").symlink_to(secret)
    (folder / "loop").symlink_to(folder)
    (folder / "gone.png").symlink_to(tmp_path / "none")
    os.mkfifo(folder / "pipe.png")
    assert outcome(empty, add_folder(empty, folder)) == {"2.png": (None, None)}


def test_the_projects_own_folder_is_passed_over(project):
    n_before = len(project.images)
    folder = write(project.folder.parent, {"1.png": picture(1), "new.png": picture(70)})
    report = add_folder(project, folder)
    assert (len(report.added), len(report.already_there), report.refused) == (1, 1, ())
    assert len(project.images) == n_before + 1
    assert add_folder(project, project.folder).sentence() == "0 added"


def test_a_file_that_cannot_be_opened_is_refused_and_ends_nothing(tmp_path, empty, monkeypatch):
    folder = write(tmp_path / "pictures", {"1.png": picture(1), "2.png": picture(2)})
    opened = type(folder).open

    def refuse(path, *args):
        if path.name == "1.png":
            raise PermissionError(13, "Permission denied")
        return opened(path, *args)

    monkeypatch.setattr(type(folder), "open", refuse)
    report = add_folder(empty, folder)
    assert len(report.added) == 1
    assert report.refused[0].name == "pictures/1.png"
    assert report.refused[0].reason == "the file cannot be read (Permission denied)"


HOSTILE = [
    "../../evil.png",
    "/var/evil.png",
    "//evil.png",
    "C:\\evil.png",
    "..\\..\\evil.png",
    "a/../../../evil.png",
    "./evil.png",
    "~/evil.png",
    "con.png",
    "\u202egnp.evil.png",
    "new\nline.png",
    "n" * 1000 + ".png",
]


def test_hostile_names_are_only_names(tmp_path, empty, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = zipped(*((name, picture(number)) for number, name in enumerate(HOSTILE)))
    report = add_zip(empty, files)
    assert len(report.added) == len(HOSTILE)
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(written) == 2 * len(HOSTILE) + 1
    for path in written:
        assert path.parent in (empty.folder, empty.folder / "images", empty.folder / "thumbnails")
    assert all(image.name.isprintable() for image in empty.images.values())
    empty.save()
    assert Project.open(empty.folder) == empty


def test_a_file_name_that_is_no_text_can_be_shown(tmp_path, empty):
    folder = tmp_path / "pictures"
    folder.mkdir()
    with open(os.fsencode(folder) + b"/\xff\n.jpg", "wb") as file:  # noqa: PTH123
        file.write(b"text")
    report = add_folder(empty, folder)
    assert report.refused[0].name == "pictures/\ufffd\ufffd.jpg"
    report.sentence().encode()


def encrypted(data):
    """The same ZIP, every entry marked as encrypted."""
    changed = bytearray(data)
    for mark, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = changed.find(mark)
        while at >= 0:
            changed[at + flags] |= 1
            at = changed.find(mark, at + 4)
    return bytes(changed)


def test_a_password_is_told(empty):
    report = add_zip(empty, encrypted(zipped(("1.png", picture(1)))))
    assert report.added == ()
    assert report.refused[0].name == "1.png"
    assert "cannot be unpacked" in report.refused[0].reason
    assert "password" in report.refused[0].reason


def test_an_entry_without_a_name_ends_nothing(empty):
    data = zipped(("x.png", picture(1)), ("2.png", picture(2)))
    at = data.rindex(b"x.png")  # the name in the list at the ZIP's end
    report = add_zip(empty, data[:at] + b"\0" + data[at + 1 :])
    assert outcome(empty, report) == {"2.png": (None, None)}


@pytest.mark.parametrize("cut", [0, 3, 4, 10, 60, -1, -30])
def test_a_damaged_zip_is_told(empty, cut):
    data = zipped(("1.png", picture(1)), ("2.png", picture(2)))[:cut]
    report = add_files(empty, [("my pictures.zip", data)])
    assert report.added == ()
    assert report.refused[0].name == "my pictures.zip"


@pytest.mark.parametrize(
    "compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]
)
def test_one_damaged_entry_ends_nothing(empty, compression):
    first = random.Random(0).randbytes(500)
    data = bytearray(zipped(("1.png", first), ("2.png", picture(2)), compression=compression))
    for place in range(45, 300):
        data[place] = 255
    report = add_zip(empty, bytes(data))
    assert outcome(empty, report) == {"2.png": (None, None)}
    assert [refused.name for refused in report.refused] == ["1.png"]


ZIPS = [
    zipped(("open/1.png", picture(1)), ("2.png", picture(2)), compression=kind)
    for kind in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
]


@pytest.mark.filterwarnings("ignore")
@settings(max_examples=150)
@given(
    data=st.sampled_from(ZIPS),
    changes=st.lists(st.tuples(st.integers(0, 2**13), st.integers(0, 255)), max_size=8),
)
def test_mutated_zips_end_nothing(tmp_path_factory, data, changes):
    folder = tmp_path_factory.mktemp("zips")
    project = Project.create(folder / "p", "door", StateNames("open", "closed"))
    mutated = bytearray(data)
    for place, value in changes:
        mutated[place % len(mutated) if place % 2 else -(place % 200) - 1] = value
    report = add_zip(project, bytes(mutated))
    assert len(report.added) <= 2
    assert {path.name for path in folder.iterdir()} == {"p"}


def test_a_bomb_is_read_up_to_the_limit_only(empty, monkeypatch):
    monkeypatch.setattr(importing, "MAX_BYTES", 100_000)
    monkeypatch.setattr(reading, "MAX_BYTES", 100_000)
    bomb = zipped(("bomb.png", bytes(50_000_000)), ("1.png", picture(1)))
    assert len(bomb) < 60_000
    tracemalloc.start()
    try:
        report = add_zip(empty, bomb)
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()
    assert outcome(empty, report) == {"1.png": (None, None)}
    assert [refused.name for refused in report.refused] == ["bomb.png"]
    assert "more than 0 MB" in report.refused[0].reason


def test_a_lying_size_does_not_help_a_bomb(empty, monkeypatch):
    monkeypatch.setattr(importing, "MAX_BYTES", 100_000)
    monkeypatch.setattr(reading, "MAX_BYTES", 100_000)
    content = bytes(50_000_000)
    data = zipped(("bomb.png", content))
    for lie in (10, 2**32 - 2):
        lying = data.replace(struct.pack("<I", len(content)), struct.pack("<I", lie))
        assert lying != data
        report = add_zip(empty, lying)
        assert report.added == ()
        assert [refused.name for refused in report.refused] == ["bomb.png"]


def test_a_bomb_of_many_entries_is_left(empty, monkeypatch):
    monkeypatch.setattr(importing, "MAX_TOTAL_BYTES", 3_000_000)
    bomb = zipped(*((f"{number}.png", bytes(1_000_000)) for number in range(10)))
    report = add_files(empty, [("many.zip", bomb), ("1.png", picture(1))])
    assert len(report.added) == 1
    assert len(report.refused) == 5
    assert report.refused[-1].name == "many.zip"
    assert "the rest was not read: split it" in report.refused[-1].reason


def test_too_many_entries_are_left(empty, monkeypatch):
    monkeypatch.setattr(importing, "MAX_ENTRIES", 2)
    report = add_zip(empty, zipped(*((f"{n}.png", picture(n)) for n in range(4))))
    assert len(report.added) == 2
    assert "more than 2 files" in report.refused[-1].reason


def test_a_file_over_the_limit_is_not_read_whole(tmp_path, empty, monkeypatch):
    monkeypatch.setattr(importing, "MAX_BYTES", 100_000)
    monkeypatch.setattr(reading, "MAX_BYTES", 100_000)
    big = tmp_path / "big.png"
    with big.open("wb") as file:
        file.truncate(10**12)  # a hole: it takes no space on the disk
    report = add_folder(empty, big)
    assert report.added == ()
    assert "more than 0 MB" in report.refused[0].reason


def test_a_full_disk_ends_the_import_with_a_sentence(empty, monkeypatch):
    def no_space(*_):
        raise ProjectError("cannot write x (No space left on device)")

    monkeypatch.setattr(Project, "add", no_space)
    with pytest.raises(ProjectError, match="No space left"):
        add_files(empty, [("1.png", picture(1))])
