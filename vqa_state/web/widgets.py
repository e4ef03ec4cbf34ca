"""The four widgets of the app, as factories of `gr.HTML`.

Each is a fixed template, a style sheet and a script in `assets/`; the script builds its elements
from the value and never interpolates text into HTML. What a value and an event hold stands at
the top of each script. Factories, because gradio writes a `.pyi` beside every subclass.
"""

from pathlib import Path
from typing import Any

import gradio as gr

__all__ = ["heatmap", "label_grid", "question_grid", "search_chart"]

ASSETS = Path(__file__).parent / "assets"


def label_grid(elem_id: str) -> gr.HTML:
    """Add, pick and label images; events `uploaded`, `changed` and `reload`."""
    return _widget("label_grid", elem_id, "dom.js", "upload.js", "label_grid.js")


def question_grid(elem_id: str) -> gr.HTML:
    """All questions of the grid; event `switched` carries the texts that are off."""
    return _widget("question_grid", elem_id, "dom.js", "question_grid.js")


def search_chart(elem_id: str) -> gr.HTML:
    """Best and mean fitness of running searches; no events."""
    return _widget("search_chart", elem_id, "dom.js", "search_chart.js")


def heatmap(elem_id: str) -> gr.HTML:
    """Accuracy and invalid share of each question; event `pick` carries the question."""
    return _widget("heatmap", elem_id, "dom.js", "heatmap.js")


def _widget(name: str, elem_id: str, *scripts: str) -> gr.HTML:
    value: dict[str, Any] = {}
    return gr.HTML(
        value=value,
        elem_id=elem_id,
        html_template=_asset(f"{name}.html"),
        css_template=_asset(f"{name}.css"),
        js_on_load="\n".join(_asset(script) for script in scripts),
        apply_default_css=False,
    )


def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")
