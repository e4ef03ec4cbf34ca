"""What the documents say is true: commands exist, paths exist, figures are right."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from scipy.stats import binomtest
from typer.testing import CliRunner

from vqa_state import cli
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.recognizer.recognizer import Recognizer

ROOT = Path(__file__).parent.parent.parent
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
README = (ROOT / "README.md").read_text()

commands = re.findall(r"python -m vqa_state ([^\n`]+)", "\n".join(d.read_text() for d in DOCUMENTS))


@pytest.mark.parametrize("line", sorted(set(commands)))
def test_commands_in_documents_parse(line):
    words = shlex.split(line)
    shown = CliRunner().invoke(cli.app, [words[0], "--help"])
    assert shown.exit_code == 0, line
    for option in (word for word in words if word.startswith("--")):
        assert option in shown.output, line


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda d: d.name)
def test_paths_in_documents_exist(document):
    quoted = re.findall(
        r"`([\w./-]+/[\w./-]*|[\w-]+\.(?:md|py|json|sh|txt))`", document.read_text()
    )
    generated = {"project.json", "searches/", "recognizers/", "app.py", "tables.md"}
    generated |= {"photos/open", "photos/closed"}  # of a reader's own
    for path in set(quoted) - generated:
        places = (ROOT / path, ROOT / "vqa_state" / path, document.parent / path)
        assert any(place.exists() for place in places), f"{document.name}: {path}"


def test_the_readmes_road_can_be_walked(tmp_path):
    """Its commands, word for word, on the sample's pictures and the embedded model."""
    sample = Project.open(ROOT / "projects" / "refrigerator")
    for image in sample.labelled(Split.TRAIN)[:8]:
        folder = tmp_path / "photos" / sample.states.of(image.label)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{image.id}.jpg").write_bytes(sample.read(image))
    (tmp_path / "photo.jpg").write_bytes(sample.read(sample.labelled(Split.TEST)[0]))
    block = next(b for b in re.findall(r"```sh\n(.*?)```", README, re.DOTALL) if "tune" in b)
    for line in block.splitlines():
        words = [sys.executable, *shlex.split(line)[1:]]
        env = os.environ | {"PYTHONPATH": str(ROOT)}
        done = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True)
        assert done.returncode == 0, f"{line}: {done.stderr}"
    assert "of the valid votes" in done.stdout


def test_the_readme_has_the_two_commands():
    assert ".venv/bin/pip install -r requirements.txt && .venv/bin/python app.py" in README
    assert "bash tests/run.sh" in (ROOT / ".ci" / "run").read_text()
    assert "bash tests/run.sh" in README


@pytest.mark.parametrize("page", ["README.md", "docs/trust.md"])
def test_what_twenty_of_twenty_proves(page):
    low = binomtest(20, 20).proportion_ci(0.95, "exact").low
    said = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    assert f"at least {low:.0%}".replace("%", " %") in said


def test_the_readme_is_short():
    assert len(README.split()) < 700


def test_the_readmes_notebook_runs(tmp_path):
    """Its lines, word for word, on the sample's pictures and the embedded model."""
    sample = Project.open(ROOT / "projects" / "refrigerator")
    for image in sample.labelled(Split.TRAIN)[:16]:
        folder = tmp_path / "photos" / sample.states.of(image.label)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{image.id}.jpg").write_bytes(sample.read(image))
    (tmp_path / "photo.jpg").write_bytes(sample.read(sample.labelled(Split.TEST)[0]))
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    (tmp_path / "notebook.py").write_text(code, encoding="utf-8")
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "notebook.py"], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "of the valid votes" in done.stdout or "the vote" in done.stdout


def test_the_index_names_every_page():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    pages = {f"`docs/{page.name}`" for page in (ROOT / "docs").glob("*.md")} - {"`docs/index.md`"}
    assert not [page for page in pages if page not in index]


def test_the_recognizer_schema_is_the_programs():
    path = ROOT / "docs" / "recognizer.schema.json"
    assert json.loads(path.read_text()) == Recognizer.model_json_schema(), (
        "the schema changed; write it again with: python -m tests.write_schema"
    )
