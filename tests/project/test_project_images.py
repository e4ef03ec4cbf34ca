"""Images of a project: adding, labelling, sides, removing, and files that are lost."""

from pathlib import Path

import pytest
from pictures import draw, encode, picture

from vqa_state.errors import ImageError, ProjectError
from vqa_state.project import project as project_module
from vqa_state.project.project import Project, StateNames
from vqa_state.project.split import Split

STATES = StateNames("open", "closed")


@pytest.fixture
def empty(tmp_path):
    return Project.create(tmp_path / "p", "door", STATES)


def test_the_same_bytes_are_the_same_image(empty):
    first = empty.add(picture(1), "a.png", 1)
    second = empty.add(picture(1), "b.png")
    assert (first.is_new, second.is_new) == (True, False)
    assert (second.image.name, second.image.label) == ("a.png", 1)
    assert len(empty.images) == 1


def test_the_same_bytes_never_change_their_label_unsaid(empty):
    unlabelled = empty.add(picture(1), "a.png").image
    assert empty.add(picture(1), "b.png", 1).image.label == 1
    with pytest.raises(ImageError, match=r"already, as 'open' \(a\.png\); .* by hand"):
        empty.add(picture(1), "c.png", -1)
    assert empty.images[unlabelled.id].label == 1


def test_a_link_among_the_thumbnails_is_never_followed(project, tmp_path):
    (tmp_path / "secret").write_text("secret")
    image_id = next(iter(project.images))
    link = project.folder / "thumbnails" / f"{image_id}.webp"
    link.unlink()
    link.symlink_to(tmp_path / "secret")
    assert project.thumbnail(image_id)[:4] == b"RIFF"
    assert (tmp_path / "secret").read_text() == "secret"


def test_the_same_pixels_in_another_file_are_another_image_that_looks_alike(empty):
    one = empty.add(picture(1), "a.png", 1).image
    other = empty.add(picture(1, "BMP"), "a.bmp", 1).image
    assert one.id != other.id
    assert one.pixel_hash == other.pixel_hash
    assert [set(group) for group in empty.look_alikes()] == [{one.id, other.id}]
    empty.add(picture(2), "b.png", 1)
    empty.assign_splits()
    assert empty.images[one.id].split is empty.images[other.id].split


def test_a_picture_that_cannot_be_read_leaves_nothing(empty):
    with pytest.raises(ImageError):
        empty.add(b"text", "a.jpg", 1)
    assert empty.images == {}
    assert not (empty.folder / "images").exists()


@pytest.mark.parametrize(
    "name", ["../../evil.png", "/etc/passwd", "a\x00b\n.png", "C:\\x", "\u202e", "", "n" * 999]
)
def test_a_name_is_shown_and_never_a_path(tmp_path, empty, name):
    before = {path for path in tmp_path.rglob("*") if path.is_dir()}
    image = empty.add(picture(1), name, 1).image
    assert 0 < len(image.name) <= 200
    assert image.name.isprintable()
    new = {path.relative_to(empty.folder) for path in empty.folder.rglob("*") if path.is_file()}
    assert new == {
        Path("project.json"),
        Path("images") / f"{image.id}.png",
        Path("thumbnails") / f"{image.id}.webp",
    }
    added = {path for path in tmp_path.rglob("*") if path.is_dir()} - before
    assert added == {empty.folder / "images", empty.folder / "thumbnails"}
    empty.save()
    assert Project.open(empty.folder) == empty


def test_a_full_project_is_told(empty, monkeypatch):
    monkeypatch.setattr(project_module, "MAX_IMAGES", 1)
    empty.add(picture(1), "a.png")
    empty.add(picture(1), "again.png")
    with pytest.raises(ImageError, match="has 1 images, the most"):
        empty.add(picture(2), "b.png")


def test_labels_can_be_given_and_taken(project):
    first, second, *_ = project.images
    project.set_labels([first, second], -1)
    assert project.images[first].label == project.images[second].label == -1
    assert project.images[first].split is Split.TRAIN
    project.set_labels([first], None)
    assert (project.images[first].label, project.images[first].split) == (None, None)
    project.set_splits([second], Split.UNUSED)
    project.set_labels([second], None)
    assert project.images[second].split is Split.UNUSED


