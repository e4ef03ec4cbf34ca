"""The app's own widgets, as factories of `gr.HTML`.

Each is a fixed template, style sheets and scripts in `assets/`; the script builds its elements
from the value and never puts text into HTML. What a value holds stands at the top of its script.
Factories, because gradio writes a `.pyi` beside every subclass.
"""

from collections.abc import Iterable
from pathlib import Path

import gradio as gr

__all__ = [
    "evidence",
    "heatmap",
    "label_grid",
    "note",
    "question_grid",
    "search_chart",
    "trade",
    "verdict",
]

ASSETS = Path(__file__).parent / "assets"


def label_grid(elem_id: str) -> gr.HTML:
    """Add, pick and label images; events `uploaded`, `changed` and `reload`."""
    return _widget("label_grid", elem_id, "dom.js", "upload.js", "label_grid.js")


def question_grid(elem_id: str) -> gr.HTML:
    """All questions of the grid; event `switched` carries what was switched."""
    return _widget("question_grid", elem_id, "dom.js", "question_grid.js")


def search_chart(elem_id: str) -> gr.HTML:
    """Best and mean fitness of running searches."""
    return _widget("search_chart", elem_id, "dom.js", "search_chart.js")


def heatmap(elem_id: str) -> gr.HTML:
    """Accuracy and invalid share of each question; event `pick` carries the question."""
    return _widget("heatmap", elem_id, "dom.js", "heatmap.js")


def evidence(elem_id: str) -> gr.HTML:
    """Images with votes and raw answers."""
    return _widget("evidence", elem_id, "dom.js", "cards.js", "evidence.js")


def trade(elem_id: str) -> gr.HTML:
    """What accuracy costs; event `pick` carries which point."""
    return _widget("trade", elem_id, "dom.js", "trade.js")


def verdict(elem_id: str) -> gr.HTML:
    """A picture to try a recognizer on, and its verdict."""
    return _widget("verdict", elem_id, "dom.js", "cards.js", "verdict.js")


def note(elem_id: str) -> gr.HTML:
    """A line of text, a bar and a link; see `views.note`."""
    return _widget("note", elem_id, "dom.js", "note.js")


def _widget(name: str, elem_id: str, *files: str) -> gr.HTML:
    """A script may have a style sheet of the same name."""
    sheets = [(ASSETS / file).with_suffix(".css") for file in files]
    return gr.HTML(
        value={},
        elem_id=elem_id,
        html_template=(ASSETS / f"{name}.html").read_text(encoding="utf-8"),
        css_template=_joined(sheet for sheet in sheets if sheet.exists()),
        js_on_load=_joined(ASSETS / file for file in files),
        apply_default_css=False,
    )


def _joined(files: Iterable[Path]) -> str:
    return "\n".join(file.read_text(encoding="utf-8") for file in files)
