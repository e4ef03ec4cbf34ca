"""What killed programs left is removed at opening: theirs alone, and nothing that is in use."""

import shutil
import threading

import pytest
from pictures import picture

from vqa_state.project.leftovers import Journal
from vqa_state.project.project import Project, StateNames
from vqa_state.storage.locks import LOCK_NAME, locked

HASH = "ab" * 32


def files(project):
    return {path for path in project.folder.rglob("*") if path.is_file()}


def dead(project, *names):
    """The journal of a program that was killed."""
    journal = Journal(project.folder)
    journal.note(names)
    journal._lock.release()


def test_what_a_killed_writer_left_is_removed(project):
    before = files(project)
    (project.folder / "searches").mkdir()
    for place in (".", "searches", "images", "thumbnails"):
        (project.folder / place / f".writing-{HASH[:32]}").write_bytes(b"half of")
    for place in (f"images/{HASH}.png", f"thumbnails/{HASH}.webp", LOCK_NAME):
        (project.folder / place).write_bytes(b"left")
    dead(project, f"{HASH}.png")
    assert Project.open(project.folder) == project
    assert files(project) == before


def test_what_is_a_persons_stays(project):
    names = (
        "notes.txt", "images/notes.txt", f"images/{HASH}.png", "thumbnails/mine.webp",
        "searches/.writing-notes", ".unsaved-work", f"other/{HASH}.png", "other/.writing-00",
    )  # fmt: skip
    for name in names:
        (project.folder / name).parent.mkdir(exist_ok=True)
        (project.folder / name).write_bytes(b"a person's")
    Project.open(project.folder)
    assert all((project.folder / name).exists() for name in names)


def test_a_journal_never_leads_out_of_the_folder(project, tmp_path):
    (tmp_path / "secret").write_text("secret")
    dead(project, "../../secret", str(tmp_path / "secret"), "..", "")
    Project.open(project.folder)
    assert (tmp_path / "secret").exists()


def test_pictures_that_came_back_from_a_backup_stay(project):
    old = (project.folder / "project.json").read_bytes()
    image = project.add(picture(70), "later.png", 1).image
    project.save()
    (project.folder / "project.json").write_bytes(old)
    again = Project.open(project.folder)
    assert image.id not in again.images
    assert again.image_path(image).exists()


def test_a_living_program_keeps_its_pictures(project):
    image = project.add(picture(70), "new.png", 1).image
    other = Project.open(project.folder)
    assert image.id not in other.images
    other.name = "other"
    other.save()
    project.save()
    assert Project.open(project.folder).read(image) == picture(70)


def test_pictures_of_a_program_that_gave_up_are_removed(project):
    before = files(project)
    image = project.add(picture(70), "new.png", 1).image
    path = project.image_path(image)
    folder = project.folder
    project._journal._lock.release()  # as the system does for a dead process
    assert path.exists()
    Project.open(folder)
    assert {one for one in folder.rglob("*") if one.is_file()} == before


def test_killed_between_saving_and_removing_files(project, monkeypatch):
    image = next(iter(project.images.values()))
    project.remove([image.id])
    monkeypatch.setattr("vqa_state.project.project.remove_pictures", killed)
    with pytest.raises(KeyboardInterrupt):
        project.save()
    monkeypatch.undo()
    assert project.image_path(image).exists()
    project._journal._lock.release()
    again = Project.open(project.folder)
    assert image.id not in again.images
    assert not again.image_path(image).exists()


def killed(*_):
    raise KeyboardInterrupt


def test_killed_before_saving_a_removal_keeps_the_picture(project, monkeypatch):
    image = next(iter(project.images.values()))
    project.remove([image.id])
    monkeypatch.setattr("vqa_state.project.project.write_atomically", killed)
    with pytest.raises(KeyboardInterrupt):
        project.save()
    monkeypatch.undo()
    project._journal._lock.release()
    assert Project.open(project.folder).read(image) == picture(0)


def test_an_image_that_another_program_added_again_keeps_its_file(project):
    image = next(iter(project.images.values()))
    project.remove([image.id])
    project.add(picture(0), "back.png")
    project.save()
    assert Project.open(project.folder).read(image) == picture(0)


def test_nothing_is_removed_while_somebody_works(project):
    path = project.folder / "images" / ".writing-00"
    path.write_bytes(b"being written")
    with locked(project.folder):
        thread = threading.Thread(target=lambda: Project.open(project.folder))
        thread.start()
        thread.join()
        assert path.exists()
    Project.open(project.folder)
    assert not path.exists()


def test_a_project_that_was_killed_while_it_was_made_is_made_again(tmp_path):
    folder = tmp_path / "p"
    folder.mkdir()
    (folder / ".writing-0a").write_bytes(b"{")
    Project.create(folder, "door", StateNames("open", "closed"))
    assert [path.name for path in folder.iterdir()] == ["project.json"]


def test_a_copy_of_a_project_at_work_is_clean(project, tmp_path):
    project.add(picture(70), "new.png")
    shutil.copytree(project.folder, tmp_path / "copy")
    copy = Project.open(tmp_path / "copy")
    assert not list(copy.folder.glob(".*"))
    assert len(list((copy.folder / "images").iterdir())) == len(copy.images)
