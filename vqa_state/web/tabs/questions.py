"""Second stretch: the grid of questions, and questions of one's own."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import gradio as gr

from vqa_state.errors import QuestionError, VQAStateError
from vqa_state.questions.cues import with_cues
from vqa_state.questions.grid import Article, Form, Question, QuestionGrid, StatePhrase, Wording
from vqa_state.web import arguments, widgets
from vqa_state.web.page import Page
from vqa_state.web.session import Desk
from vqa_state.web.view_data import note, questions_value

__all__ = ["Parts", "build", "wire"]

ELSEWHERE = (
    "Not saved: this field was changed in another window meanwhile. Reload the page to see it, "
    "then change it again."
)
SEEN_JS = """(pid, filled, value) => {
  const sent = (window.questionsSent ??= {})['AXIS'] ??= [];
  const seen = filled ? [JSON.parse(filled)['AXIS'], ...sent] : [];
  sent.push(value);
  sent.splice(0, sent.length - 40);
  return [pid, JSON.stringify(seen), value];
}"""
"""In the place of all that was filled in: what this page has seen in one field, the latest last."""

FORMS = [("Is this door open?", Form.IS.value), ("Does this image look like …?", Form.DOES.value)]


@dataclass(frozen=True)
class Parts:
    """Components of the tab."""

    tab: gr.Tab
    wordings: gr.Textbox
    positive: gr.Textbox
    negative: gr.Textbox
    forms: gr.CheckboxGroup
    articles: gr.CheckboxGroup
    own_positive: gr.Textbox
    own_negative: gr.Textbox
    cues: gr.Button
    note: gr.HTML
    grid: gr.HTML
    filled: gr.Textbox

    @property
    def fields(self) -> list[Any]:
        """What the user edits, in the order of `AXES`."""
        return [
            self.wordings, self.positive, self.negative, self.forms, self.articles,
            self.own_positive, self.own_negative,
        ]  # fmt: skip


def build(tab: gr.Tab) -> Parts:
    """Draw the tab."""
    with gr.Row(equal_height=True):
        wordings = gr.Textbox(
            label="Names for the thing, one a line", lines=4, elem_id="wordings",
            info="For a place that carries the article: water | in {article} sink",
        )  # fmt: skip
        positive = gr.Textbox(lines=4, elem_id="positive-words", info="One a line")
        negative = gr.Textbox(
            lines=4, elem_id="negative-words", info="One a line; “not …” works too"
        )
    with gr.Row(equal_height=True):
        forms = gr.CheckboxGroup(FORMS, label="Forms", elem_id="forms")
        articles = gr.CheckboxGroup(
            [a.value for a in Article], label="Articles", elem_id="articles"
        )
    with gr.Accordion("Questions of your own", open=False):
        with gr.Row(equal_height=True):
            own_positive = gr.Textbox(lines=3, info="One a line", elem_id="own-positive")
            own_negative = gr.Textbox(lines=3, info="One a line", elem_id="own-negative")
        cues = gr.Button("Add ready cues: how far, a gap, the inside …", elem_id="add-cues")
    said = widgets.note("questions-note")
    grid = widgets.question_grid("questions")
    filled = gr.Textbox(visible=False)
    return Parts(
        tab, wordings, positive, negative, forms, articles, own_positive, own_negative,
        cues, said, grid, filled,
    )  # fmt: skip


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab; every field changes its part of the grid while it is typed in."""
    page.fill(show, [*parts.fields, parts.note, parts.grid, parts.filled])
    for field, axis in zip(parts.fields, AXES, strict=True):
        triggers = [field.input, field.blur] if isinstance(field, gr.Textbox) else [field.input]
        for trigger in triggers:
            page.change(
                trigger, partial(edit, axis), [parts.filled, field], [parts.note, parts.grid],
                trigger_mode="always_last", js=SEEN_JS.replace("AXIS", axis),
            )  # fmt: skip
    own = [parts.own_positive, parts.own_negative]
    page.change(parts.cues.click, add_cues, [], [*own, parts.note, parts.grid, parts.filled])
    page.then_road(page.on_data(parts.grid.switched, switch, (), [parts.note]))


def show(desk: Desk, pid: str) -> Any:
    """All fields, note and grid."""
    with desk.reading(pid) as project:
        grid, states = project.grid, project.states
    said = _said(grid)
    return (
        said["wordings"],
        gr.Textbox(said["positive"], label=f"Words for “{states.positive}”"),
        gr.Textbox(said["negative"], label=f"Words for “{states.negative}”"),
        said["forms"],
        said["articles"],
        gr.Textbox(said["own_positive"], label=f"“Yes” speaks for “{states.positive}”"),
        gr.Textbox(said["own_negative"], label=f"“Yes” speaks for “{states.negative}”"),
        note(""),
        questions_value(grid.build(), states),
        json.dumps(said),
    )


