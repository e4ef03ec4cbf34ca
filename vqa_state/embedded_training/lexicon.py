"""The words in which people ask about the things and their states; `words.toml` holds them."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from pydantic import TypeAdapter

from vqa_state.embedded_training.scenes.simulation import Facts

__all__ = [
    "Evidence",
    "Lexicon",
    "QuestionForms",
    "StateWords",
    "ThingWords",
    "lexicon",
    "shares_a_word",
]

#: Degrees of opening up to this are the negative state.
_SHUT = 0.02

#: Words of fewer letters must be equal to be alike.
_SHORTEST = 3


@dataclass(frozen=True, slots=True)
class Evidence:
    """What can be seen of a state beside its name: true where `above` < fact <= `up_to`.

    A question about evidence is answered by a fact of the scene, so it must be answered by looking
    at something else than the label does: how far a leaf stands open, whether its edge shows a gap.

    Attributes:
        fact: the scene's fact, in [0, 1].
        phrases: words that fit "Is this door ...?".
        questions: whole sentences; {} is a noun.
    """

    fact: str
    above: float = -1.0
    up_to: float = 1.0
    phrases: tuple[str, ...] = ()
    questions: tuple[str, ...] = ()

    def holds(self, is_positive: bool, facts: Facts) -> bool | None:
        """Whether it is to be seen in a picture, or None if that is unknown.

        Of a photo only the label is known: enough for "at least slightly open", too little for
        "wide open".
        """
        value = facts.get(self.fact)
        if value is not None:
            return self.above < value <= self.up_to
        if self.fact != "degree" or self.up_to not in (_SHUT, 1.0) or self.above > _SHUT:
            return None
        return is_positive == (self.above == _SHUT)


@dataclass(frozen=True, slots=True)
class StateWords:
    """Names of the two states, and the two answers to "Is it open or closed?"."""

    positive: tuple[str, ...]
    negative: tuple[str, ...]
    answers: tuple[str, str]


@dataclass(frozen=True, slots=True)
class ThingWords:
    """How one thing is spoken of.

    Attributes:
        answer: what an open question about it is answered with.
        nouns: its names.
        states: the name of its `StateWords`.
        evidence: the names of its groups of `Evidence`.
        tails: what follows the nouns; {} is an article.
        has_door: whether questions about another thing with a door fit it, too.
        held_out: nouns that no training question uses; they show whether words that were never
            taught are read. Some share a word with a taught noun, see `shares_a_word`.
    """

    answer: str
    nouns: tuple[str, ...]
    states: str
    evidence: tuple[str, ...]
    tails: tuple[str, ...] = ()
    has_door: bool = False
    held_out: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class QuestionForms:
    """Forms of questions, by their kind; braces are filled with words."""

    yes_no: tuple[str, ...]
    which_state: tuple[str, ...]
    what: tuple[str, ...]
    presence: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Lexicon:
    """All words.

    Attributes:
        generic_nouns: fit anything: the question is then about what the picture shows.
        unrelated: questions that no picture of the things answers.
        paper_wordings: the wordings of the paper's experiments.
        forms, states, things, evidence: see their classes.
    """

    generic_nouns: tuple[str, ...]
    unrelated: tuple[str, ...]
    paper_wordings: Mapping[str, tuple[str, ...]]
    forms: QuestionForms
    states: Mapping[str, StateWords]
    things: Mapping[str, ThingWords]
    evidence: Mapping[str, tuple[Evidence, ...]]

    def states_of(self, thing: str) -> StateWords:
        """The words for a thing's two states."""
        return self.states[self.things[thing].states]

    def evidence_of(self, thing: str) -> tuple[Evidence, ...]:
        """What can be seen of a thing's state."""
        return tuple(one for group in self.things[thing].evidence for one in self.evidence[group])

    def is_unfit(self, shown: str, asked: str) -> bool:
        """Whether a picture of one thing leaves the other's questions without an answer.

        Things with doors are never set apart: "Is this door open?" fits them all.
        """
        both_have_doors = self.things[shown].has_door and self.things[asked].has_door
        return shown != asked and not both_have_doors


@cache
def lexicon() -> Lexicon:
    """The words of `words.toml`, read once."""
    text = files(__package__).joinpath("words.toml").read_text("utf-8")
    return TypeAdapter(Lexicon).validate_python(tomllib.loads(text))


def shares_a_word(noun: str) -> bool:
    """Whether a word of a noun is one of the lexicon's, holds one, or is part of one.

    "icebox" holds "box", "cabin" is part of "cabinet": words are read by their letters, too. Words
    of fewer than three letters must be equal.
    """
    things = lexicon().things.values()
    spoken = " ".join(text for thing in things for text in (*thing.nouns, *thing.tails))
    taught = set(spoken.lower().split()) - {"{}"}
    return any(_alike(word, other) for word in noun.lower().split() for other in taught)


def _alike(word: str, taught: str) -> bool:
    shorter, longer = sorted((word, taught), key=len)
    return word == taught or (len(shorter) >= _SHORTEST and shorter in longer)
