"""Questions with nouns that were never taught, and questions about what a picture does not show."""

from collections.abc import Mapping, Sequence
from typing import Any

from vqa_state.embedded_training.dataset import Example
from vqa_state.embedded_training.experiments import asked_with, questions_about
from vqa_state.embedded_training.intervals import balanced_interval
from vqa_state.embedded_training.lexicon import lexicon, shares_a_word
from vqa_state.embedded_training.measurement_cache import AnswerCache
from vqa_state.embedded_training.measuring import whole_tally
from vqa_state.questions.grid import Question

__all__ = ["measure_nouns", "measure_premises"]

#: Pictures of each thing, both states alike.
_N_NOUNS = 60
_N_PREMISES = 20


def measure_nouns(
    answers: AnswerCache, thing: str, pictures: Sequence[Example]
) -> list[dict[str, Any]]:
    """Accuracy of the grid in nouns that training never used, with a 95 % interval.

    Nouns that share a word with a taught one ("front door") and wholly new ones ("exit") are
    measured apart; a kind of which a thing has none is left out.
    """
    rows = []
    for is_new in (True, False):
        nouns = tuple(n for n in lexicon().things[thing].held_out if shares_a_word(n) != is_new)
        if nouns:
            table = answers.ask(pictures[:_N_NOUNS], asked_with(thing, nouns))
            tally = whole_tally(table, range(table.n_questions))
            rows.append(
                {
                    "thing": thing,
                    "is_new": is_new,
                    "nouns": list(nouns),
                    "n_pictures": len(pictures[:_N_NOUNS]),
                    "balanced": round(tally.balanced("asked"), 4),
                    "interval": balanced_interval(tally, "asked"),
                }
            )
    return rows


def measure_premises(
    answers: AnswerCache, thing: str, pictures: Sequence[Example], things: Sequence[str]
) -> dict[str, Any]:
    """How often questions about each other thing are refused, before pictures of this one.

    Every "yes" or "no" is a mistake there; any other answer refuses.
    """
    grids = {other: questions_about(other) for other in things if lexicon().is_unfit(thing, other)}
    texts = {question.text: question for grid in grids.values() for question in grid}
    table = answers.ask(pictures[:_N_PREMISES], tuple(texts.values()))
    places = {text: number for number, text in enumerate(texts)}
    return {
        "shown": thing,
        "n_pictures": table.n_images,
        "refused": {
            other: round(float((table.verdicts[:, :, _columns(grid, places)] == 0).mean()), 4)
            for other, grid in grids.items()
        },
    }


def _columns(grid: Sequence[Question], places: Mapping[str, int]) -> list[int]:
    return [places[question.text] for question in grid]