def edit(axis: str, desk: Desk, pid: str, seen: Any, value: Any) -> Any:
    """Note and grid. What cannot be used yet is said, and the grid stays as it was.

    A field speaks for its own part of the grid only, and not before it was filled: an event that
    comes while the page still opens must not empty the rest. Nor may a page take back what it has
    never seen, because another window changed it.

    Args:
        axis: of `AXES`.
        desk: with the project.
        pid: of the project.
        seen: JSON list of what this page has seen in the field, the latest last.
        value: what stands in the field now.
    """
    known = arguments.json_list(seen, "what the page has seen")
    if not known or value == known[-1]:  # it was only passed through
        return gr.skip(), gr.skip()
    try:
        with desk.changing(pid) as project:
            fresh = AXES[axis](project.grid, value)
            if not any(_says(axis, project.grid, one) for one in (value, *reversed(known))):
                return note(ELSEWHERE, "warn"), gr.skip()
            project.grid = fresh
            return note(""), questions_value(fresh.build(), project.states)
    except QuestionError as error:
        return note(f"Not saved yet: {error}.", "warn"), gr.skip()


def _says(axis: str, grid: QuestionGrid, value: Any) -> bool:
    """Whether the grid's part is what this value of the field makes it."""
    try:
        return bool(_said(AXES[axis](grid, value))[axis] == _said(grid)[axis])
    except VQAStateError:
        return False


def add_cues(desk: Desk, pid: str) -> Any:
    """Own questions, note, grid and what is filled in, with ready cues for the states."""
    try:
        with desk.changing(pid) as project:
            before = len(project.grid.custom)
            project.grid = with_cues(project.grid, project.states.positive)
            n_new, grid = len(project.grid.custom) - before, project.grid
    except QuestionError as error:
        said = note(f"No cue added: {error}.", "warn")
        return gr.skip(), gr.skip(), said, gr.skip(), gr.skip()
    said = note(f"{n_new} questions added; take out a line that does not fit.")
    value = questions_value(grid.build(), project.states)
    return _own(grid, 1), _own(grid, -1), said, value, json.dumps(_said(grid))


def switch(desk: Desk, pid: str, data: Any) -> Any:
    """Switch some questions on or off; the grid shows it already."""
    sent = arguments.json_object(data)
    texts, on = sent.get("texts"), sent.get("on")
    if not isinstance(texts, list) or not isinstance(on, bool):
        raise arguments.RequestError(
            "to switch questions takes a list of their texts, and on or off"
        )
    with desk.changing(pid) as project:
        built = project.grid.build()
        known = {question.text for question in (*built.questions, *built.switched_off)}
        meant = {text for text in texts if isinstance(text, str) and text in known}
        others = [text for text in project.grid.switched_off if text not in meant]
        off = [*others] if on else [*others, *(text for text in texts if text in meant)]
        project.grid = replace(project.grid, switched_off=tuple(dict.fromkeys(off)))
    return note("")


def _with_wordings(grid: QuestionGrid, value: Any) -> QuestionGrid:
    return replace(grid, wordings=tuple(map(Wording.parse, arguments.lines(value, "the names"))))


def _with_phrases(yes_means: int, grid: QuestionGrid, value: Any) -> QuestionGrid:
    fresh = [StatePhrase(line, yes_means) for line in arguments.lines(value, "the words")]
    others = [phrase for phrase in grid.phrases if phrase.yes_means != yes_means]
    return replace(grid, phrases=tuple(sorted((*fresh, *others), key=_positive_first)))


def _with_forms(grid: QuestionGrid, value: Any) -> QuestionGrid:
    return replace(grid, forms=arguments.choices(value, (Form.IS, Form.DOES), "the forms"))


def _with_articles(grid: QuestionGrid, value: Any) -> QuestionGrid:
    return replace(grid, articles=arguments.choices(value, Article, "the articles"))


def _with_own(yes_means: int, grid: QuestionGrid, value: Any) -> QuestionGrid:
    fresh = [Question(line, yes_means) for line in arguments.lines(value, "your questions")]
    others = [question for question in grid.custom if question.yes_means != yes_means]
    return replace(grid, custom=tuple(sorted((*fresh, *others), key=_positive_first)))


def _positive_first(one: StatePhrase | Question) -> int:
    return -one.yes_means


AXES: dict[str, Callable[[QuestionGrid, Any], QuestionGrid]] = {
    "wordings": _with_wordings,
    "positive": partial(_with_phrases, 1),
    "negative": partial(_with_phrases, -1),
    "forms": _with_forms,
    "articles": _with_articles,
    "own_positive": partial(_with_own, 1),
    "own_negative": partial(_with_own, -1),
}
"""How each field changes the grid, in the order of `Parts.fields`."""


def _said(grid: QuestionGrid) -> dict[str, Any]:
    """What stands in each field, by its axis."""
    return {
        "wordings": "\n".join(map(str, grid.wordings)),
        "positive": _phrases(grid, 1),
        "negative": _phrases(grid, -1),
        "forms": [form.value for form in grid.forms],
        "articles": [article.value for article in grid.articles],
        "own_positive": _own(grid, 1),
        "own_negative": _own(grid, -1),
    }


def _phrases(grid: QuestionGrid, yes_means: int) -> str:
    return "\n".join(phrase.text for phrase in grid.phrases if phrase.yes_means == yes_means)


def _own(grid: QuestionGrid, yes_means: int) -> str:
    return "\n".join(one.text for one in grid.custom if one.yes_means == yes_means)
