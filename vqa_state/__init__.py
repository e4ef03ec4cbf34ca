"""Choose the questions that let a vision-language model recognize a state.

    from vqa_state import Project, ask, export, load_model, optimize

    project = Project.open("my_fridge")
    ask(project, load_model("embedded")).run()
    optimize(project).run()
    export(project).save("fridge.json")

A name below is imported when it is first used, so importing this package loads nothing else.
docs/api.md has the whole road and a page for every package.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vqa_state.errors import VQAStateError
    from vqa_state.models import load_model
    from vqa_state.project.project import Project
    from vqa_state.questions.grid import Question
    from vqa_state.recognizer.recognizer import Recognizer
    from vqa_state.recognizer.verdict import Verdict
    from vqa_state.study.export import export
    from vqa_state.study.run import Run
    from vqa_state.study.workflows import ask, assess, optimize

__version__ = "0.1.0"

__all__ = [
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

_HOMES = {
    "Project": "vqa_state.project.project",
    "Question": "vqa_state.questions.grid",
    "Recognizer": "vqa_state.recognizer.recognizer",
    "Run": "vqa_state.study.run",
    "VQAStateError": "vqa_state.errors",
    "Verdict": "vqa_state.recognizer.verdict",
    "ask": "vqa_state.study.workflows",
    "assess": "vqa_state.study.workflows",
    "export": "vqa_state.study.export",
    "load_model": "vqa_state.models",
    "optimize": "vqa_state.study.workflows",
}


def __getattr__(name: str) -> object:
    """Import a public name from its home when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found: object = getattr(import_module(_HOMES[name]), name)
    globals()[name] = found  # the next use finds it without this function
    return found


def __dir__() -> list[str]:
    """The public names, imported or not."""
    return sorted({*globals(), *__all__})
