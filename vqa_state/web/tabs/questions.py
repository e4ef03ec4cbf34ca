"""Second stretch: the grid of questions, and questions of one's own."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import gradio as gr

from vqa_state.cues import with_cues
from vqa_state.errors import QuestionError
from vqa_state.questions import Article, Form, Question, QuestionGrid, StatePhrase, Wording
from vqa_state.web import checks, widgets
from vqa_state.web.desk import Desk
from vqa_state.web.page import Page
from vqa_state.web.views import note, questions_value

__all__ = ["Parts", "build", "wire"]

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
                trigger_mode="always_last",
            )  # fmt: skip
    page.then_road(
        page.on(
            parts.cues.click,
            add_cues,
            [],
            [parts.own_positive, parts.own_negative, parts.note, parts.grid],
        )
    )
    page.then_road(page.on_data(parts.grid.switched, switch, (), [parts.note]))


def show(desk: Desk, pid: str) -> Any:
    """All fields, note and grid."""
    with desk.reading(pid) as project:
        grid, states = project.grid, project.states
    return (
        "\n".join(map(str, grid.wordings)),
        gr.Textbox(_phrases(grid, 1), label=f"Words for “{states.positive}”"),
        gr.Textbox(_phrases(grid, -1), label=f"Words for “{states.negative}”"),
        [form.value for form in grid.forms],
        [article.value for article in grid.articles],
        gr.Textbox(_own(grid, 1), label=f"“Yes” speaks for “{states.positive}”"),
        gr.Textbox(_own(grid, -1), label=f"“Yes” speaks for “{states.negative}”"),
        note(""),
        questions_value(grid.build()),
        pid,
    )


def edit(axis: str, desk: Desk, pid: str, filled: Any, value: Any) -> Any:
    """Note and grid. What cannot be used yet is said, and the grid stays as it was.

    A field speaks for its own part of the grid only, and not before it was filled: an event that
    comes while the page still opens must not empty the rest.
    """
    if filled != pid:
        return gr.skip(), gr.skip()
    try:
        with desk.changing(pid) as project:
            project.grid = AXES[axis](project.grid, value)
            return note(""), questions_value(project.grid.build())
    except QuestionError as error:
        return note(f"Not saved yet: {error}.", "warn"), gr.skip()


def add_cues(desk: Desk, pid: str) -> Any:
    """Own questions, note and grid, with ready cues for the project's states."""
    try:
        with desk.changing(pid) as project:
            before = len(project.grid.custom)
            project.grid = with_cues(project.grid, project.states.positive)
            n_new, grid = len(project.grid.custom) - before, project.grid
    except QuestionError as error:
        return gr.skip(), gr.skip(), note(f"No cue added: {error}.", "warn"), gr.skip()
    said = f"{n_new} questions added; take out a line that does not fit."
    return _own(grid, 1), _own(grid, -1), note(said), questions_value(grid.build())


def switch(desk: Desk, pid: str, data: Any) -> Any:
    """Keep which questions are off; the grid shows it already."""
    off = checks.json_object(data).get("off")
    with desk.changing(pid) as project:
        built = project.grid.build()
        known = {question.text for question in (*built.questions, *built.switched_off)}
        if not isinstance(off, list):
            raise checks.RequestError("the questions to switch off must be a list of their texts")
        texts = tuple(text for text in off if isinstance(text, str) and text in known)
        project.grid = replace(project.grid, switched_off=texts)
    return note("")


def _with_wordings(grid: QuestionGrid, value: Any) -> QuestionGrid:
    return replace(grid, wordings=tuple(map(Wording.parse, checks.lines(value, "the names"))))


def _with_phrases(yes_means: int, grid: QuestionGrid, value: Any) -> QuestionGrid:
    fresh = [StatePhrase(line, yes_means) for line in checks.lines(value, "the words")]
    others = [phrase for phrase in grid.phrases if phrase.yes_means != yes_means]
    return replace(grid, phrases=tuple(sorted((*fresh, *others), key=_positive_first)))


def _with_forms(grid: QuestionGrid, value: Any) -> QuestionGrid:
    return replace(grid, forms=checks.choices(value, (Form.IS, Form.DOES), "the forms"))


def _with_articles(grid: QuestionGrid, value: Any) -> QuestionGrid:
    return replace(grid, articles=checks.choices(value, Article, "the articles"))


def _with_own(yes_means: int, grid: QuestionGrid, value: Any) -> QuestionGrid:
    fresh = [Question(line, yes_means) for line in checks.lines(value, "your questions")]
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


def _phrases(grid: QuestionGrid, yes_means: int) -> str:
    return "\n".join(phrase.text for phrase in grid.phrases if phrase.yes_means == yes_means)


def _own(grid: QuestionGrid, yes_means: int) -> str:
    return "\n".join(one.text for one in grid.custom if one.yes_means == yes_means)
