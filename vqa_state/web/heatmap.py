"""How good each question is on the training images, as plain values for the heatmap."""

import hashlib
from typing import Any

import pandas as pd

from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.questions.grid import Form
from vqa_state.report.frames import heatmap

__all__ = ["heat_value", "questions_digest"]

Value = dict[str, Any]


def heat_value(project: Project) -> Value:
    """Rows are forms and articles, columns wordings and state phrases; own questions stand apart.

    An own question has no wording and no phrase, only a state that its "yes" means. Empty if the
    model was never asked.
    """
    try:
        frame = heatmap(project)
    except (NothingToSearchError, ProjectError):
        return {}
    is_own = frame["form"] == Form.CUSTOM.value
    return _grid(frame[~is_own]) | {"own": _own(frame[is_own], project)}


def questions_digest(project: Project) -> str:
    """Of all that the answers of a question on the training images depend on; "" if unknown."""
    try:
        texts = [question.text for question in project.questions()]
    except ProjectError:
        return ""
    images = [(image.id, image.label) for image in project.labelled(Split.TRAIN)]
    asked = (project.fingerprint, project.augmentation, project.seed, images, texts)
    return hashlib.sha256(repr(asked).encode()).hexdigest()


def _grid(frame: pd.DataFrame) -> Value:
    places = frame.assign(
        row=frame["form"] + " · " + frame["article"],
        column=frame["wording"] + " · " + frame["phrase"],
    )
    columns = list(dict.fromkeys(places["column"]))
    rows = [
        {"title": title, "cells": [_cell(cells, name) for name in columns]}
        for title, cells in places.groupby("row", sort=False)
    ]
    return {"columns": columns, "rows": rows}


def _own(frame: pd.DataFrame, project: Project) -> list[Value]:
    """Those that speak for the positive state first."""
    ordered = frame.sort_values("yes_means", ascending=False, kind="stable")
    return [
        {
            "title": question["question"],
            "yes": project.states.of(int(question["yes_means"])),
            "cell": _scores(question),
        }
        for _, question in ordered.iterrows()
    ]


def _cell(cells: pd.DataFrame, column: str) -> Value | None:
    found = cells[cells["column"] == column]
    return None if found.empty else _scores(found.iloc[0])


def _scores(question: "pd.Series[Any]") -> Value:
    accuracy, invalid = question["accuracy"], question["invalid"]
    return {
        "question": question["question"],
        "accuracy": None if pd.isna(accuracy) else float(accuracy),
        "invalid": 0.0 if pd.isna(invalid) else float(invalid),
    }
