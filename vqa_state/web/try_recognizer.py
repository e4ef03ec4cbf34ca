"""Trying a recognizer on a picture, and what the page shows of its verdict."""

import math
from collections import Counter
from typing import Any

from vqa_state.images.picture_input import PictureInput
from vqa_state.recognizer.recognizer import Recognizer
from vqa_state.recognizer.verdict import Verdict
from vqa_state.search.objectives import Objective
from vqa_state.web import arguments
from vqa_state.web.recognizer_choice import Taken, taken_recognizer
from vqa_state.web.session import Desk
from vqa_state.web.view_data import counted, raw_words

__all__ = ["of_picture", "verdict_value"]

PLAIN = Taken()


def of_picture(
    desk: Desk,
    pid: object,
    objective: object,
    picture: PictureInput,
    taken: Taken = PLAIN,
) -> Any:
    """Recognize a picture with the project's recognizer for this objective, as it was taken.

    Raises:
        RecognizerError: if there is none, or the model is another one.
        NothingToSearchError: if what was taken needs an assessment first.
        ImageError: if the picture cannot be read.
        ModelError: if the model cannot be loaded or gives not all answers.
    """
    chosen = arguments.choice(objective, Objective, "the objective")
    recognizer = taken_recognizer(desk.snapshot(pid), chosen, taken)
    model = desk.model(recognizer.model.name)
    verdict = recognizer.recognize(picture, model, stop_early=taken.stop_early)
    return verdict_value(recognizer, verdict)


def verdict_value(recognizer: Recognizer, verdict: Verdict) -> dict[str, Any]:
    """A verdict as the widget wants it."""
    said: dict[str, Counter[str]] = {}
    for vote in verdict.votes:
        said.setdefault(vote.question, Counter())[raw_words(vote.answer.text, vote.cut_off)] += 1
    return {
        "state": verdict.state,
        "state_name": verdict.state_name,
        "reason": verdict.reason,
        "confidence": None if math.isnan(verdict.confidence) else verdict.confidence,
        "states": [recognizer.states.positive, recognizer.states.negative],
        "votes": [verdict.n_positive, verdict.n_negative, verdict.n_invalid],
        "n_calls": verdict.n_calls,
        "n_skipped": verdict.n_skipped,
        "milliseconds": round(verdict.milliseconds),
        "answers": [[question, counted(texts)] for question, texts in said.items()],
    }
