"""The order of imports: a module imports only from lines above its own."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "vqa_state"

ORDER = [
    "errors",
    "locks",
    "files",
    "leftovers",
    "images",
    "augment",
    "questions",
    "cues",
    "thinking",
    "reading",
    "answers",
    "completeness",
    "verdict",
    "store",
    "scores",
    "search",
    "voting",
    "out_of_bag",
    "rival",
    "judgement",
    "abstaining",
    "early_stop",
    "frontier",
    "labelling",
    "splits",
    "project_file",
    "merging",
    "project",
    "folder_names",
    "zip_names",
    "zip_entries",
    "import_report",
    "importing",
    "models.base",
    "embedded",
    "models",
    "asking",
    "tables",
    "features",
    "rival_trial",
    "checking",
    "pace",
    "comparing",
    "evaluation",
    "coverage",
    "recognizer_file",
    "recognizer_calls",
    "recognizer_votes",
    "recognizer",
    "rechecking",
    "searches",
    "making_recognizers",
    "tuning",
    "frontier_marks",
    "assessing",
    "exporting",
    "standing_rows",
    "advice",
    "standings_words",
    "standings",
    "suggesting",
    "report",
    "report_plots",
    "report_pictures",
    "report_page",
    "reproduction.paper",
    "reproduction.running",
    "reproduction.tables",
    "reproduction",
    "jobs",
    "cli",
    "__main__",
    "web",
]

MODULES = sorted(PACKAGE.rglob("*.py"))


def place(module: str) -> int:
    """Line of the order on which a dotted module name (without the package's) stands."""
    fitting = [line for line in ORDER if module == line or module.startswith(line + ".")]
    return ORDER.index(max(fitting, key=len))


def dotted(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__" or len(parts) == 1)


def every_import(path: Path) -> set[str]:
    """Top-level names of all that a file imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add((node.module or "").split(".")[0])
    return names


def imported(path: Path) -> set[str]:
    """Dotted names of this package's modules that a file imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module == "vqa_state":
            names |= {f"vqa_state.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(node.module or "")
        assert not getattr(node, "level", 0), f"{path} has a relative import"
    return {name.removeprefix("vqa_state.") for name in names if name.startswith("vqa_state.")}


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_only_from_above(path):
    own = dotted(path)
    if own == "__init__":
        assert not imported(path)
        return
    below = {name for name in imported(path) if place(name) > place(own)}
    assert not below


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_only_the_app_imports_gradio(path):
    assert dotted(path).startswith("web") or "gradio" not in every_import(path)


def test_every_line_of_the_order_exists():
    known = {dotted(path) for path in MODULES}
    assert all(line in known for line in ORDER)
