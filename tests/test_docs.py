"""What the documents say is true: commands exist, paths exist, figures are right."""

import json
import re
import shlex
from pathlib import Path

import pytest
from scipy.stats import binomtest
from typer.testing import CliRunner

from vqa_state import cli
from vqa_state.recognizer import Recognizer

ROOT = Path(__file__).parent.parent
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
    generated = {"project.json", "searches/", "recognizers/", "app.py"}
    for path in set(quoted) - generated:
        places = (ROOT / path, ROOT / "vqa_state" / path, document.parent / path)
        assert any(place.exists() for place in places), f"{document.name}: {path}"


def test_the_readme_has_the_two_commands():
    assert ".venv/bin/pip install -r requirements.txt && .venv/bin/python app.py" in README
    assert "bash tests/run.sh" in (ROOT / ".ci" / "run").read_text()
    assert "bash tests/run.sh" in README


def test_what_twenty_of_twenty_proves():
    low = binomtest(20, 20).proportion_ci(0.95, "exact").low
    assert f"at least {low:.0%}".replace("%", " %") in README


def test_the_recognizer_schema_is_the_programs():
    path = ROOT / "docs" / "recognizer.schema.json"
    assert json.loads(path.read_text()) == Recognizer.model_json_schema(), (
        "the schema changed; write it again with: python -m tests.write_schema"
    )
