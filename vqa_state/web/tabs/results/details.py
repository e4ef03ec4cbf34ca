"""Part of Results, folded: what questions and abstaining buy, labels to check, the report."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

import gradio as gr

from vqa_state.evaluation.label_ranking import DoubtfulLabel, OpenImage
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.study.assess import Assessment
from vqa_state.study.frontier_marks import marked_points
from vqa_state.study.suggest import Hints, hints
from vqa_state.web import tradeoff, widgets
from vqa_state.web.tabs.results.galleries import evidence
from vqa_state.web.view_data import download, image_card, note

__all__ = ["Parts", "build", "nothing", "show"]

MAX_CARDS = 12


@dataclass(frozen=True)
class Parts:
    """Components; `shown` are in the order of `show`."""

    shown: tuple[Any, ...]


def build() -> Parts:
    """Draw it."""
    with gr.Accordion(
        "What questions and abstaining buy",
        open=False, visible=False, elem_id="trades",
    ) as buys, gr.Row():  # fmt: skip
        with gr.Column(min_width=300):
            gr.Markdown("#### Questions, on the training images")
            frontier = widgets.trade("frontier")
        with gr.Column(min_width=300):
            gr.Markdown("#### Abstaining, out of bag")
            curve = widgets.trade("coverage-curve")
    with gr.Accordion(
        "Labels to check", open=False, visible=False, elem_id="labels-to-check"
    ) as labels:
        doubtful = widgets.evidence("doubtful")
        following = widgets.evidence("label-next")
    link = widgets.note("report-link")
    return Parts((buys, frontier, curve, labels, doubtful, following, link))


def nothing() -> tuple[Any, ...]:
    """Without results."""
    folded, first = gr.Accordion(visible=False), {"empty": "Optimize first, then assess."}
    return folded, first, first, folded, {}, {}, note("")


def show(
    pid: str, project: Project, found: Results, assessed: Assessment | None
) -> tuple[Any, ...]:
    """Charts, labels that are doubtful or to come next, and the report's link."""
    hinted = hints(project, found, assessed)
    words = _to_check(hinted)
    return (
        gr.Accordion(visible=assessed is not None),
        *_charts(found, assessed),
        gr.Accordion(label=words, visible=bool(words)),
        *_cards(pid, project, found, hinted),
        download(
            f"/projects/{quote(pid)}/report.html",
            "Keep a report that prints (HTML; it counts as a look at the test images)",
        ),
    )


def _charts(found: Results, assessed: Assessment | None) -> tuple[Any, Any]:
    texts = [question.text for question in found.train.questions]
    points = () if assessed is None else assessed.frontier
    curve = () if assessed is None else assessed.curves.get(assessed.recommendation.kind, ())
    return (
        tradeoff.frontier_value(points, marked_points(found), texts),
        tradeoff.coverage_value(curve),
    )


def _to_check(hinted: Hints) -> str:
    """How many labels there are to look at; "" without any."""
    n_open = len(hinted.next) + hinted.n_unasked
    parts = [f"{len(hinted.doubtful)} possibly wrong"] if hinted.doubtful else []
    parts += [f"{n_open} missing"] if n_open else []
    return f"Labels: {', '.join(parts)}" if parts else ""


def _cards(pid: str, project: Project, found: Results, hinted: Hints) -> tuple[Any, Any]:
    """Training images whose label is doubtful, and which image to label next."""
    subset = found.searches[project.chosen].subset
    texts = [found.train.questions[position].text for position in subset]
    states = project.states.positive, project.states.negative

    def shown(title: str, ones: Iterable[DoubtfulLabel | OpenImage]) -> Any:
        cards = [
            image_card(project, one.image_id, texts) | {"note": one.reason(*states)}
            for one in list(ones)[:MAX_CARDS]
        ]
        return evidence(pid, project, title, cards)

    doubtful = shown("Possibly mislabelled", hinted.doubtful) if hinted.doubtful else {}
    title = _label_next(len(hinted.next), hinted.n_unasked)
    return doubtful, shown(title, hinted.next) if title else {}


def _label_next(n_asked: int, n_unasked: int) -> str:
    """What is said of images without a label; "" if there are none."""
    closest = ["Label next: the vote on these is the closest"] if n_asked else []
    if not n_unasked:
        return "".join(closest)
    images = "1 image without a label lacks" if n_unasked == 1 else (
        f"{n_unasked} images without a label lack"
    )  # fmt: skip
    them = "it" if n_unasked == 1 else "them"
    return ". ".join([*closest, f"{images} answers; “Suggest labels” on Images asks about {them}"])
