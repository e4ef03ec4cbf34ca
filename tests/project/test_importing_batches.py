"""A few pictures at a time: saved and set free in between, like the whole; none too small."""

from contextlib import contextmanager
from itertools import pairwise

import pytest
from pictures import draw, encode, picture
from project.test_importing import HIDDEN, HOSTILE, TREE, empty, zipped

from vqa_state.project import importing
from vqa_state.project.importing import add_files, add_folder, add_zip, added_in_batches, in_turn
from vqa_state.project.project import Project

__all__ = ["empty"]  # a fixture


class Shelf:
    """Opens a project for a batch, saves it after, and knows whether somebody has it now."""

    def __init__(self, folder):
        self.folder, self.held, self.n_opened = folder, False, 0

    @contextmanager
    def opened(self):
        self.held, self.n_opened = True, self.n_opened + 1
        try:
            project = Project.open(self.folder)
            yield project
            project.save()
        finally:
            self.held = False


def test_batches_do_what_the_whole_zip_does(tmp_path, empty, monkeypatch):
    monkeypatch.setattr(importing, "_BATCH_FILES", 4)
    entries = [*TREE.items(), ("bad.png", b"text"), ("open/again.png", picture(1))]
    twin = Project.create(tmp_path / "twin", "door", empty.states)
    whole = add_zip(twin, zipped(*entries))
    shelf = Shelf(empty.folder)
    batches = []
    for batch in added_in_batches(shelf.opened, "all.zip", zipped(*entries)):
        assert not shelf.held  # others may have the project now
        known = Project.open(empty.folder).images
        assert all(known[image.id] == image for image in batch.added)  # it is saved
        batches.append(batch)
    assert [batch.n_done for batch in batches] == [4, 8, 11]
    assert {batch.n_files for batch in batches} == {11}
    assert shelf.n_opened == 3
    assert Project.open(empty.folder).images == twin.images
    assert [image.id for batch in batches for image in batch.added] == list(whole.added)
    assert [one.image.id for batch in batches for one in batch.known] == list(whole.already_there)
    assert [one.name for batch in batches for one in batch.known] == ["open/again.png"]
    assert [one for batch in batches for one in batch.refused] == list(whole.refused)


def test_slow_pictures_make_small_batches(empty, monkeypatch):
    monkeypatch.setattr(importing, "_BATCH_SECONDS", 0)
    files = zipped(*((f"{n}.png", picture(n)) for n in range(3)))
    batches = added_in_batches(Shelf(empty.folder).opened, "all.zip", files)
    assert [(batch.n_done, batch.n_files) for batch in batches] == [(1, 3), (2, 3), (3, 3)]


def test_an_import_that_is_left_keeps_its_batches(empty, monkeypatch):
    monkeypatch.setattr(importing, "_BATCH_FILES", 2)
    files = zipped(*((f"{n}.png", picture(n)) for n in range(6)))
    batches = added_in_batches(Shelf(empty.folder).opened, "all.zip", files)
    next(batches), next(batches)
    batches.close()
    assert len(Project.open(empty.folder).images) == 4
    assert add_zip(Project.open(empty.folder), files).sentence() == (
        "2 added; 4 already there (same bytes); 6 without a label: no folder names a state"
    )


@pytest.mark.parametrize(
    "name", [*TREE, *HIDDEN, *HOSTILE, "open\\test\\1.png", "/open/1.png", "../open/1.png"]
)
def test_a_name_with_folders_means_what_it_means_in_a_zip(tmp_path, empty, name):
    twin = Project.create(tmp_path / "home" / "twin", "door", empty.states)
    add_zip(twin, zipped((name, picture(1))))
    list(added_in_batches(Shelf(empty.folder).opened, name, picture(1)))
    if name != "desktop.ini":  # alone, a hidden file was meant
        assert Project.open(empty.folder).images == twin.images
    assert {path.name for path in tmp_path.iterdir()} == {"home"}
    assert {path.name for path in (tmp_path / "home").iterdir()} == {"p", "twin"}


@pytest.mark.parametrize("size", [(1, 1), (15, 400), (400, 15)])
def test_a_picture_too_small_to_see_a_state_in_is_refused_with_its_size(empty, size):
    data = encode(draw(1, size))
    reports = add_files(empty, [("1.png", data)]), add_zip(empty, zipped(("1.png", data)))
    for report in reports:
        assert f"{size[0]} × {size[1]} pixels" in report.refused[0].reason
        assert "at least 16 on each side: add it in its full size" in report.refused[0].reason
    assert empty.images == {}


def test_the_smallest_picture_is_taken_and_an_old_smaller_one_is_known(empty):
    assert len(add_files(empty, [("1.png", encode(draw(1, (16, 16))))]).added) == 1
    tiny = encode(draw(2, (9, 9)))
    empty.add(tiny, "old.png")
    assert len(add_files(empty, [("old.png", tiny)]).already_there) == 1


def test_a_killed_add_loses_its_last_batch_at_most(tmp_path, empty, monkeypatch):
    folder = tmp_path / "photos"
    folder.mkdir()
    for number in range(20):
        (folder / f"{number:02}.png").write_bytes(picture(number))
    n_saved = []

    def seen(project):
        n_saved.append(len(Project.open(empty.folder).images))
        return in_turn(project)

    add_folder(empty, folder, opened=lambda: seen(empty))
    assert n_saved[0] == 0
    assert all(1 <= now - before <= 8 for before, now in pairwise(n_saved))
    assert len(Project.open(empty.folder).images) == 20
