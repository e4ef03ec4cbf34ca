"""What the words of a command stand for: which image, which folder; and what counts as a look."""

import hashlib
import json
from dataclasses import replace

import pytest
from pictures import picture

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.cli.picking import chosen_images
from vqa_state.errors import ProjectError
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.search.genetic import SearchSettings
from vqa_state.testing.fake_model import ScriptedModel


def by_pixels(image, question):
    return Answer(
        ("yes", "no")[hashlib.sha256(image.tobytes() + question.encode()).digest()[0] % 2]
    )


# ---- which image ---------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["", "0", "a", "ab", "abc", "nothing.png"])
def test_a_word_that_stands_for_no_image_changes_none(run, project, word):
    before = (project.folder / "project.json").read_bytes()
    code, _, err = run("label", project.folder, word, "--state", "open")
    assert code == 1
    assert f"no image is named {word!r}" in " ".join(err.split())
    assert (project.folder / "project.json").read_bytes() == before


def test_too_few_letters_of_an_id_are_refused_even_if_one_image_fits(project):
    for image_id in project.images:
        assert chosen_images(project, [image_id[:10]]) == [image_id]
        assert chosen_images(project, [image_id]) == [image_id]
        with pytest.raises(ProjectError, match="at least 4 letters"):
            chosen_images(project, [image_id[:3]])


def test_letters_that_fit_two_ids_are_refused(project):
    one, other = list(project.images)[:2]
    twin = one[:8] + other[8:]
    project.images[twin] = replace(project.images[other], id=twin, name="twin")
    with pytest.raises(ProjectError, match=f"stands for 2 images .*{one[:12]}.*{twin[:12]}"):
        chosen_images(project, [one[:8]])
    assert chosen_images(project, [one[:9], twin[:9]]) == [one, twin]


def test_a_name_goes_before_an_id(project):
    one, other = list(project.images)[:2]
    renamed = project.add(picture(77), other[:6]).image.id
    assert chosen_images(project, [other[:6]]) == [renamed]
    assert chosen_images(project, [other[:7], one[:7], one]) == [other, one]


def test_a_name_of_two_images_is_refused_with_their_ids(project):
    ids = [project.add(picture(number), "same.png").image.id for number in (77, 78)]
    with pytest.raises(ProjectError, match=f"2 images .*{ids[0][:12]} same.png, {ids[1][:12]}"):
        chosen_images(project, ["same.png"])


# ---- which folder --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ["new", "", "--name", "x"],
        ["label", ""],
        ["add", "{project}", ""],
        ["reproduce", "--out", ""],
        ["report", "{project}", "--csv", ""],
        ["export", "{project}", ""],
    ],
)
def test_an_empty_path_is_not_the_current_folder(run, project, tmp_path, monkeypatch, arguments):
    here = tmp_path / "here"
    here.mkdir()
    (here / "photo.png").write_bytes(picture(50))
    monkeypatch.chdir(here)
    code, _, err = run(*(word.format(project=project.folder) for word in arguments))
    assert code == 2
    assert "a path is empty" in " ".join(err.split())
    assert [path.name for path in here.iterdir()] == ["photo.png"]
    assert len(Project.open(project.folder).images) == len(project.images)


def test_a_dot_is_the_current_folder(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("new", ".", "--name", "door")[0] == 0
    assert (tmp_path / "project.json").exists()


# ---- looks at the test images --------------------------------------------------------------


@pytest.fixture
def searched(run, make_project, registry):
    """Factory: a project that was asked and searched, with or without test images."""

    def make(n_test):
        models.register("scripted", lambda: ScriptedModel(by_pixels))
        project = make_project(n_train=3, n_test=n_test)
        project.search = SearchSettings(population=20, generations=3)
        project.save()
        assert run("ask", project.folder, "--model", "scripted")[0] == 0
        assert run("optimize", project.folder, "--engine", "paper")[0] == 0
        return project.folder

    return make


def test_without_a_test_image_no_look_is_told_or_counted(run, tmp_path, searched):
    folder = searched(0)
    _, out, _ = run("report", folder)
    assert "looked at" not in out
    assert json.loads(run("report", folder, "--json")[1])["test_looks"] == 0
    run("export", folder, tmp_path / "r.json")
    assert run("recheck", folder, tmp_path / "r.json", "--model", "scripted")[0] == 0
    assert Project.open(folder).test_looks == 0


def test_with_test_images_each_look_is_told_and_counted(run, tmp_path, searched):
    folder = searched(1)
    _, out, _ = run("report", folder)
    assert "The test results were looked at 2 times." in out
    assert json.loads(run("report", folder, "--json")[1])["test_looks"] == 3
    run("export", folder, tmp_path / "r.json")
    assert run("recheck", folder, tmp_path / "r.json", "--model", "scripted")[0] == 0
    assert Project.open(folder).test_looks == 4
    assert len(Project.open(folder).labelled(Split.TEST)) == 2
