"""The examples of the API's pages and of the notebook run, and print what they say."""

import json
import re
from pathlib import Path

import nbformat
import pytest

from vqa_state.project.project import Project
from vqa_state.project.split import Split

ROOT = Path(__file__).parent.parent
INDEX = ROOT / "docs" / "api.md"
PAGES = sorted((ROOT / "docs" / "api").glob("*.md"))
NOTEBOOK = ROOT / "examples" / "notebook.ipynb"

#: No public API of their own: two thin faces, what only this program writes, and what made a model.
WITHOUT_PAGE = {"cli", "web", "storage", "embedded_training"}


def blocks(page):
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def code_cells():
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with photos, in which the notebook was run."""
    home = tmp_path_factory.mktemp("notebook")
    sample = Project.open(ROOT / "projects" / "refrigerator")
    photos = sample.labelled(Split.TRAIN)
    for label in (1, -1):
        of_state = home / "photos" / sample.states.of(label)
        of_state.mkdir(parents=True)
        for image in [one for one in photos if one.label == label][:4]:
            (of_state / f"{image.id}.jpg").write_bytes(sample.read(image))
    (home / "photo.jpg").write_bytes(sample.read(sample.labelled(Split.TEST)[0]))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        names = {}
        for cell in code_cells():
            exec(cell, names)
    assert names["recognizer"].questions
    return home


def test_the_notebook_makes_a_project(folder):
    project = Project.open(folder / "my_fridge")
    assert len(project.images) == 8
    assert project.fingerprint


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_pages_examples_print_what_their_comments_say(page, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    names = {}
    assert blocks(page)
    for block in blocks(page):
        expected = re.findall(r"^ *print\(.*\)  # (.+)$", block, re.MULTILINE)
        assert len(expected) == len(re.findall(r"^ *print\(", block, re.MULTILINE))
        exec(block, names)
        assert capsys.readouterr().out.splitlines() == expected


def test_the_index_and_the_notebook_are_one_road():
    (road,) = blocks(INDEX)
    lines = [line for line in road.splitlines() if line.strip()]
    assert lines == [line for cell in code_cells() for line in cell.splitlines() if line.strip()]


def test_the_notebook_is_one_and_holds_no_outputs_or_paths_of_a_machine():
    nbformat.validate(nbformat.read(NOTEBOOK, as_version=4))
    content = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    assert not any(cell.get("outputs") for cell in content["cells"])
    assert not re.search(r"/(home|Users|tmp|root)/", NOTEBOOK.read_text(encoding="utf-8"))


def test_every_package_has_a_page_and_the_index_names_it():
    packages = {path.parent.name for path in (ROOT / "vqa_state").glob("*/__init__.py")}
    assert {page.stem for page in PAGES} == packages - WITHOUT_PAGE | {"errors"}
    assert all(f"`docs/api/{page.stem}.md`" in INDEX.read_text() for page in PAGES)
