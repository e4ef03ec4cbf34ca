"""What the widgets show of a project, as plain JSON values. No gradio, no HTML."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from vqa_state.answers.answer import CUT_OFF
from vqa_state.evaluation.label_ranking import Suggestion
from vqa_state.project.project import LabelledImage, Project, StateNames
from vqa_state.questions.grid import BuiltGrid, Form, Question
from vqa_state.report.frames import ImageAnswer, image_answers

__all__ = [
    "counted",
    "download",
    "duration",
    "image_card",
    "image_row",
    "images_value",
    "note",
    "questions_value",
    "raw_words",
    "unfolding",
]

Value = dict[str, Any]


def note(text: str, tone: str = "plain", share: float | None = None) -> Value:
    """A line of text; tones: plain, good, warn, bad. `share` in [0, 1] draws a bar below."""
    return {"text": text, "tone": tone, "share": share}


def duration(seconds: float) -> str:
    """A time in words: "40 s", "12 min", "2.5 h"."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def unfolding(text: str, title: str, lines: Sequence[str]) -> Value:
    """A note with lines that can be unfolded below it."""
    return note(text) | {"more": {"title": title, "lines": list(lines)}}


def download(href: str, text: str) -> Value:
    """A link that downloads a file of this app, in the place of a note."""
    return note("") | {"link": {"href": href, "text": text}}


def image_row(image: LabelledImage) -> Value:
    """An image as the labelling grid wants it."""
    return {
        "id": image.id,
        "name": image.name,
        "label": image.label,
        "split": image.split,
        "accepted": image.accepted,
    }


def images_value(
    pid: str, project: Project, max_bytes: int, suggested: Mapping[str, Suggestion]
) -> Value:
    """The labelling grid's value; suggestions are of images without a label."""
    return {
        "project": pid,
        "states": [project.states.positive, project.states.negative],
        "max_bytes": max_bytes,
        "items": [image_row(image) for image in project.images.values()],
        "suggested": {
            one.image_id: {"label": one.label, "sureness": one.sureness}
            for one in suggested.values()
        },
    }


def questions_value(built: BuiltGrid, states: StateNames) -> Value:
    """The question grid's value: grouped by form and state phrase, in the grid's order."""
    off = set(built.switched_off)
    groups: dict[str, list[Value]] = {}
    for question in sorted((*built.questions, *built.switched_off), key=_place):
        row = {"text": question.text, "on": question not in off}
        groups.setdefault(_group(question, states), []).append(row)
    return {
        "groups": [{"title": title, "questions": rows} for title, rows in groups.items()],
        "dropped": [question.text for question in built.duplicates],
    }


def image_card(project: Project, image_id: str, texts: Iterable[str]) -> Value:
    """One image with its raw answers to some questions, and how they voted."""
    return _card(project, image_id, image_answers(project, image_id, set(texts)))


def _card(project: Project, image_id: str, answers: Sequence[ImageAnswer]) -> Value:
    image = project.images[image_id]
    state = "no label" if image.label is None else project.states.of(image.label)
    votes = [sum(answer.speaks_for == side for answer in answers) for side in (1, -1, 0)]
    said: dict[str, Counter[str]] = {}
    for answer in answers:
        said.setdefault(answer.question, Counter())[raw_words(answer.text, answer.cut_off)] += 1
    return {
        "image": image_id,
        "title": image.name,
        "note": f"is {state}",
        "votes": votes,
        "right": (votes[0] - votes[1]) * (image.label or 0),
        "answers": [[question, counted(texts)] for question, texts in said.items()],
    }


def raw_words(text: str, cut_off: bool) -> str:
    """A raw answer as it is shown; one that was cut off before yes or no says so."""
    shown = text or "(empty)"
    return f"{shown} – {CUT_OFF}" if cut_off else shown


def counted(texts: Counter[str]) -> str:
    """Raw answers with how often each was given: "yes × 4 · no × 2"."""
    return " · ".join(f"{text} × {n}" for text, n in texts.most_common())


def _group(question: Question, states: StateNames) -> str:
    if question.form is Form.CUSTOM:
        return f"your own · yes means {states.of(question.yes_means)}"
    return f"{question.form} · {question.phrase}"


def _place(question: Question) -> tuple[bool, bool, int]:
    """Forms stay together, then the phrases of the positive state come first."""
    return question.form is Form.CUSTOM, question.form is Form.DOES, -question.yes_means
