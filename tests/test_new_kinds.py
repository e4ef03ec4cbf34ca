"""A new objective, engine or vote costs one file and one line, and is offered everywhere."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.thorough

REPOSITORY = Path(__file__).parent.parent

OBJECTIVE = """
from vqa_state.search.objectives._base import ObjectiveKind

OBJECTIVE = ObjectiveKind(name="toy-s", hint="toy objective", primed=True, beta_sign=0)
"""
ENGINE = """
from vqa_state.search.engines._base import EngineKind
from vqa_state.search.genetic import search

ENGINE = EngineKind(name="toy-e", hint="toy engine", is_proved=False, search=search)
"""
RULE = """
from vqa_state.votes.rules._base import Learned, VoteRule

class ToyVote(VoteRule):
    name = "toy-v"

    def fit(self, ballots, labels, subset, groups):
        return Learned(tuple(subset), (1,) * len(subset), 0.4)

RULE = ToyVote()
"""
#: Where each stands, and the line of registration before which its own is put.
KINDS = (
    ("search/objectives", "search/objectives/__init__.py", OBJECTIVE, "    S_PLUS = "),
    ("search/engines", "search/engines/__init__.py", ENGINE, "    PAPER = "),
    ("votes/rules", "votes/rules/kinds.py", RULE, "    PAPER = "),
)
CONTRACTS = ("search/test_kinds_contract.py", "votes/test_kinds_contract.py")

OFFERS = """
import gradio as gr
from typer.testing import CliRunner

from vqa_state.cli import app
from vqa_state.search.objectives import Objective
from vqa_state.web.tabs import optimize

for command in ("optimize", "tune", "export"):
    print(command, " ".join(CliRunner().invoke(app, [command, "--help"]).output.split()))
with gr.Blocks():
    with gr.Tab() as tab:
        engine = optimize.build(tab).engine
print("app", engine.choices, optimize.HINTS[Objective("toy-s")])
"""


def with_toys(folder: Path) -> None:
    """A copy of the package, by links, with one file and one line more for each kind."""
    shutil.copytree(REPOSITORY / "vqa_state", folder / "vqa_state", copy_function=os.symlink)
    for package, registry, content, before in KINDS:
        (folder / "vqa_state" / package / "toy.py").write_text(content)
        path = folder / "vqa_state" / registry
        text = path.read_text(encoding="utf-8")
        path.unlink()
        path.write_text(text.replace(before, f'    TOY = "toy"\n{before}', 1), encoding="utf-8")


def output_of(folder: Path, *arguments: str) -> str:
    environment = os.environ | {"PYTHONPATH": f"{folder}:{REPOSITORY / 'tests'}", "COLUMNS": "300"}
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_one_file_and_one_line_make_a_kind(tmp_path):
    with_toys(tmp_path)
    for contract in CONTRACTS:
        (tmp_path / contract).parent.mkdir(exist_ok=True)
        shutil.copy(REPOSITORY / "tests" / contract, tmp_path / contract)
    passed = output_of(
        tmp_path, "-m", "pytest", "-q", "--import-mode=importlib", "-k", "toy", *CONTRACTS
    )
    assert "passed" in passed
    offers = output_of(tmp_path, "-c", OFFERS)
    lines = dict(line.split(" ", 1) for line in offers.splitlines())
    assert "toy-e" in lines["optimize"]
    assert "toy-e" in lines["tune"]
    assert "toy-s" in lines["export"]
    assert "toy-v" in lines["export"]
    assert "('toy engine', 'toy-e')" in lines["app"]
    assert "toy objective" in lines["app"]
