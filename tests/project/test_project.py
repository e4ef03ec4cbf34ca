"""A project on disk: what is saved is read again, and damage is told, not guessed around."""

import errno
import json
import os
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pictures import picture

from vqa_state.errors import ProjectError, QuestionError
from vqa_state.images.augmentation import Augmentation, AugmentationKind
from vqa_state.project.project import Project, StateNames
from vqa_state.project.split import Split
from vqa_state.questions.grid import Question, QuestionGrid, Wording, phrases_for
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.storage import atomic_write

STATES = StateNames("open", "closed")


@pytest.fixture
def empty(tmp_path):
    return Project.create(tmp_path / "p", "door", STATES)


def change_file(project, change):
    """Apply `change` to the content of project.json and write it back."""
    path = project.folder / "project.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def test_what_is_saved_is_read(project):
    project.name = "the kitchen's door"
    project.grid = QuestionGrid(
        (Wording("water", "in {article} sink"), Wording("Tür")),
        phrases_for("running"),
        custom=(Question("Would a cat get wet?", 1),),
        switched_off=("Is Tür running?",),
    )
    project.augmentation = Augmentation(AugmentationKind.GAUSSIAN_NOISE, 0.05, 3)
    project.model, project.fingerprint = "scripted", "scripted/1"
    project.seed, project.search_seed, project.test_looks = 3, 2**32 - 1, 4
    project.search = SearchSettings(population=10, generations=0, bit_flip=0.125)
    project.weights = ObjectiveWeights(1.5, 0.25)
    project.chosen = Objective.S_PRIME_MINUS
    project.save()
    assert Project.open(project.folder) == project


def test_a_new_project_has_the_papers_settings(empty):
    read = Project.open(empty.folder)
    assert read == empty
    assert read.images == {}
    assert read.augmentation == Augmentation()
    assert read.search == SearchSettings(1000, 200, 0.5, 0.2, 0.05, 5)
    assert (read.weights, read.chosen) == (ObjectiveWeights(100, 0.1), Objective.S_PLUS)
    assert read.fingerprint is None


def test_saving_again_gives_the_same_bytes(project):
    path = project.folder / "project.json"
    before = path.read_bytes()
    project.save()
    Project.open(project.folder).save()
    assert path.read_bytes() == before
    assert before.endswith(b"}\n")


def test_the_folder_is_what_a_person_can_read(project):
    names = sorted(path.name for path in project.folder.iterdir())
    assert names == ["images", "project.json", "thumbnails"]
    image = next(iter(project.images.values()))
    assert (project.folder / "images" / f"{image.id}.png").read_bytes() == picture(0)


def test_a_folder_is_not_taken_twice(empty):
    with pytest.raises(ProjectError, match="holds a project already; open it or name another"):
        Project.create(empty.folder, "other", STATES)
    assert Project.open(empty.folder).name == "door"


def test_a_place_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(ProjectError, match=r"cannot write .* nothing was changed"):
        Project.create(tmp_path / "file", "door", STATES)


def test_no_project_is_told(tmp_path):
    with pytest.raises(ProjectError, match=r"none holds no project .*vqa_state new"):
        Project.open(tmp_path / "none")


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"null", b"\xff\xfe", b'{"name": "door"}'])
def test_a_damaged_file_is_named(empty, content):
    (empty.folder / "project.json").write_bytes(content)
    with pytest.raises(ProjectError, match=r"project\.json is damaged at .*backup"):
        Project.open(empty.folder)


def test_a_file_cut_anywhere_is_refused(project):
    path = project.folder / "project.json"
    data = path.read_bytes()
    for length in range(0, len(data) - 2, 97):
        path.write_bytes(data[:length])
        with pytest.raises(ProjectError, match=r"project\.json is damaged"):
            Project.open(project.folder)


def test_a_newer_file_is_refused(empty):
    change_file(empty, lambda content: content.update(schema_version=2))
    with pytest.raises(ProjectError, match=r"json has schema version 2; .* up to 1: update"):
        Project.open(empty.folder)


