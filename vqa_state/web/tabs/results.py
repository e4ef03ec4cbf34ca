"""Fifth stretch: which questions are good, how good the choice is, and where it fails."""

from dataclasses import dataclass
from typing import Any

import gradio as gr
import pandas as pd

from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.evaluation import Row
from vqa_state.project import Project
from vqa_state.questions import Form
from vqa_state.report import comparison_frame, heatmap
from vqa_state.searches import Results
from vqa_state.splits import Split
from vqa_state.tuning import results
from vqa_state.web import checks, widgets
from vqa_state.web.desk import Desk
from vqa_state.web.page import Page
from vqa_state.web.tabs import assess
from vqa_state.web.views import image_card, missed_card, note

__all__ = ["Parts", "build", "wire"]

TRAIN, TEST = "train: ", "test: "


@dataclass(frozen=True)
class Parts:
    """Components of the tab."""

    tab: gr.Tab
    note: gr.HTML
    heatmap: gr.HTML
    answers: gr.HTML
    train: gr.Dataframe
    train_missed: gr.HTML
    look: gr.Button
    test: gr.Dataframe
    sentences: gr.HTML
    test_missed: gr.HTML
    worth: assess.Parts


def build(tab: gr.Tab) -> Parts:
    """Draw the tab."""
    said = widgets.note("results-note")
    gr.Markdown(
        "### Questions on the training images\nThe number is the share of right answers among "
        "the valid ones, in %. Hatched: more than 20 % of the answers are invalid. Choose a cell "
        "to see what the model said."
    )
    cells = widgets.heatmap("heatmap")
    answers = widgets.evidence("question-answers")
    gr.Markdown(
        "### Sets of questions on the training images\nThey chose the questions, so these scores "
        "flatter. Choose a row to see the images that it does not recognize."
    )
    train = gr.Dataframe(interactive=False, elem_id="train-table", show_label=False)
    train_missed = widgets.evidence("train-missed")
    worth = assess.build()
    gr.Markdown(
        "### Sets of questions on the test images\nThese images chose nothing. Each look tempts to "
        "choose by them, so looks are counted."
    )
    look = gr.Button("Look at the test images", elem_id="look", scale=0, min_width=170)
    test = gr.Dataframe(interactive=False, elem_id="test-table", show_label=False, visible=False)
    sentences = widgets.note("sentences")
    test_missed = widgets.evidence("test-missed")
    return Parts(
        tab, said, cells, answers, train, train_missed, look, test, sentences, test_missed, worth
    )


def wire(parts: Parts, page: Page) -> None:
    """Connect the tab."""
    shown = [
        parts.note, parts.heatmap, parts.answers, parts.train, parts.train_missed,
        parts.look, parts.test, parts.sentences, parts.test_missed,
    ]  # fmt: skip
    page.fill(show, shown)
    page.refresh(parts.tab, show, shown)
    page.on_data(parts.heatmap.pick, pick, (), [parts.answers])
    page.on_data(parts.train.select, missed_train, (), [parts.train_missed])
    page.on_data(parts.test.select, missed_test, (), [parts.test_missed])
    looked = page.on(parts.look.click, look, (), [parts.look, parts.test, parts.sentences])
    assess.wire(parts.worth, page, parts.tab, looked)


def show(desk: Desk, pid: str) -> Any:
    """Everything but the test images; evidence that a quick hand already chose stays."""
    project = desk.snapshot(pid)
    found, said = _results(project)
    table = _table(found, TRAIN) if found else gr.Dataframe(visible=False)
    hidden = gr.Dataframe(visible=False)
    has_test = found is not None and found.test is not None
    return (
        said, _heatmap(project), gr.skip(), table, gr.skip(),
        _look_button(project, has_test), hidden, note(""), gr.skip(),
    )  # fmt: skip


def look(desk: Desk, pid: str) -> Any:
    """The test table; the look is counted."""
    with desk.changing(pid) as project:
        found, _ = _results(project)
        if found is None or found.test is None:
            raise NothingToSearchError("there are no test results yet; optimize first")
        project.test_looks += 1
        said = assess.sentences(project, found)
        return _look_button(project, True), _table(found, TEST), note(said)


def pick(desk: Desk, pid: str, data: Any) -> Any:
    """Training images with what the model answered to one question."""
    project = desk.snapshot(pid)
    text = checks.text(checks.json_object(data).get("question"), "the question")
    if text not in {question.text for question in project.questions()}:
        raise ProjectError("the project has no such question any more; choose another cell")
    images = project.labelled(Split.TRAIN)
    cards = [image_card(project, image.id, [text]) for image in images]
    return _evidence(pid, project, text, sorted(cards, key=_rightness))


