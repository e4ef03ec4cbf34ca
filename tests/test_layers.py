"""The picture of the house: which package may import which."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "vqa_state"

# Each line imports only from lines above it.
PICTURE = """
    errors
    storage              files written whole or not at all
    images               a picture, read safely; copies; near-duplicates
    questions            wordings, states, the grid, cues
    answers              raw text → verdict; arrays of answers; the store; rates
    models               one protocol; embedded, local, chat and server models
    votes                rules that turn answers into a state
    search               objectives; genetic, exact and weighted search; proofs
    evaluation           held-out table, out-of-bag, paired tests, linear probe
    recognizer           the JSON file, its schema, inference, the verdict
    project              the folder on disk: images, import, split, searches
    study                the workflows on one open project
    report               what people read and print
    reproduction         the paper's experiments again
    web                  the app
    cli                  the command line, which can open the app
    __main__             python -m vqa_state
    testing              for tests of models
    embedded_training    what made the embedded model; nothing imports it
"""
ORDER = [line.split()[0] for line in PICTURE.strip().splitlines()]
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def package(module: str) -> str:
    """The line of the picture on which a dotted name of this project stands."""
    return module.split(".")[1]


def dotted(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


def every_import(path: Path) -> set[str]:
    """Dotted names of all modules that a file imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path} has a relative import"
            module = node.module or ""
            names |= {f"{module}.{a.name}" for a in node.names}
            names.add(module)
    return names


def imported(path: Path) -> set[str]:
    """Dotted names below `vqa_state` that a file imports."""
    return {name for name in every_import(path) if name.startswith("vqa_state.")}


@pytest.mark.parametrize("path", MODULES, ids=dotted)
def test_imports_only_from_lines_above(path: Path) -> None:
    own = ORDER.index(package(dotted(path)))
    names = {package(name) for name in imported(path)} - {"__version__"}
    assert not [name for name in names if ORDER.index(name) > own]


@pytest.mark.parametrize("path", MODULES, ids=dotted)
def test_what_is_private_stays_in_its_package(path: Path) -> None:
    own = dotted(path).rpartition(".")[0] if path.name != "__init__.py" else dotted(path)
    for name in imported(path):
        parents = name.split(".")
        hidden = [i for i, part in enumerate(parents) if part[0] == "_" and part[1] != "_"]
        assert all(own.startswith(".".join(parents[:i])) for i in hidden), name


@pytest.mark.parametrize(
    ("library", "homes"),
    [
        ("gradio", {"web"}),
        ("typer", {"cli"}),
        ("deap", {"search"}),
        ("ortools", {"search"}),
        ("torch", {"models", "embedded_training"}),
        ("transformers", {"models", "embedded_training"}),
        ("openai", {"models"}),
        ("mujoco", {"embedded_training"}),
    ],
)
def test_a_heavy_library_has_one_home(library: str, homes: set[str]) -> None:
    users = {
        package(dotted(path))
        for path in MODULES
        if any(name.split(".")[0] == library for name in every_import(path))
    }
    assert users <= homes


def test_nothing_imports_what_made_the_embedded_model() -> None:
    users = {
        package(dotted(path))
        for path in MODULES
        if any(package(name) == "embedded_training" for name in imported(path))
    }
    assert users == {"embedded_training"}


def test_the_picture_is_the_listing() -> None:
    modules = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    packages = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert modules | packages == set(ORDER)
    assert modules == {"errors", "__main__"}
