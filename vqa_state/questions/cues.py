"""Ready words for what can be seen of a state: how far it goes, a gap, the inside, a stream.

The grid of the paper asks for a state in one pair of words. A model whose reading leans to one
state answers all of it alike. Cues ask for something else: "wide open" asks for more than "open"
does, "is there a gap at its edge" looks elsewhere. So they err on other images, and a search has a
choice.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from vqa_state.errors import QuestionError
from vqa_state.questions.grid import Article, Question, QuestionGrid, StatePhrase, Wording

__all__ = ["CUED_STATES", "ready_cues", "with_cues"]

#: Positive phrases, negative phrases, and whole questions with what "yes" speaks for.
_Cues = tuple[tuple[str, ...], tuple[str, ...], tuple[tuple[str, int], ...]]

_OPEN: _Cues = (
    (
        "at least slightly open",
        "clearly open",
        "at least half open",
        "wide open",
        "completely open",
        "turned out of its frame",
    ),
    (
        "completely closed",
        "closed or almost closed",
        "less than half open",
        "not wide open",
        "flush with its frame",
    ),
    (
        ("Is the inside visible?", 1),
        ("Can one look inside?", 1),
        ("Is there a gap at its edge?", 1),
        ("Is there an opening in the middle of the picture?", 1),
        ("Does something stand at an angle to the front?", 1),
        ("Is the front one closed surface?", -1),
        ("Is everything behind the front hidden?", -1),
    ),
)

_ON: _Cues = (
    ("at least dimly lit", "lit up", "glowing", "shining brightly", "very bright"),
    ("completely dark", "dark", "not bright", "dim or dark"),
    (
        ("Does light come from it?", 1),
        ("Is it brighter than what is around it?", 1),
        ("Is something to be seen on it?", 1),
        ("Is its surface black?", -1),
    ),
)

_RUNNING: _Cues = (
    ("coming out", "flowing", "flowing in a strong stream", "splashing"),
    ("not coming out", "not flowing strongly", "standing still"),
    (
        ("Is there a stream below the faucet?", 1),
        ("Does water hit the sink?", 1),
        ("Is there a bright column below the outlet?", 1),
        ("Is the outlet of the faucet dry?", -1),
        ("Is the space below the faucet empty?", -1),
    ),
)

#: The first word of a positive state -> its cues.
_CUES: Mapping[str, _Cues] = MappingProxyType(
    {"open": _OPEN, "on": _ON, "lit": _ON, "running": _RUNNING, "flowing": _RUNNING}
)

#: States that there are cues for.
CUED_STATES = tuple(_CUES)

#: Two articles are enough: the cues differ more than articles do.
_ARTICLES = (Article.THE, Article.THIS)


def ready_cues(positive: str, wording: Wording) -> tuple[Question, ...]:
    """Questions about what can be seen of a thing; none for a state without cues.

    They are questions of their own, beside the grid, so they take no part in `s_is` and `s_does`.

    Args:
        positive: the user's word for the positive state, such as "open".
        wording: what the thing is called.
    """
    cues = _CUES.get(positive.strip().lower())
    if cues is None:
        return ()
    positives, negatives, sentences = cues
    phrases = [StatePhrase(text, 1) for text in positives]
    phrases += [StatePhrase(text, -1) for text in negatives]
    own = tuple(Question(text, means) for text, means in sentences)
    grid = QuestionGrid((wording,), tuple(phrases), articles=_ARTICLES, custom=own)
    return tuple(Question(each.text, each.yes_means) for each in grid.build().questions)


def with_cues(grid: QuestionGrid, positive: str) -> QuestionGrid:
    """The grid with ready cues in its last wording added to the user's own questions.

    Raises:
        QuestionError: if there is no wording yet, or no cue for this state.
    """
    if not grid.wordings:
        raise QuestionError("name the thing first; the cues are asked with its last name")
    cues = ready_cues(positive, grid.wordings[-1])
    if not cues:
        raise QuestionError(
            f"there are ready cues for {', '.join(_CUES)}, not for {positive!r}; write questions "
            "of your own about what one can see"
        )
    there = {question.text for question in (*grid.build().questions, *grid.custom)}
    fresh = tuple(question for question in cues if question.text not in there)
    return replace(grid, custom=(*grid.custom, *fresh))