def missed_train(desk: Desk, pid: str, data: Any) -> Any:
    """Training images that the chosen row does not recognize."""
    return _missed(desk, pid, data, Split.TRAIN)


def missed_test(desk: Desk, pid: str, data: Any) -> Any:
    """Test images that the chosen row does not recognize."""
    return _missed(desk, pid, data, Split.TEST)


def _missed(desk: Desk, pid: str, data: Any, split: Split) -> Any:
    project = desk.snapshot(pid)
    found, _ = _results(project)
    if found is None:
        raise NothingToSearchError("images, labels or questions changed; optimize again")
    row = _row(found, data)
    missed = row.train_missed if split is Split.TRAIN else row.test_missed
    texts = [found.train.questions[position].text for position in row.subset]
    cards = [missed_card(project, one, texts) for one in missed]
    n_images = (found.train if split is Split.TRAIN else found.test or found.train).n_images
    title = (
        f"{row.name.value} does not recognize {len(cards)} of the {n_images} {split.value} images"
        if cards
        else f"{row.name.value} recognizes all {n_images} {split.value} images"
    )
    return _evidence(pid, project, title, cards)


def _row(found: Results, data: Any) -> Row:
    """The row by its name: the reader may have sorted the table."""
    values = checks.json_object(data).get("row_value")
    name = values[0] if isinstance(values, list) and values else None
    rows = {row.name.value: row for row in found.evaluation.rows}
    if not isinstance(name, str) or name not in rows:
        raise checks.RequestError("the table has no such row; choose another one")
    return rows[name]


def _evidence(pid: str, project: Project, title: str, cards: list[Any]) -> Any:
    states = [project.states.positive, project.states.negative]
    return {"project": pid, "states": states, "title": title, "cards": cards}


def _rightness(card: Any) -> tuple[int, str]:
    """Most wrong first."""
    return card["right"], card["title"]


def _results(project: Project) -> tuple[Results | None, Any]:
    """What was found, and what to say about it."""
    try:
        found = results(project)
    except (NothingToSearchError, ProjectError) as error:
        return None, note(f"No results yet: {error}.", "warn")
    if found is None:
        said = "No results yet, or images, labels or questions changed since: optimize first."
        return None, note(said, "warn")
    n_left_out = found.evaluation.n_left_out_train + found.evaluation.n_left_out_test
    if n_left_out:
        said = f"{n_left_out} images are left out, because answers about them are missing."
        return found, note(said, "warn")
    return found, note("")


def _look_button(project: Project, possible: bool) -> Any:
    n = project.test_looks
    times = "not yet looked at" if not n else "looked at once" if n == 1 else f"looked at {n} times"
    return gr.Button(f"Look at the test images ({times})", interactive=possible)


def _table(found: Results, side: str) -> Any:
    frame = comparison_frame(found.evaluation)
    own = [column for column in frame.columns if not column.startswith((TRAIN, TEST))]
    table = frame[own + [column for column in frame.columns if column.startswith(side)]]
    return gr.Dataframe(table.rename(columns=lambda name: name.removeprefix(side)), visible=True)


def _heatmap(project: Project) -> Any:
    """Rows are forms and articles, columns are wordings and state phrases."""
    try:
        frame = heatmap(project)
    except (NothingToSearchError, ProjectError):
        return {}
    own = frame["form"] == Form.CUSTOM.value
    grid = frame[~own].assign(
        row=frame["form"] + " · " + frame["article"],
        column=frame["wording"] + " · " + frame["phrase"],
    )
    columns = list(dict.fromkeys(grid["column"]))
    rows = [
        {"title": title, "cells": [_cell(cells, name) for name in columns]}
        for title, cells in grid.groupby("row", sort=False)
    ]
    width = max(len(columns), 1)
    for _, question in frame[own].iterrows():
        cells = [_scores(question), *[None] * (width - 1)]
        rows.append({"title": question["question"], "cells": cells})
    return {"columns": columns, "rows": rows}


def _cell(cells: pd.DataFrame, column: str) -> Any:
    found = cells[cells["column"] == column]
    return None if found.empty else _scores(found.iloc[0])


def _scores(question: "pd.Series[Any]") -> Any:
    accuracy, invalid = question["accuracy"], question["invalid"]
    return {
        "question": question["question"],
        "accuracy": None if pd.isna(accuracy) else float(accuracy),
        "invalid": 0.0 if pd.isna(invalid) else float(invalid),
    }
