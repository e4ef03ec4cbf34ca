"""The question grids of the paper's experiments, one for each of the ten things."""

from collections.abc import Mapping
from types import MappingProxyType

from vqa_state.questions import Question, QuestionGrid, Wording, phrases_for

__all__ = ["questions_about"]

#: Source: paper III, the tables' captions. The two wordings of the refrigerator are ours, since
#: the text does not name them.
_WORDINGS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "door": ("door",),
        "elevator": ("door", "elevator door"),
        "cabinet": ("door", "cabinet door", "kitchen cabinet door", "shelf door"),
        "refrigerator": ("door", "refrigerator door"),
        "microwave": ("door", "microwave door", "oven door", "microwave oven door"),
        "transparent_door": ("door", "transparent door", "glass door", "window"),
        "light": ("light", "electricity"),
        "display": ("display", "monitor", "computer monitor", "TV"),
        "handbag": ("bag", "handbag"),
        "water": ("water | in {article} sink", "water | from {article} faucet"),
    }
)

_STATES: Mapping[str, tuple[str, str | None]] = MappingProxyType(
    {"light": ("on", "off"), "display": ("on", "off"), "water": ("running", None)}
)


def questions_about(thing: str) -> tuple[Question, ...]:
    """The 16 to 64 questions of the paper's experiment on this thing."""
    wordings = tuple(Wording.parse(line) for line in _WORDINGS[thing])
    positive, negative = _STATES.get(thing, ("open", "closed"))
    return QuestionGrid(wordings, phrases_for(positive, negative)).build().questions
