"""The public names: sorted, lazy, documented, and nothing else is loaded for them."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import vqa_state

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "docs" / "api.md", *sorted((ROOT / "docs" / "api").glob("*.md"))]

#: What the road needs; a name more is a decision, a name less breaks programs.
NAMES = [
    "Project",
    "Question",
    "Recognizer",
    "Run",
    "VQAStateError",
    "Verdict",
    "ask",
    "assess",
    "export",
    "load_model",
    "optimize",
]


def loaded_by(code: str) -> set[str]:
    """Modules in a fresh Python after this code."""
    shown = f"{code}\nimport sys; print(*sorted(sys.modules), sep='\\n')"
    done = subprocess.run([sys.executable, "-c", shown], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_the_names_are_sorted_and_all_there():
    assert vqa_state.__all__ == sorted(vqa_state.__all__) == NAMES
    assert set(vqa_state._HOMES) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_public_where_it_lives(name):
    home = sys.modules[vqa_state._HOMES[name]] if getattr(vqa_state, name) else None
    assert getattr(home, name) is getattr(vqa_state, name)
    assert name in home.__all__


@pytest.mark.parametrize("name", NAMES)
def test_type_checkers_see_the_name_from_the_same_home(name):
    text = (ROOT / "vqa_state" / "__init__.py").read_text()
    (home,) = re.findall(rf"from (\S+) import [^\n]*\b{name}\b", text.split("if TYPE_CHECKING:")[1])
    assert home == vqa_state._HOMES[name]


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_documented_and_has_an_example(name):
    found = getattr(vqa_state, name)
    doc = inspect.getdoc(found)
    assert len(doc.splitlines()[0]) > 20
    if inspect.isfunction(found):
        assert "Raises:" in doc
        assert set(inspect.signature(found).parameters) <= set(re.findall(r"^ +(\w+):", doc, re.M))
    blocks = [b for p in PAGES for b in re.findall(r"```python\n(.*?)```", p.read_text(), re.S)]
    used = any(re.search(rf"\b{name}\b", block) for block in blocks)
    assert used or name == "Run"  # which the others give


def test_dir_shows_the_names_before_they_are_used():
    code = "import vqa_state; assert {'Project', 'ask'} <= set(dir(vqa_state))"
    assert "vqa_state.project.project" not in loaded_by(code)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'vqa_state' has no attribute 'Recogniser'"):
        vqa_state.Recogniser  # noqa: B018
    with pytest.raises(ImportError):
        from vqa_state import Recogniser  # noqa: F401


def test_importing_the_package_loads_nothing_else():
    ours = {name for name in loaded_by("import vqa_state") if name.startswith("vqa_state")}
    assert ours == {"vqa_state"}
    assert not {"numpy", "pydantic"} & loaded_by("import vqa_state")


HEAVY = {"torch", "gradio", "transformers", "scipy", "pandas", "ortools", "deap", "openai", "rich",
         "importlib.metadata", "sqlite3", "asyncio"}  # fmt: skip


def test_importing_a_recognizer_loads_little():
    # Pydantic looks for its own plugins with importlib.metadata as soon as a record is made.
    assert loaded_by("from vqa_state import Recognizer") & HEAVY <= {"importlib.metadata"}


def test_a_model_of_another_package_is_looked_for_only_when_models_are():
    assert "importlib.metadata" not in loaded_by("import vqa_state.models")


def test_the_command_lines_help_loads_neither_torch_nor_gradio():
    code = (
        "import sys; sys.argv = ['vqa-state', '--help']\n"
        "from vqa_state.__main__ import start\n"
        "try: start()\nexcept SystemExit as end: assert not end.code"
    )
    assert not loaded_by(code) & {"torch", "gradio", "transformers", "ortools", "openai"}


def test_the_types_are_shipped():
    assert (ROOT / "vqa_state" / "py.typed").exists()