def image_of(content):
    return content["images"][0]


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c.update(surprise=1),
        lambda c: c["states"].update(surprise=1),
        lambda c: image_of(c).update(surprise=1),
        lambda c: c["grid"].update(surprise=1),
        lambda c: c["augmentation"].update(surprise=1),
        lambda c: c.pop("seed"),
        lambda c: c.update(seed=-1),
        lambda c: c.update(seed=2**32),
        lambda c: c.update(chosen="best"),
        lambda c: c["search"].update(population=1),
        lambda c: c["augmentation"].update(amount=2.0),
        lambda c: c["augmentation"].update(n_copies=10**9),
        lambda c: c["weights"].update(alpha=-1),
        lambda c: image_of(c).update(id="../../etc/passwd"),
        lambda c: image_of(c).update(id="A" * 64),
        lambda c: image_of(c).update(id="a" * 64 + "\n"),
        lambda c: image_of(c).update(suffix="png/../../x"),
        lambda c: image_of(c).update(suffix="html"),
        lambda c: image_of(c).update(label=2),
        lambda c: image_of(c).update(split="exam"),
        lambda c: image_of(c).update(looks="zz"),
        lambda c: image_of(c).update(name="n" * 201),
    ],
)
def test_a_field_that_does_not_fit_is_refused(project, change):
    change_file(project, change)
    with pytest.raises(ProjectError, match=r"project\.json is damaged at \w+.*backup"):
        Project.open(project.folder)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda c: c["grid"].update(wordings=[{"noun": " "}]), "a wording is empty"),
        (lambda c: c["grid"]["phrases"][0].update(yes_means=0), "must mean the positive"),
        (lambda c: c.update(states={"positive": "on", "negative": "ON"}), "two different names"),
    ],
)
def test_a_rule_that_the_file_breaks_is_told_with_its_name(project, change, sentence):
    change_file(project, change)
    with pytest.raises(ProjectError, match=rf"project\.json cannot be used: .*{sentence}"):
        Project.open(project.folder)


def test_a_field_that_cannot_be_saved_is_refused(empty):
    before = (empty.folder / "project.json").read_bytes()
    empty.seed = -1
    with pytest.raises(ProjectError, match=r"not saved: seed cannot be -1 .*give another value"):
        empty.save()
    assert (empty.folder / "project.json").read_bytes() == before


def test_a_change_by_another_program_is_not_overwritten(project):
    other = Project.open(project.folder)
    other.name = "other"
    other.save()
    assert project.changed_elsewhere()
    project.name = "mine"
    with pytest.raises(ProjectError, match="changed by another program since it was opened; open"):
        project.save()
    assert Project.open(project.folder).name == "other"
    other.save()


def test_states_need_two_names():
    with pytest.raises(ProjectError, match="both states are called 'Open'"):
        StateNames("Open", " open ")
    with pytest.raises(QuestionError, match="the second state's name is empty"):
        StateNames("open", " ")


def test_a_state_is_found_by_its_name():
    names = StateNames("geöffnet", "not  open")
    assert names.label("GEÖFFNET") == 1
    assert names.label("geo\u0308ffnet") == 1
    assert names.label(" Not open ") == -1
    assert names.label("door") is None
    assert (names.of(1), names.of(-1)) == ("geöffnet", "not open")


def test_a_project_needs_a_name(tmp_path):
    with pytest.raises(QuestionError, match="the project's name is empty"):
        Project.create(tmp_path / "p", "  ", STATES)
    assert not (tmp_path / "p" / "project.json").exists()


def test_questions_are_those_of_the_grid(empty, project):
    assert len(project.questions()) == 16
    with pytest.raises(ProjectError, match="'door' has no questions; give at least one wording"):
        empty.questions()


def no_space(*_args, **_kwargs):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("broken", ["os.fsync", "Path.open", "Path.replace"])
def test_a_full_disk_leaves_the_old_files(project, monkeypatch, broken):
    before = {p: p.read_bytes() for p in project.folder.rglob("*") if p.is_file()}
    images = dict(project.images)
    where, name = broken.split(".")
    real = getattr(getattr(atomic_write, where), name)

    def fails_to_write(*args, **kwargs):
        """Reading goes on; only what `write_atomically` does finds no space."""
        reads = broken == "Path.open" and "xb" not in (*args, *kwargs.values())
        return real(*args, **kwargs) if reads else no_space()

    monkeypatch.setattr(getattr(atomic_write, where), name, fails_to_write)
    project.name = "new name"
    with pytest.raises(ProjectError, match=r"No space left.*nothing was changed: check free disk"):
        project.save()
    with pytest.raises(ProjectError, match="No space left"):
        project.add(picture(50), "new.png", 1)
    monkeypatch.undo()
    after = {p: p.read_bytes() for p in project.folder.rglob("*") if p.is_file()}
    assert after == before
    assert project.images == images
    project.save()
    assert Project.open(project.folder).name == "new name"


def test_files_can_be_read_by_others(project):
    assert (project.folder / "project.json").stat().st_mode & 0o777 == 0o644


def test_saving_what_stands_there_writes_nothing(project, monkeypatch):
    monkeypatch.setattr(atomic_write.Path, "replace", no_space)
    project.save()


names = st.text(min_size=1, max_size=40).filter(lambda t: any(c.isalnum() for c in t))


@given(names, names)
def test_any_two_state_names_survive_or_are_refused_with_a_sentence(positive, negative):
    try:
        states = StateNames(positive, negative)
    except (ProjectError, QuestionError):
        return
    assert states.label(states.positive) == 1
    assert states.label(states.negative) == -1
    assert states.label(positive.upper().lower()) in (1, None)


def test_frozen_parts_can_be_kept_while_the_project_changes(project):
    kept = project.labelled(Split.TRAIN)
    project.set_labels([kept[0].id], None)
    assert kept[0].label is not None
    with pytest.raises(AttributeError):
        kept[0].label = 1
    assert replace(kept[0], label=1).label == 1
