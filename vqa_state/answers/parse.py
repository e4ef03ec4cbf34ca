"""Free text → yes, no or invalid: what a careful person would say it answers.

The rules are for English and stand in docs/recognizer.md, so that a reader can be written in any
language; why they are so is in docs/decisions/0018-answers-as-they-are.md.
"""

import re
import unicodedata
from enum import StrEnum
from functools import lru_cache

from vqa_state.answers.thinking import without_thinking

__all__ = ["PARSER_VERSION", "Reading", "read_answer"]

#: Of the rules; a change of them raises it.
PARSER_VERSION = 2


class Reading(StrEnum):
    """What a free text says to a yes/no question."""

    YES = "yes"
    NO = "no"
    INVALID = "invalid"


_YES = frozenset({"yes", "yeah", "yep", "yup", "true", "correct"})
_NO = frozenset({"no", "nope", "nah", "false", "incorrect"})
_WORD = re.compile(r"[^\W_]+(?:['-][^\W_]+)*")

#: Marks that dress a text and say nothing.
_TAG = re.compile(r"<[^<>]*>|\\(?:text|textbf|mathrm|mathbf)\s*\{")
_BOX = re.compile(r"\\f?boxe?d?\s*\{")
_ROLE = re.compile(r"^[\W_]*(?:\d{1,2}[.)]\s+[\W_]*)?(?:(?:assistant|a)[\s*_\"']*[:\-\n]\s*)?")

#: What announces an answer, where a sentence or a field begins.
_LEAD = re.compile(
    r"(?:^|[.!?;\n]|,\s*\"|\b(?:so|thus|therefore|hence)\b,?)[\s*_\"'#>{(\[]{0,8}"
    r"(?:(?:so|thus|therefore|hence)\b,?\s+)?(?:(?:the|my)\s+)?"
    r"(?:(?:final|correct|short|best)\s+)?answer(?:\s+to\s+(?:the|this|that|your)\s+question)?"
    r"[\s*_\"'`]{0,8}(?:is\b|[:=\-–—\n])"
)

#: Behind a first word that punctuation sets off, a new clause begins.
_SET_OFF = re.compile(r"[\"'*_`)\]}”»]*\s*(?:[.,;:!\n]|[–—]|-\s)")

#: "No" and these can be about the noun behind them, unless a sentence begins there.
_OF_A_NOUN = frozenset({"no", "true", "false", "correct", "incorrect"})
_NEXT = re.compile(r"[\"'*_`)\]}”»]*[^\S\n]+([^\W_]+(?:['-][^\W_]+)*)|\.[^\S\n]*(\d)")
_BEGINNER = re.compile(
    r"the|this|that|that's|these|those|it|it's|its|there|there's|they|he|she|we|you|i|i'm|i've|a|an"
    r"|because|since|as|but|not"
)

#: A changed mind: a word of the other side (OTHER) set off, or at the head of a sentence.
_TURN = (
    r"(?:[.,;:!?\n–—(]|\s-|\b(?:wait|actually|rather|mean|sorry|hmm|oh|well|but|answer is)\b,?)"
    r"[\s\"'*_]{0,8}(?:OTHER)(?=[\s\"'*_)]{0,8}(?:$|[.,;:!?\n–—]|-\s))"
    r"|(?:[.;!?\n]|\b(?:wait|actually|rather|mean|sorry|hmm|oh|well|but)\b,?)[\s\"'*_]{0,8}"
    r"(?:OTHER)\s+(?:it|it's|the|this|that|there|they|i)\b"
    r"|,\s{0,8}no\s+(?:it|it's|the|this|that|they|i)\b"
)
_TAKEN_BACK = re.compile(
    r"[.,;:!?\n–—]\s{0,8}(?:but\s+|oh,?\s+|hmm,?\s+|or\s+)?(?:(?:wait|hold on|scratch that"
    r"|correction|on second thoughts?|i was wrong|i take that back|my mistake)\s{0,8}"
    r"(?:$|[.,;:!?\n–—])|let me correct\b)|[.;!?\n–—]\s{0,8}actually\b"
)

