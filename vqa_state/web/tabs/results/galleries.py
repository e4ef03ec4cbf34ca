"""Part of Results: pictures behind a number, of a question or of a row of the table.

Each comes with a digest of what it is about, so that Results can tell old evidence from new.
"""

import hashlib
from collections.abc import Sequence
from typing import Any

from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.project.project import Project
from vqa_state.project.searches import Results, table_digest
from vqa_state.project.split import Split
from vqa_state.study.assess import Assessment
from vqa_state.study.latency import read_pace
from vqa_state.study.leaderboard import Missed, Standing, standings
from vqa_state.web import arguments
from vqa_state.web.heatmap import questions_digest
from vqa_state.web.recognizer_choice import found_and_assessed
from vqa_state.web.session import Desk
from vqa_state.web.view_data import image_card

__all__ = ["STAR", "choose_question", "choose_row", "evidence", "results_digest"]

STAR = " ★"
"""Behind the name of the recommended row, as the table shows it."""


def results_digest(project: Project, found: Results | None, assessed: Assessment | None) -> str:
    """Of all that the rows of the table and their images depend on; "" without results."""
    if found is None:
        return ""
    searches = [(name, one.subset) for name, one in found.searches.items()]
    tables = [table_digest(one) for one in (found.train, found.test) if one is not None]
    about = (project.chosen, searches, tables, None if assessed is None else assessed.table)
    return hashlib.sha256(repr(about).encode()).hexdigest()


def choose_question(desk: Desk, pid: str, data: Any) -> tuple[Any, str]:
    """Training images with what the model answered to one question, and what that is about."""
    project = desk.snapshot(pid)
    text = arguments.text(arguments.json_object(data).get("question"), "the question")
    if text not in {question.text for question in project.questions()}:
        raise ProjectError("the project has no such question any more; choose another cell")
    images = project.labelled(Split.TRAIN)
    cards = [image_card(project, image.id, [text]) for image in images]
    shown = evidence(pid, project, text, sorted(cards, key=_rightness))
    return shown | {"chosen": True}, questions_digest(project)


def choose_row(desk: Desk, pid: str, data: Any, looked: Any) -> tuple[Any, Any, str]:
    """Images that the chosen row does not recognize: of the training, after a look of the test.

    `looked` is the digest of the results whose test side this page shows, from a counted look.
    """
    project = desk.snapshot(pid)
    found, assessed = found_and_assessed(project)
    if found is None:
        raise NothingToSearchError("images, labels or questions changed; optimize again")
    row = _row(standings(project.chosen, found, assessed, read_pace(project)).rows, data)
    about = results_digest(project, found, assessed)
    texts = [found.train.questions[position].text for position in row.asked]
    train = _side(pid, project, row, texts, Split.TRAIN) | {"chosen": True}
    has_looked = looked == about and project.test_looks > 0 and row.test is not None
    return train, _side(pid, project, row, texts, Split.TEST) if has_looked else {}, about


def evidence(pid: str, project: Project, title: str, cards: Sequence[Any]) -> dict[str, Any]:
    """The value of the evidence widget."""
    states = [project.states.positive, project.states.negative]
    return {"project": pid, "states": states, "title": title, "cards": list(cards)}


def _side(
    pid: str, project: Project, row: Standing, texts: Sequence[str], split: Split
) -> dict[str, Any]:
    score = row.train if split is Split.TRAIN else row.test
    missed = row.train_missed if split is Split.TRAIN else row.test_missed
    n_images = 0 if score is None else score.whole[1]
    kind = "training" if split is Split.TRAIN else "test"
    title = (
        f"{row.name} does not recognize {len(missed)} of the {n_images} {kind} images"
        if missed
        else f"{row.name} recognizes all {n_images} {kind} images"
    )
    return evidence(pid, project, title, [_card(project, one, texts) for one in missed])


def _card(project: Project, missed: Missed, texts: Sequence[str]) -> Any:
    """An image with the verdict that is wrong, or why there is none."""
    card = image_card(project, missed.image_id, texts)
    if missed.verdict:
        reason = f"taken for {project.states.of(missed.verdict)}"
    else:
        reason = "unknown: a tie" if any(card["votes"][:2]) else "unknown: no clear answer"
    return card | {"note": f"{card['note']} · {reason}"}


def _row(rows: Sequence[Standing], data: Any) -> Standing:
    """The row by its name: the reader may have sorted the table."""
    values = arguments.json_object(data).get("row_value")
    name = values[0] if isinstance(values, list) and values else None
    by_name = {row.name: row for row in rows}
    plain = name.removesuffix(STAR) if isinstance(name, str) else None
    if plain not in by_name:
        raise arguments.RequestError("the table has no such row; choose another one")
    return by_name[plain]


def _rightness(card: Any) -> tuple[int, str]:
    """Most wrong first."""
    return card["right"], card["title"]
