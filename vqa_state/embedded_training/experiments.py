"""The question grids of the paper's experiments, one for each of the ten things, and cues."""

from collections.abc import Mapping
from types import MappingProxyType

from vqa_state.embedded_training.lexicon import lexicon
from vqa_state.questions.cues import ready_cues
from vqa_state.questions.grid import Question, QuestionGrid, Wording, phrases_for

__all__ = ["asked_with", "cues_about", "grid_about", "questions_about", "states_of"]

_STATES: Mapping[str, tuple[str, str | None]] = MappingProxyType(
    {"light": ("on", "off"), "display": ("on", "off"), "water": ("running", None)}
)


def grid_about(thing: str) -> QuestionGrid:
    """The grid of the paper's experiment on this thing, or on "various_doors"."""
    wordings = tuple(Wording.parse(line) for line in lexicon().paper_wordings[thing])
    return QuestionGrid(wordings, phrases_for(*states_of(thing)))


def states_of(thing: str) -> tuple[str, str | None]:
    """The positive and the negative state; None where the negative is "not" and the positive."""
    return _STATES.get(thing, ("open", "closed"))


def questions_about(thing: str) -> tuple[Question, ...]:
    """The 16 to 64 questions of the paper's experiment on this thing."""
    return grid_about(thing).build().questions


def cues_about(thing: str) -> tuple[Question, ...]:
    """Ready cues in the last wording of the experiment, beside the questions of its grid."""
    return ready_cues(states_of(thing)[0], Wording.parse(lexicon().paper_wordings[thing][-1]))


def asked_with(thing: str, nouns: tuple[str, ...]) -> tuple[Question, ...]:
    """The paper's grid in other nouns."""
    tails = [line.partition("|")[2].strip() for line in lexicon().paper_wordings[thing]]
    wordings = tuple(
        Wording(noun, tail or None) for noun, tail in zip(nouns, tails * len(nouns), strict=False)
    )
    return QuestionGrid(wordings, phrases_for(*states_of(thing))).build().questions
