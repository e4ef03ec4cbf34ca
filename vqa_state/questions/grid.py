"""The question grid: forms × articles × state phrases × wordings, and the user's own questions.

Source: paper II-A. Its eleven experiments come out with 16 to 64 questions.
"""

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import product

from vqa_state.errors import QuestionError

__all__ = [
    "MAX_QUESTIONS",
    "Article",
    "BuiltGrid",
    "Form",
    "Question",
    "QuestionGrid",
    "StatePhrase",
    "Wording",
    "phrases_for",
]

MAX_QUESTIONS = 1000
"""Each question costs a call for every copy of every image; beyond this a grid is a mistake."""

MAX_TEXT = 300
MAX_PART = 80
"""Of a wording, a tail or a state phrase: so that no sentence made of them is too long."""

_ARTICLE_SLOT = "{article}"


class Form(StrEnum):
    """The sentence around the state."""

    IS = "is"
    DOES = "does"
    CUSTOM = "custom"


class Article(StrEnum):
    """The word before the thing; "a" becomes "an" before a vowel sound."""

    A = "a"
    THE = "the"
    THIS = "this"
    THAT = "that"


@dataclass(frozen=True, slots=True)
class Wording:
    """A name for the thing, and for some things a place that carries the article instead.

    `Wording("elevator door")` gives "Is this elevator door open?";
    `Wording("water", "from {article} faucet")` gives "Is water running from this faucet?".
    """

    noun: str
    tail: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "noun", clean_text(self.noun, "a wording", MAX_PART))
        if "|" in self.noun or _ARTICLE_SLOT in self.noun:
            raise QuestionError(
                f"the wording {self.noun!r} must be a plain noun; '|' stands between noun and tail,"
                f" and {_ARTICLE_SLOT} in the tail, as in 'water | in {_ARTICLE_SLOT} sink'"
            )
        if self.tail is None:
            return
        tail = clean_text(self.tail, "a wording's tail", MAX_PART)
        before_last = tail.split()[:-1]
        if tail.count(_ARTICLE_SLOT) != 1 or _ARTICLE_SLOT not in before_last:
            raise QuestionError(
                f"the tail {tail!r} of the wording {self.noun!r} must hold {_ARTICLE_SLOT} once, "
                f"as a word of its own, followed by a noun, as in 'in {_ARTICLE_SLOT} sink'"
            )
        object.__setattr__(self, "tail", tail)

    @classmethod
    def parse(cls, line: str) -> "Wording":
        """Read "noun" or "noun | tail", as a user types it and `str` writes it.

        Raises:
            QuestionError: if a part is empty or the tail has no place for an article.
        """
        noun, bar, tail = line.partition("|")
        return cls(noun, tail if bar else None)

    def __str__(self) -> str:
        return self.noun if self.tail is None else f"{self.noun} | {self.tail}"


@dataclass(frozen=True, slots=True)
class StatePhrase:
    """Words for a state, and which state a "yes" to them speaks for (+1 positive, -1 negative)."""

    text: str
    yes_means: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", clean_text(self.text, "a state phrase", MAX_PART))
        check_polarity(self.yes_means, self.text)


@dataclass(frozen=True, slots=True)
class Question:
    """A yes/no sentence, what "yes" means, and where it stands on the four axes of the grid.

        Question("Is there a gap at the door's edge?", yes_means=1)

    Attributes:
        text: at most 300 characters.
        yes_means: +1 if a yes speaks for the positive state, -1 if for the negative one.
        form, article, phrase, wording: of the grid; those of your own questions have none.

    Raises:
        QuestionError: if the text is empty, too long or holds control characters, or `yes_means`
            is another number.
    """

    text: str
    yes_means: int
    form: Form = Form.CUSTOM
    article: Article | None = None
    phrase: str | None = None
    wording: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", clean_text(self.text, "a question"))
        check_polarity(self.yes_means, self.text)


@dataclass(frozen=True, slots=True)
class BuiltGrid:
    """What a grid gives: the questions to ask, and those that are not asked, with the reason."""

    questions: tuple[Question, ...]
    switched_off: tuple[Question, ...]
    duplicates: tuple[Question, ...]


