"""The questions that the network is trained on, and their answers for every picture."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from vqa_state.embedded_training.lexicon import Evidence, lexicon
from vqa_state.embedded_training.scenes.simulation import Facts

__all__ = ["TrainingQuestion", "make_training_questions"]

T = TypeVar("T")

_ARTICLES = ("a", "the", "this", "that")


@dataclass(frozen=True, slots=True)
class TrainingQuestion:
    """One training question about one thing.

    With `evidence`, the first answer holds where it is to be seen and the second where it is not;
    without, the label decides.
    """

    text: str
    when_true: str
    when_false: str
    evidence: Evidence | None = None

    def answer(self, is_positive: bool, facts: Facts) -> str | None:
        """The right answer for a picture, or None if it is unknown: then it is not asked."""
        holds: bool | None = is_positive
        if self.evidence is not None:
            holds = self.evidence.holds(is_positive, facts)
        if holds is None:
            return None
        return self.when_true if holds else self.when_false


def make_training_questions(
    thing: str, n_questions: int, rng: np.random.Generator
) -> list[TrainingQuestion]:
    """Up to `n_questions` different questions about a thing, in the shares of `_KINDS`."""
    questions: dict[str, TrainingQuestion] = {}
    shares = [share for _, share in _KINDS]
    for kind in rng.choice(len(_KINDS), size=n_questions, p=shares):
        question = _KINDS[kind][0](thing, rng)
        questions.setdefault(question.text, question)
    return list(questions.values())


def _ask_state(thing: str, rng: np.random.Generator) -> TrainingQuestion:
    """A yes/no question about the state, in one case of ten turned round by "not"."""
    states = lexicon().states_of(thing)
    means_positive = bool(rng.random() < 0.5)
    state = _pick(rng, states.positive if means_positive else states.negative)
    if rng.random() < 0.1 and not state.startswith("not "):
        state, means_positive = f"not {state}", not means_positive
    text = _yes_no_text(rng, *_subject(thing, rng), state)
    return TrainingQuestion(text, *(("yes", "no") if means_positive else ("no", "yes")))


def _ask_evidence(thing: str, rng: np.random.Generator) -> TrainingQuestion:
    """A yes/no question about what is to be seen, or how far something is open."""
    evidence = _pick(rng, lexicon().evidence_of(thing))
    if evidence.phrases and (not evidence.questions or rng.random() < 0.7):
        subject, tail = _subject(thing, rng)
        text = _yes_no_text(rng, subject, tail, _pick(rng, evidence.phrases))
    else:
        text = _pick(rng, evidence.questions).format(_pick(rng, lexicon().things[thing].nouns))
    return TrainingQuestion(text, "yes", "no", evidence)


def _ask_unrelated(_: str, rng: np.random.Generator) -> TrainingQuestion:
    """A question that no such picture answers."""
    return TrainingQuestion(_pick(rng, lexicon().unrelated), "none", "none")


def _ask_false_premise(thing: str, rng: np.random.Generator) -> TrainingQuestion:
    """A question about the state of something that the picture does not show."""
    asked = _pick(rng, _others(thing))
    other, states = lexicon().things[asked], lexicon().states_of(asked)
    state = _pick(rng, states.positive + states.negative)
    article = _pick(rng, _ARTICLES)
    subject = _pick(rng, [noun for noun in other.nouns if noun != "door"])
    tail = ""
    if other.tails:
        tail = f" {_pick(rng, other.tails).format(article)}"
    else:
        subject = _with_article(article, subject)
    return TrainingQuestion(_yes_no_text(rng, subject, tail, state), "none", "none")


def _ask_which_state(thing: str, rng: np.random.Generator) -> TrainingQuestion:
    positive, negative = lexicon().states_of(thing).answers
    subject, tail = _subject(thing, rng)
    form = _pick(rng, lexicon().forms.which_state)
    text = form.format(subject=subject, positive=positive, negative=negative, tail=tail)
    return TrainingQuestion(text, positive, negative)


def _ask_what(thing: str, rng: np.random.Generator) -> TrainingQuestion:
    if thing in _SPECIAL and rng.random() < 0.4:
        return _SPECIAL[thing]
    answer = lexicon().things[thing].answer
    return TrainingQuestion(_pick(rng, lexicon().forms.what), answer, answer)


def _ask_presence(thing: str, rng: np.random.Generator) -> TrainingQuestion:
    """Is the thing there? The answer is no for things that the picture does not show."""
    is_there = bool(rng.random() < 0.5)
    words = lexicon().things[thing if is_there else _pick(rng, _others(thing))]
    noun = _pick(rng, [noun for noun in words.nouns if is_there or noun != "door"])
    subject = noun if words.tails else _with_article(_pick(rng, ("a", "a", "any")), noun)
    form = _pick(rng, lexicon().forms.presence)
    if is_there and words.tails:
        # Water may stand in a sink in both states; what is always there is the faucet.
        return TrainingQuestion("Is there a faucet in the image?", "yes", "yes")
    answer = "yes" if is_there else "no"
    return TrainingQuestion(_sentence(form.format(subject)), answer, answer)


def _pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    return options[int(rng.integers(len(options)))]


def _with_article(article: str, noun: str) -> str:
    """Put it before the noun; "a" becomes "an" before a vowel sound, as in "an elevator"."""
    if noun == "it":
        return noun
    return f"an {noun}" if article == "a" and noun[0] in "aeio" else f"{article} {noun}"


def _made_up_word(rng: np.random.Generator) -> str:
    """A word without meaning, so that the network learns to leave unknown words aside."""
    letters = rng.choice(list("abcdefghiklmnoprstuvwy"), size=int(rng.integers(3, 10)))
    return "".join(letters)


def _subject(thing: str, rng: np.random.Generator) -> tuple[str, str]:
    """What the question is about, and its tail: ("this door", "") or ("water", " in a sink")."""
    words, article = lexicon().things[thing], _pick(rng, _ARTICLES)
    if words.tails:
        tail = _pick(rng, words.tails).format(article)
        return _pick(rng, words.nouns), f" {tail}"
    chance = rng.random()
    if chance < 0.8:
        noun = _pick(rng, words.nouns)
    else:
        noun = _pick(rng, lexicon().generic_nouns) if chance < 0.9 else _made_up_word(rng)
    return _with_article(article, noun), _pick(rng, ("",) * 8 + (" in this picture", " now"))


def _yes_no_text(rng: np.random.Generator, subject: str, tail: str, state: str) -> str:
    """A yes/no question; two forms, those of the paper, come four times out of ten each."""
    forms, chance = lexicon().forms.yes_no, rng.random()
    form = forms[0] if chance < 0.4 else forms[1] if chance < 0.8 else _pick(rng, forms[2:])
    return _sentence(form.format(subject=subject, state=state, tail=tail))


def _others(thing: str) -> list[str]:
    """Things that cannot be mistaken for this one."""
    return [other for other in lexicon().things if lexicon().is_unfit(thing, other)]


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


#: The kinds of questions, and how often each is asked.
_KINDS: Sequence[tuple[Callable[[str, np.random.Generator], TrainingQuestion], float]] = (
    (_ask_state, 0.42),
    (_ask_evidence, 0.34),
    (_ask_false_premise, 0.08),
    (_ask_which_state, 0.04),
    (_ask_what, 0.04),
    (_ask_presence, 0.05),
    (_ask_unrelated, 0.03),
)

_SPECIAL = {
    "light": TrainingQuestion(
        "How bright is the room?", "bright", "dark", Evidence("room_bright", 0.5)
    ),
    "display": TrainingQuestion("What does the screen show?", "picture", "nothing"),
    "water": TrainingQuestion("What comes out of the faucet?", "water", "nothing"),
}
