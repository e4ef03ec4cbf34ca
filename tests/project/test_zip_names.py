"""Names in ZIP files that do not tell their code page: the states choose it, or nothing does."""

import io
import struct
import unicodedata
import zipfile
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pictures import picture
from project.test_importing import outcome

from vqa_state.project.importing import add_zip
from vqa_state.project.project import Project, StateNames
from vqa_state.project.zip_names import PAGES, code_page


def packed(*entries, extra=b""):
    """A ZIP of (name as bytes, content) entries, without the flag for UTF-8."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        stand_ins = [f"{n:#<{len(name)}}" for n, (name, _) in enumerate(entries)]
        for stand_in, (_, content) in zip(stand_ins, entries, strict=True):
            entry = zipfile.ZipInfo(stand_in)
            entry.extra = extra
            archive.writestr(entry, content)
    data = out.getvalue()
    for stand_in, (name, _) in zip(stand_ins, entries, strict=True):
        assert data.count(stand_in.encode()) == 2
        data = data.replace(stand_in.encode(), name)
    return data


def made(tmp_path, *states):
    return Project.create(tmp_path / "p", "door", StateNames(*states))


WRITTEN = [  # as machines of these countries pack them
    ("geöffnet", "geschlossen", "cp850"),
    ("geöffnet", "geschlossen", "cp437"),
    ("geöffnet", "geschlossen", "cp1252"),
    ("geöffnet", "geschlossen", "utf-8"),
    ("fermé", "ouvert", "cp850"),
    ("otevřeno", "zavřeno", "cp852"),
    ("otevřeno", "zavřeno", "cp1250"),
    ("zamknięte", "otwarte", "cp852"),
    ("開いている", "閉じている", "cp932"),
    ("ソファ表", "能", "cp932"),  # with a backslash as the second byte
    ("打开", "关闭", "gbk"),
    ("開啟", "關閉", "big5"),
    ("열림", "닫힘", "euc-kr"),
    ("открыто", "закрыто", "cp866"),
    ("открыто", "закрыто", "cp1251"),
    ("ανοιχτό", "κλειστό", "cp737"),
    ("açık", "kapalı", "cp857"),
    ("açık", "kapalı", "cp1254"),
    ("เปิด", "ปิด", "cp874"),
]


@pytest.mark.parametrize(("positive", "negative", "page"), WRITTEN)
def test_the_states_find_the_page_of_their_folders(tmp_path, positive, negative, page):
    project = made(tmp_path, positive, negative)
    report = add_zip(
        project,
        packed(
            (f"{positive}/1.png".encode(page), picture(1)),
            (f"Fotos/{negative}/2.png".encode(page), picture(2)),
        ),
    )
    assert outcome(project, report) == {"1.png": (1, None), "2.png": (-1, None)}
    assert [image.name for image in project.images.values()] == [
        f"{positive}/1.png",
        f"Fotos/{negative}/2.png",
    ]
    assert report.unlabelled == ()


def test_mac_names_of_two_characters_a_letter_are_found(tmp_path):
    project = made(tmp_path, "geöffnet", "geschlossen")
    name = unicodedata.normalize("NFD", "Geöffnet/ä.png")
    assert name != unicodedata.normalize("NFC", name)
    report = add_zip(project, packed((name.encode(), picture(1))))
    assert outcome(project, report)[name[len("Geöffnet/") + 1 :]] == (1, None)


def test_names_of_one_archive_have_one_page(tmp_path):
    """The folder of one picture tells in which page the others' names are."""
    project = made(tmp_path, "geöffnet", "geschlossen")
    files = ("geöffnet/1.png", "Küche/geschlossen/2.png", "geschlossen/Tür.png", "Õ/3.png")
    add_zip(project, packed(*((f.encode("cp1252"), picture(n)) for n, f in enumerate(files))))
    assert [image.name for image in project.images.values()] == list(files)


@pytest.mark.parametrize(
    ("page", "read"), [("utf-8", "Küche"), ("cp437", "Küche"), ("cp1252", "Kⁿche")]
)
def test_where_no_folder_tells_it_is_utf_8_or_what_zip_says(tmp_path, page, read):
    project = made(tmp_path, "open", "closed")
    files = ("open/1.png", "Küche/2.png")
    add_zip(project, packed(*((f.encode(page), picture(n)) for n, f in enumerate(files))))
    assert [image.name for image in project.images.values()] == ["open/1.png", f"{read}/2.png"]


def test_a_unicode_path_beside_the_name_is_the_name_if_it_is_meant_for_it(tmp_path):
    name = b"ge?ffnet\xff/1.png"
    for number, (checksum, label) in enumerate(((zlib.crc32(name), 1), (1, None))):
        project = made(tmp_path / str(number), "geöffnet", "geschlossen")
        field = struct.pack("<BI", 1, checksum) + "geöffnet/1.png".encode()
        extra = (
            struct.pack("<HH", 0x5455, 1) + b"x" + struct.pack("<HH", 0x7075, len(field)) + field
        )
        report = add_zip(project, packed((name, picture(1)), extra=extra))
        assert outcome(project, report) == {"1.png": (label, None)}


def test_flagged_names_are_utf_8_whatever_the_others_are(tmp_path):
    project = made(tmp_path, "geöffnet", "geschlossen")
    out = io.BytesIO(packed(("geöffnet/1.png".encode("cp850"), picture(1))))
    with zipfile.ZipFile(out, "a") as archive:
        archive.writestr("geöffnet/2.png", picture(2))
    report = add_zip(project, out.getvalue())
    assert outcome(project, report) == {"1.png": (1, None), "2.png": (1, None)}


@given(st.lists(st.binary(max_size=30), min_size=1, max_size=8))
def test_any_bytes_have_a_page_that_reads_all_of_them(names):
    page = code_page(names, StateNames("geöffnet", "geschlossen"))
    assert page in PAGES
    assert [name.decode(page) for name in names]


@given(st.sampled_from(WRITTEN), st.lists(st.sampled_from(["/1.png", "/test/2.png"]), min_size=1))
def test_the_page_that_is_found_reads_the_states(written, files):
    positive, negative, page = written
    names = [f"{state}{file}" for state in (positive, negative) for file in files]
    found = code_page([name.encode(page) for name in names], StateNames(positive, negative))
    assert [name.encode(page).decode(found) for name in names] == names
