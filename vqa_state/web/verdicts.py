"""Trying a recognizer on a picture, and what the page shows of its verdict."""

import math
from collections import Counter
from typing import Any

from PIL import Image

from vqa_state.recognizer import Recognizer
from vqa_state.scores import Objective
from vqa_state.tuning import recognizer_path
from vqa_state.verdict import Verdict
from vqa_state.web import checks
from vqa_state.web.desk import Desk
from vqa_state.web.views import counted

__all__ = ["of_picture", "verdict_value"]


def of_picture(desk: Desk, pid: object, objective: object, picture: bytes | Image.Image) -> Any:
    """Recognize a picture with the project's recognizer for this objective.

    Raises:
        RecognizerError: if there is none, or the model is another one.
        ImageError: if the picture cannot be read.
        ModelError: if the model cannot be loaded or gives not all answers.
    """
    chosen = checks.choice(objective, Objective, "the objective")
    with desk.reading(pid) as project:
        path = recognizer_path(project, chosen)
    recognizer = Recognizer.load(path)
    verdict = recognizer.recognize(picture, desk.model(recognizer.model.name))
    return verdict_value(recognizer, verdict)


def verdict_value(recognizer: Recognizer, verdict: Verdict) -> dict[str, Any]:
    """A verdict as the widget wants it."""
    said: dict[str, Counter[str]] = {}
    for vote in verdict.votes:
        said.setdefault(vote.question, Counter())[vote.answer.text] += 1
    return {
        "state": verdict.state,
        "state_name": verdict.state_name,
        "reason": verdict.reason,
        "confidence": None if math.isnan(verdict.confidence) else verdict.confidence,
        "states": [recognizer.states.positive, recognizer.states.negative],
        "votes": [verdict.n_positive, verdict.n_negative, verdict.n_invalid],
        "n_calls": verdict.n_calls,
        "milliseconds": round(verdict.milliseconds),
        "answers": [[question, counted(texts)] for question, texts in said.items()],
    }