@pytest.mark.parametrize("hostile", ["../x", "", "0" * 64, "x" * 9999])
def test_an_unknown_id_changes_nothing(project, hostile):
    known = next(iter(project.images))
    before = dict(project.images)
    for change in (
        lambda: project.set_labels([known, hostile], -1),
        lambda: project.set_splits([known, hostile], Split.TEST),
        lambda: project.remove([known, hostile]),
        lambda: project.thumbnail(hostile),
    ):
        with pytest.raises(ProjectError, match="the project has no image"):
            change()
    assert project.images == before
    assert project.image_path(project.images[known]).exists()


@pytest.mark.parametrize("label", [0, 2, "open", 1.5])
def test_another_label_is_refused(project, label):
    with pytest.raises(ProjectError, match=r"a label is \+1, -1 or none, got"):
        project.set_labels(list(project.images), label)


def test_labelled_images_come_in_one_order(project):
    ids = [image.id for image in project.labelled(Split.TRAIN, Split.TEST)]
    assert ids == sorted(project.images)
    assert len(project.labelled(Split.TEST)) == 2
    project.set_labels([ids[0]], None)
    assert len(project.labelled(Split.TRAIN, Split.TEST)) == 5


def test_sides_are_given_to_those_without_one(empty):
    for number in range(20):
        empty.add(picture(number), f"{number}.png", 1 if number < 10 else -1)
    last = empty.add(picture(20), "unlabelled.png").image
    unused = next(iter(empty.images))
    empty.set_splits([unused], Split.UNUSED)
    empty.assign_splits()
    train, test = empty.labelled(Split.TRAIN), empty.labelled(Split.TEST)
    assert (len(train), len(test)) == (10, 9)
    assert sum(image.label for image in train) == 0
    assert empty.images[last.id].split is None
    assert empty.images[unused].split is Split.UNUSED
    before = dict(empty.images)
    empty.seed = 1
    empty.assign_splits()
    assert empty.images == before
    empty.assign_splits(afresh=True)
    assert empty.images != before
    assert empty.images[unused].split is Split.UNUSED
    empty.assign_splits(train_share=0.8, afresh=True)
    assert len(empty.labelled(Split.TRAIN)) in (15, 16)


def test_removing_takes_the_files_along(project):
    first, second, *_ = project.images.values()
    project.remove([first.id, second.id, first.id])
    assert first.id not in project.images
    assert not project.image_path(first).exists()
    assert len(list((project.folder / "thumbnails").iterdir())) == 4
    project.save()
    assert Project.open(project.folder) == project
    project.add(picture(0), "back.png", 1)
    assert project.read(project.images[first.id]) == picture(0)


def test_a_lost_or_changed_file_is_told_and_mended_by_adding_it_again(project):
    image = next(iter(project.images.values()))
    path = project.image_path(image)
    path.write_bytes(picture(99))
    with pytest.raises(ImageError, match=r"the file of 0\.png has changed; add the picture again"):
        project.read(image)
    assert not project.add(picture(0), "again.png").is_new
    assert project.read(image) == picture(0)
    path.unlink()
    with pytest.raises(ImageError, match=r"the file of 0\.png is gone; add the picture again"):
        project.read(image)
    project.add(picture(0), "again.png")
    assert project.read(image) == picture(0)


def test_a_thumbnail_is_made_again(project):
    image_id = next(iter(project.images))
    before = project.thumbnail(image_id)
    for path in (project.folder / "thumbnails").iterdir():
        path.unlink()
    assert project.thumbnail(image_id) == before
    assert before[8:12] == b"WEBP"


def test_a_large_photo_is_kept_as_given(empty):
    data = encode(draw(1, (1200, 900)), "JPEG")
    image = empty.add(data, "photo.jpg", 1).image
    assert image.suffix == "jpg"
    assert empty.image_path(image).read_bytes() == data
