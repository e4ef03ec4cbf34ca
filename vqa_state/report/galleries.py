"""The lists of pictures in the report: missed, to be labelled next, and possibly mislabelled."""

import base64
from collections.abc import Sequence
from html import escape

from vqa_state.errors import ImageError, ProjectError
from vqa_state.evaluation.held_out import MissedImage
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.study.suggest import Hints

__all__ = ["STYLE", "doubtful_labels", "missed", "next_labels"]

STYLE = """
ul.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(9rem, 1fr));
  gap: .75rem; list-style: none; padding: 0; font-size: .8rem; overflow-wrap: anywhere; }
ul.pictures img { width: 100%; border-radius: .3rem; display: block; }
"""

MAX_PICTURES = 24
"""A list that helps is short; so is the page."""


def missed(project: Project, found: Results) -> str:
    """Images of both sides that the chosen objective's subset does not recognize, worst first."""
    row = next(r for r in found.evaluation.rows if r.name == project.chosen)
    sides = [("train", one) for one in row.train_missed] + [("test", o) for o in row.test_missed]
    worst = sorted(sides, key=lambda side: side[1].n_for - side[1].n_against)
    return _pictures(
        project,
        [(one.image_id, _votes(project, side, one)) for side, one in worst],
        empty="It recognizes every image that it was judged on."
        if found.answers.limits
        else "It recognizes every image.",
    )


def next_labels(project: Project, hinted: Hints) -> str:
    """Images without a label, the closest vote first, as their labels teach the most."""
    states = project.states.positive, project.states.negative
    unasked = _unasked(hinted.n_unasked)
    items = [(one.image_id, one.reason(*states)) for one in hinted.next]
    empty = "" if unasked else "Nothing to label: every image in use has its label."
    return (f"<p>{unasked}</p>" if unasked else "") + _pictures(project, items, empty=empty)


def doubtful_labels(project: Project, hinted: Hints, *, assessed: bool) -> str:
    """Training images whose label the out-of-bag votes doubt.

    Args:
        project: its pictures and states.
        hinted: from `vqa_state.study.suggest.hints`.
        assessed: without an assessment nothing is known about them.
    """
    states = project.states.positive, project.states.negative
    items = [(one.image_id, one.reason(*states)) for one in hinted.doubtful]
    empty = (
        "None: no vote that was chosen without a training image is strongly against its label."
        if assessed
        else "Not known: nothing is assessed yet."
    )
    return _pictures(project, items, empty=empty)


def _unasked(n_unasked: int) -> str:
    if not n_unasked:
        return ""
    images = "1 image has" if n_unasked == 1 else f"{n_unasked} images have"
    return (
        f"{images} neither a label nor answers; suggest labels in the app, or "
        "<code>label PROJECT --suggest</code> on the command line, to ask about them."
    )


def _votes(project: Project, side: str, one: MissedImage) -> str:
    state = project.states.of(one.label)
    if one.no_answer:
        return f"{state} ({side}; no answer, {one.n_invalid} invalid)"
    return f"{state} ({side}; {one.n_for} for, {one.n_against} against, {one.n_invalid} invalid)"


def _pictures(project: Project, items: Sequence[tuple[str, str]], *, empty: str) -> str:
    """Pictures with their names and a sentence each; ids of images and plain text."""
    if not items:
        return f"<p>{escape(empty)}</p>" if empty else ""
    shown = "".join(_picture(project, *item) for item in items[:MAX_PICTURES])
    rest = len(items) - MAX_PICTURES
    more = f"<p>And {rest} more.</p>" if rest > 0 else ""
    return f'<ul class="pictures">{shown}</ul>{more}'


def _picture(project: Project, image_id: str, says: str) -> str:
    """One picture with its words; without the picture if its file is gone."""
    name = escape(project.images[image_id].name)
    breakable = name.replace("/", "/<wbr>")
    words = f"<strong>{breakable}</strong><br>{escape(says)}"
    try:
        data = base64.b64encode(project.thumbnail(image_id)).decode()
    except (ImageError, ProjectError):
        return f"<li>{words}</li>"
    return f'<li><img alt="{name}" src="data:image/webp;base64,{data}">{words}</li>'
