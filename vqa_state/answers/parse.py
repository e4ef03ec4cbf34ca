"""From what a model said to arrays: free text → YES / NO / INVALID → `AnswerTable`.

The raw text is what the store keeps; it is read again each time a table is made, so a better
parser needs no new calls. A change of the rules raises `PARSER_VERSION`.
"""

import re
import unicodedata
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

__all__ = ["PARSER_VERSION", "Answer", "Reading", "read_answer"]

PARSER_VERSION = 1


class Reading(StrEnum):
    """What a free text says to a yes/no question."""

    YES = "yes"
    NO = "no"
    INVALID = "invalid"


@dataclass(frozen=True, slots=True)
class Answer:
    """One answer of a model: its raw text, and how sure it was.

    `p_yes` is P(yes) / (P(yes) + P(no)) in [0, 1], or None where the model has no probabilities.
    Half surrogates in the text, which no file can hold, become "?".
    """

    text: str
    p_yes: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", self.text.encode("utf-8", "replace").decode())
        if self.p_yes is None:
            return
        if not 0.0 <= self.p_yes <= 1.0:
            raise ValueError(f"p_yes must be in [0, 1] or None, got {self.p_yes}")
        object.__setattr__(self, "p_yes", float(self.p_yes))  # not a scalar of an array library

    @property
    def reading(self) -> Reading:
        """Yes, no or neither, by `read_answer`."""
        return read_answer(self.text)

    def verdict(self, yes_means: int) -> int:
        """+1 if the answer speaks for the positive state, -1 for the negative, 0 for neither."""
        return {Reading.YES: yes_means, Reading.NO: -yes_means, Reading.INVALID: 0}[self.reading]


_YES = frozenset({"yes", "yeah", "yep", "yup", "true", "correct"})
_NO = frozenset({"no", "nope", "nah", "false", "incorrect"})
_TAG = re.compile(r"<[^<>]*>")
_ROLE = re.compile(r"^[\W_]*(?:assistant|answer|a)[\s*_\"']*[:\-\n]\s*")
_WORD = re.compile(r"[^\W_]+(?:['-][^\W_]+)*")
_SET_OFF = re.compile(r"\s*(?:[.,;:!\n]|[–—]|-\s)")
_HEDGE = re.compile(
    r"\b(?:not (?:\S+ )?(?:sure|certain)|not (?:really )?(?:clear|possible to)|unsure|uncertain"
    r"|unclear|unknown|maybe|perhaps|possibly|probably|likely|might be|could be"
    r"|(?:hard|difficult|impossible) to (?:tell|say|see|know|judge|answer|determine|decide)"
    r"|(?:yes|no),? (?:or|and) (?:no|yes)|unable to|no (?:idea|clue)|(?:don't|do not) know"
    r"|(?:cannot|can't|can not|couldn't|could not) (?:really )?(?:be )?"
    r"(?:tell|say|see|know|judge|answer|determined?|decided?))\b"
)
_NOBODY = re.compile(r"\W*no (?:one|answer|image|picture|information|comment|response)\b")


@lru_cache(maxsize=1024)  # a model says the same few things again and again
def read_answer(text: str) -> Reading:
    """Read a clear yes or no out of free text; never guess from content words.

    Tags, a model's thinking and a leading "Answer:" are dropped; thinking that was cut off before
    its end leaves no answer. The first word must be yes- or
    no-like as a whole word ("None", "Not sure", "Now closed" are not "no"); a hedge anywhere makes
    the answer invalid; when both yes and no occur, the first counts only if punctuation sets it
    off and a sentence follows. "Open" or "closed" alone is invalid: what it says depends on the
    question.
    """
    plain = _plain(text)
    words = _WORD.findall(plain)
    said = [_yes_or_no(word) for word in words]
    if not said or said[0] is None or _HEDGE.search(plain) or _NOBODY.match(plain):
        return Reading.INVALID
    if len({reading for reading in said if reading}) == 1:
        return said[0]
    only_yes_and_no = all(said)
    end_of_first = plain.index(words[0]) + len(words[0])
    if only_yes_and_no or not _SET_OFF.match(plain, end_of_first):
        return Reading.INVALID
    return said[0]


def _plain(text: str) -> str:
    plain = unicodedata.normalize("NFKC", text).replace("’", "'").replace("‐", "-").lower()
    plain = plain.rpartition("</think>")[2].partition("<think>")[0]
    return _ROLE.sub("", _TAG.sub(" ", plain).strip())


def _yes_or_no(word: str) -> Reading | None:
    if word in _YES:
        return Reading.YES
    return Reading.NO if word in _NO else None