@dataclass(frozen=True, slots=True)
class QuestionGrid:
    """The axes of the grid, the user's own questions, and the texts that are switched off."""

    wordings: tuple[Wording, ...] = ()
    phrases: tuple[StatePhrase, ...] = ()
    forms: tuple[Form, ...] = (Form.IS, Form.DOES)
    articles: tuple[Article, ...] = tuple(Article)
    custom: tuple[Question, ...] = ()
    switched_off: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "switched_off", tuple(sorted(set(self.switched_off))))
        if Form.CUSTOM in self.forms:
            raise QuestionError("a grid has the forms 'is' and 'does'; own questions go beside it")
        n_cells = len(self.wordings) * len(self.phrases) * len(self.forms) * len(self.articles)
        if n_cells + len(self.custom) > MAX_QUESTIONS:
            raise QuestionError(
                f"this grid has {n_cells + len(self.custom):,} questions; at most "
                f"{MAX_QUESTIONS:,} are allowed: take out wordings, phrases or own questions"
            )

    def build(self) -> BuiltGrid:
        """All questions once: a second one with the same text is dropped and listed."""
        seen: dict[str, Question] = {}
        duplicates = []
        for question in (*self._cells(), *self.custom):
            if question.text in seen:
                duplicates.append(question)
            else:
                seen[question.text] = question
        return BuiltGrid(
            questions=tuple(q for t, q in seen.items() if t not in self.switched_off),
            switched_off=tuple(q for t, q in seen.items() if t in self.switched_off),
            duplicates=tuple(duplicates),
        )

    def _cells(self) -> Iterator[Question]:
        axes = product(self.forms, self.wordings, self.phrases, self.articles)
        for form, wording, phrase, article in axes:
            yield Question(
                text=_sentence(form, wording, phrase.text, article),
                yes_means=phrase.yes_means,
                form=form,
                article=article,
                phrase=phrase.text,
                wording=" ".join(filter(None, (wording.noun, wording.tail))),
            )


def phrases_for(positive: str, negative: str | None = None) -> tuple[StatePhrase, StatePhrase]:
    """A state and its antonym; without one, "not" and the state."""
    return StatePhrase(positive, 1), StatePhrase(negative or f"not {positive}", -1)


def clean_text(text: str, what: str, longest: int = MAX_TEXT) -> str:
    """`text` with single spaces; it becomes part of a question, never of a path or a page.

    Raises:
        QuestionError: if it is empty, too long or holds control characters.
    """
    plain = " ".join(text.split())
    if not plain:
        raise QuestionError(f"{what} is empty; type at least one word")
    if len(plain) > longest:
        raise QuestionError(
            f"{what} has {len(plain)} characters; at most {longest} are allowed: shorten it"
        )
    if any(unicodedata.category(character) in {"Cc", "Cs"} for character in plain):
        raise QuestionError(f"{what} holds control characters: {plain!r}; type it again")
    return plain


def check_polarity(yes_means: int, text: str) -> None:
    """Refuse anything but +1 and -1 as the state that "yes" speaks for."""
    if yes_means not in (-1, 1):
        raise QuestionError(
            f"'yes' to {text!r} must mean the positive (+1) or the negative state (-1), "
            f"got {yes_means!r}"
        )


def _sentence(form: Form, wording: Wording, state: str, article: Article) -> str:
    """Source: paper II-A, with our rule for tails: there the article stands in the tail."""
    if wording.tail is None:
        subject, tail = f"{_before(wording.noun, article)} {wording.noun}", ""
    else:
        start, noun = wording.tail.split(_ARTICLE_SLOT)
        subject, tail = wording.noun, f" {start}{_before(noun, article)}{noun}"
    if form is Form.IS:
        return f"Is {subject} {state}{tail}?"
    return f"Does this image look like {subject} is {state}{tail}?"


def _before(noun: str, article: Article) -> str:
    return _a_or_an(noun.strip()) if article is Article.A else article.value


def _a_or_an(noun: str) -> str:
    """The article by its sound: an hour, a unicorn, an LED, a USB port.

    The `inflect` package knows no more of these and takes four seconds to import.
    """
    word = noun.split()[0]
    if word.isupper() and word[0].isalpha() and word not in _SPOKEN_AS_A_WORD:
        return "an" if word[0] in "AEFHILMNORSX" else "a"
    return "an" if _VOWEL_SOUND.match(word.lower()) else "a"


_SPOKEN_AS_A_WORD = frozenset(
    {"HEPA", "LAN", "LASER", "LIDAR", "NAS", "RADAR", "RAM", "ROM", "SIM", "SONAR"}
)
_VOWEL_SOUND = re.compile(
    r"hour|honest|honou?r|heir|[fhlmnrsx]-|8|1[18](?!\d)"
    r"|(?!uni(?!dent|ll|m|n)|us[abeiu]|ut[eio]|u[bk-]|ur[ai]|eu|ewe|one\b|once\b)[aeiou]"
)