_HEDGE = re.compile(
    r"\b(?:not (?:\S+ )?(?:sure|certain)|not (?:really )?(?:clear|possible to)|unsure|uncertain"
    r"|unclear|unknown|maybe|perhaps|possibly|probably|likely|might|may be|could be|guess(?:ing)?"
    r"|depend(?:s|ing)?|either way|ambiguous|not applicable|unless|if so|(?:yes|no),? if"
    r"|(?:hard|difficult|impossible) to (?:tell|say|see|know|judge|answer|determine|decide)"
    r"|too \w+ to (?:tell|say|see|know|judge|answer|determine|decide)"
    r"|(?:yes|no),? (?:or|and) (?:no|yes)|unable to|no (?:idea|clue)|(?:don't|do not) know"
    r"|(?:cannot|can't|can not|couldn't|could not) (?:really )?(?:be )?"
    r"(?:tell|say|see|know|judge|answer|determined?|decided?)"
    r"|no (?:image|picture|photo|input)s? (?:was|were|is|has|given|provided|attached|available))\b"
)

#: A letter that is not Latin, or a word of another language: a hedge in it could not be seen.
_FOREIGN = re.compile(
    r"[^\W\d_\u0000-\u024f\u1e00-\u1eff]"
    r"|\b(?:la|le|les|el|los|las|lo|il|gli|è|é|es|está|est|se|sé|puede|puedo|que|qué|che|jest|je|nie"
    r"|není|jo|ist|das|der|não|nu|non)\b"
)


@lru_cache(maxsize=1024)  # a model says the same few things again and again
def read_answer(text: str) -> Reading:
    """Read a clear yes or no out of free text; never guess from content words.

    Thinking is dropped, closed or not. The first word, or the first behind "the answer is", must be
    a yes or no of its own: "No doubt" and "No visible door" deny a noun and are invalid, as are a
    hedge anywhere, a changed mind ("Yes. Actually, no") and another language than English. "Open"
    or "closed" alone is invalid: what it says depends on the question.
    """
    plain = _plain(text)
    if _HEDGE.search(plain) or _FOREIGN.search(plain):
        return Reading.INVALID
    parts = [part for part in _LEAD.split(plain) if _WORD.search(part)]
    if not parts:
        return Reading.INVALID
    *earlier, last = map(_read_part, parts)
    contradicted = {Reading.YES, Reading.NO} <= {*earlier, last}
    return Reading.INVALID if contradicted else last


def _plain(text: str) -> str:
    plain = unicodedata.normalize("NFKC", text).replace("’", "'").replace("‐", "-").lower()
    plain = _BOX.sub("\nanswer: ", without_thinking(plain))
    return _ROLE.sub("", _TAG.sub(" ", plain).strip())


def _read_part(part: str) -> Reading:
    """What one announced answer says, or a text that announces none."""
    words = list(_WORD.finditer(part))
    said = [_yes_or_no(word[0]) for word in words]
    rest = part[words[0].end() :]
    if said[0] is None or _denies_a_noun(words[0][0], rest) or _TAKEN_BACK.search(rest):
        return Reading.INVALID
    if len({reading for reading in said if reading}) == 1:
        return said[0]
    if all(said) or not _SET_OFF.match(rest) or _TURNS[said[0]].search(rest):
        return Reading.INVALID
    return said[0]


def _denies_a_noun(word: str, rest: str) -> bool:
    """Whether the first word belongs to what follows: "no doubt", "no. 3", "true colours"."""
    follows = _NEXT.match(rest)
    if word not in _OF_A_NOUN or follows is None:
        return False
    next_word = follows[1] or ""
    return not _BEGINNER.fullmatch(next_word) and _yes_or_no(next_word) is None


def _yes_or_no(word: str) -> Reading | None:
    if word in _YES:
        return Reading.YES
    return Reading.NO if word in _NO else None


_TURNS = {
    Reading.YES: re.compile(_TURN.replace("OTHER", "|".join(sorted(_NO)))),
    Reading.NO: re.compile(_TURN.replace("OTHER", "|".join(sorted(_YES)))),
}
