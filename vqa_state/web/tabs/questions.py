"""Second stretch: the grid of questions, and questions of one's own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import gradio as gr

from vqa_state.errors import QuestionError
from vqa_state.project import Project
from vqa_state.questions import Article, Form, Question, QuestionGrid, StatePhrase, Wording
from vqa_state.web import checks, widgets
from vqa_state.web.desk import Desk
from vqa_state.web.page import Page
from vqa_state.web.views import note, questions_value

__all__ = ["Parts", "build", "wire"]

FORMS = [("Is this door open?", Form.IS.value), ("Does this image look like …?", Form.DOES.value)]


@dataclass(frozen=True)
class Parts:
    """Components of the tab; the fields are in the order of `edit`."""

    tab: gr.Tab
    wordings: gr.Textbox
    positive: gr.Textbox
    negative: gr.Textbox
    forms: gr.CheckboxGroup
    articles: gr.CheckboxGroup
    own_positive: gr.Textbox
    own_negative: gr.Textbox
    note: gr.HTML
    grid: gr.HTML
    filled: gr.Textbox

    @property
    def fields(self) -> list[Any]:
        """What the user edits."""
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
    with gr.Accordion("Questions of your own", open=False), gr.Row(equal_height=True):
        own_positive = gr.Textbox(lines=3, info="One a line", elem_id="own-positive")
        own_negative = gr.Textbox(lines=3, info="One a line", elem_id="own-negative")
    said = widgets.note("questions-note")
    grid = widgets.question_grid("questions")
    filled = gr.Textbox(visible=False)
    return Parts(
        tab, wordings, positive, negative, forms, articles, own_positive, own_negative,
        said, grid, filled,
    )  # fmt: skip


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab; every field changes the grid while it is typed in."""
    page.fill(show, [*parts.fields, parts.note, parts.grid, parts.filled])
    inputs, outputs = [parts.filled, *parts.fields], [parts.note, parts.grid]
    for field in parts.fields:
        # A text box tells `input` of key presses only, not of a paste or a deletion.
        trigger = field.change if isinstance(field, gr.Textbox) else field.input
        page.change(trigger, edit, inputs, outputs, trigger_mode="always_last")
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


def edit(desk: Desk, pid: str, filled: Any, *fields: Any) -> Any:
    """Note and grid. What cannot be used yet is said, and the grid stays as it was.

    Filling the fields when the page opens counts as a change of each of them. `filled` is filled
    last, so whatever comes before it is no wish of the user.
    """
    if filled != pid:
        return gr.skip(), gr.skip()
    try:
        with desk.changing(pid) as project:
            project.grid = _grid(fields, project)
            return note(""), questions_value(project.grid.build())
    except QuestionError as error:
        return note(f"Not saved yet: {error}.", "warn"), gr.skip()


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


def _grid(fields: Sequence[Any], project: Project) -> QuestionGrid:
    wordings, positive, negative, forms, articles, own_positive, own_negative = fields
    return QuestionGrid(
        wordings=tuple(map(Wording.parse, checks.lines(wordings, "the names"))),
        phrases=(
            *(StatePhrase(line, 1) for line in checks.lines(positive, "the words")),
            *(StatePhrase(line, -1) for line in checks.lines(negative, "the words")),
        ),
        forms=checks.choices(forms, (Form.IS, Form.DOES), "the forms"),
        articles=checks.choices(articles, Article, "the articles"),
        custom=(
            *(Question(line, 1) for line in checks.lines(own_positive, "your questions")),
            *(Question(line, -1) for line in checks.lines(own_negative, "your questions")),
        ),
        switched_off=project.grid.switched_off,
    )


def _phrases(grid: QuestionGrid, yes_means: int) -> str:
    return "\n".join(phrase.text for phrase in grid.phrases if phrase.yes_means == yes_means)


def _own(grid: QuestionGrid, yes_means: int) -> str:
    return "\n".join(one.text for one in grid.custom if one.yes_means == yes_means)
