"""The questions that the network is trained on, and their answers for every picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from vqa_state.embedded_training.evidence import EVIDENCE, Evidence
from vqa_state.embedded_training.lexicon import LEXICON, OPENABLE, UNRELATED, Entry
from vqa_state.embedded_training.scenes.stage import Facts

__all__ = ["Drill", "make_drills"]

T = TypeVar("T")

_ARTICLES = ("a", "the", "this", "that")

_IS = "Is {subject} {state}{tail}?"
_DOES = "Does this image look like {subject} is {state}{tail}?"
_OTHER_FORMS = (
    "Can you see that {subject} is {state}{tail}?",
    "Do you think {subject} is {state}{tail}?",
    "Is it true that {subject} is {state}{tail}?",
    "{subject} is {state}{tail}, right?",
    "Would you say that {subject} is {state}{tail}?",
    "Does it look as if {subject} is {state}{tail}?",
    "Does {subject} look {state}{tail}?",
    "Is {subject} in the picture {state}{tail}?",
    "Has {subject} been left {state}{tail}?",
)

#: Nouns that fit anything: the question is then about what the picture shows.
_GENERIC = ("thing", "object", "it", "item", "front", "device", "one", "part", "furniture")

#: How often each kind of question is asked.
_KINDS = (
    "state",
    "evidence",
    "false_premise",
    "which_state",
    "what",
    "presence",
    "unrelated",
)
_SHARES = (0.42, 0.34, 0.08, 0.04, 0.04, 0.05, 0.03)


@dataclass(frozen=True, slots=True)
class Drill:
    """One training question about one thing.

    With `evidence`, the first answer holds where it is to be seen and the second where it is not;
    without, the label decides. A picture of which nobody knows is not asked.
    """

    text: str
    when_true: str
    when_false: str
    evidence: Evidence | None = None

    def answer(self, is_positive: bool, facts: Facts) -> str | None:
        """The right answer for a picture, or None if nobody knows it."""
        holds: bool | None = is_positive
        if self.evidence is not None:
            holds = self.evidence.holds(is_positive, facts)
        if holds is None:
            return None
        return self.when_true if holds else self.when_false


def make_drills(thing: str, n_drills: int, rng: np.random.Generator) -> list[Drill]:
    """Up to `n_drills` different questions about a thing, in the shares of this file."""
    drills: dict[str, Drill] = {}
    for kind in rng.choice(_KINDS, size=n_drills, p=_SHARES):
        drill = _MAKERS[str(kind)](thing, rng)
        drills.setdefault(drill.text, drill)
    return list(drills.values())


def _pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    return options[int(rng.integers(len(options)))]


def _with_article(article: str, noun: str) -> str:
    """Put it before the noun; "a" becomes "an" before a vowel sound, as in "an elevator"."""
    if noun == "it":
        return noun
    return f"an {noun}" if article == "a" and noun[0] in "aeio" else f"{article} {noun}"


def _made_up_word(rng: np.random.Generator) -> str:
    """A word that nobody has ever asked about, so that unknown words come to mean nothing."""
    letters = rng.choice(list("abcdefghiklmnoprstuvwy"), size=int(rng.integers(3, 10)))
    return "".join(letters)


def _subject(entry: Entry, rng: np.random.Generator) -> tuple[str, str]:
    """What the question is about, and its tail: ("this door", "") or ("water", " in a sink")."""
    article = _pick(rng, _ARTICLES)
    if entry.tails:
        tail = _pick(rng, entry.tails).format(article)
        return _pick(rng, entry.nouns), f" {tail}"
    chance = rng.random()
    if chance < 0.8:
        noun = _pick(rng, entry.nouns)
    else:
        noun = _pick(rng, _GENERIC) if chance < 0.9 else _made_up_word(rng)
    return _with_article(article, noun), _pick(rng, ("",) * 8 + (" in this picture", " now"))


def _form(rng: np.random.Generator) -> str:
    chance = rng.random()
    return _IS if chance < 0.4 else _DOES if chance < 0.8 else _pick(rng, _OTHER_FORMS)


def _ask_state(thing: str, rng: np.random.Generator) -> Drill:
    """A yes/no question about the state, in one case of ten turned round by "not"."""
    entry = LEXICON[thing]
    means_positive = bool(rng.random() < 0.5)
    state = _pick(rng, entry.positive if means_positive else entry.negative)
    if rng.random() < 0.1 and not state.startswith("not "):
        state, means_positive = f"not {state}", not means_positive
    subject, tail = _subject(entry, rng)
    text = _sentence(_form(rng).format(subject=subject, state=state, tail=tail))
    return Drill(text, *(("yes", "no") if means_positive else ("no", "yes")))


def _ask_evidence(thing: str, rng: np.random.Generator) -> Drill:
    """A yes/no question about what is to be seen, or how far something is open."""
    entry, evidence = LEXICON[thing], _pick(rng, EVIDENCE[thing])
    if evidence.phrases and (not evidence.questions or rng.random() < 0.7):
        subject, tail = _subject(entry, rng)
        state = _pick(rng, evidence.phrases)
        text = _sentence(_form(rng).format(subject=subject, state=state, tail=tail))
    else:
        text = _pick(rng, evidence.questions).format(_pick(rng, entry.nouns))
    return Drill(text, "yes", "no", evidence)


def _ask_unrelated(thing: str, rng: np.random.Generator) -> Drill:
    """A question that no such picture answers."""
    return Drill(_pick(rng, UNRELATED), "none", "none")


def _ask_false_premise(thing: str, rng: np.random.Generator) -> Drill:
    """A question about the state of something that the picture does not show."""
    other = LEXICON[_pick(rng, _others(thing))]
    state = _pick(rng, other.positive + other.negative)
    article = _pick(rng, _ARTICLES)
    noun = _pick(rng, [noun for noun in other.nouns if noun != "door"])
    tail = f" {_pick(rng, other.tails).format(article)}" if other.tails else ""
    subject = noun if other.tails else _with_article(article, noun)
    text = _sentence(_form(rng).format(subject=subject, state=state, tail=tail))
    return Drill(text, "none", "none")


def _ask_which_state(thing: str, rng: np.random.Generator) -> Drill:
    entry = LEXICON[thing]
    positive, negative = entry.states
    subject, tail = _subject(entry, rng)
    form = _pick(
        rng,
        (
            "Is {subject} {positive} or {negative}{tail}?",
            "Is {subject} {negative} or {positive}{tail}?",
            "What is the state of {subject}{tail}?",
            "Does {subject} look {positive} or {negative}{tail}?",
        ),
    )
    text = form.format(subject=subject, positive=positive, negative=negative, tail=tail)
    return Drill(text, positive, negative)


def _ask_what(thing: str, rng: np.random.Generator) -> Drill:
    special = _SPECIAL.get(thing)
    if special is not None and rng.random() < 0.4:
        return special
    text = _pick(
        rng,
        (
            "What is this?",
            "What is shown?",
            "What thing is in the picture?",
            "What do you see here?",
            "Which object is this?",
        ),
    )
    return Drill(text, LEXICON[thing].answer, LEXICON[thing].answer)


def _ask_presence(thing: str, rng: np.random.Generator) -> Drill:
    """Is the thing there? The answer is no for things that the picture does not show."""
    is_there = bool(rng.random() < 0.5)
    entry = LEXICON[thing if is_there else _pick(rng, _others(thing))]
    nouns = [noun for noun in entry.nouns if is_there or noun != "door"]
    noun = _pick(rng, nouns)
    subject = noun if entry.tails else _with_article(_pick(rng, ("a", "a", "any")), noun)
    form = _pick(rng, ("Is there {} in the image?", "Can you see {} here?", "Is {} shown?"))
    if is_there and entry.tails:
        # Water may stand in a sink in both states; what is always there is the faucet.
        return Drill("Is there a faucet in the image?", "yes", "yes")
    answer = "yes" if is_there else "no"
    return Drill(_sentence(form.format(subject)), answer, answer)


def _others(thing: str) -> list[str]:
    """Things that cannot be mistaken for this one: doors of all kinds are never set apart."""
    return [
        other
        for other in LEXICON
        if other != thing and not (other in OPENABLE and thing in OPENABLE)
    ]


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


_MAKERS = {
    "state": _ask_state,
    "evidence": _ask_evidence,
    "false_premise": _ask_false_premise,
    "which_state": _ask_which_state,
    "what": _ask_what,
    "presence": _ask_presence,
    "unrelated": _ask_unrelated,
}

_SPECIAL = {
    "light": Drill("How bright is the room?", "bright", "dark", Evidence("room_bright", 0.5, 1.0)),
    "display": Drill("What does the screen show?", "picture", "nothing"),
    "water": Drill("What comes out of the faucet?", "water", "nothing"),
}
