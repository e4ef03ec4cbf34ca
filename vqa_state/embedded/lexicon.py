"""The words in which people ask about the ten things, and what can be seen of each state."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

__all__ = ["FACT_QUESTIONS", "LEXICON", "OPENABLE", "Entry"]


@dataclass(frozen=True, slots=True)
class Entry:
    """How one thing and its two states are spoken of.

    `answer` and `states` are what an open question is answered with; `tails` take an article.
    """

    answer: str
    nouns: tuple[str, ...]
    positive: tuple[str, ...]
    negative: tuple[str, ...]
    states: tuple[str, str]
    tails: tuple[str, ...] = ()


_OPEN = ("open", "open", "open", "open", "opened", "standing open", "ajar")
_CLOSED = ("closed", "closed", "closed", "closed", "shut", "shut")
_ON = ("on", "on", "on", "turned on", "switched on")
_OFF = ("off", "off", "off", "turned off", "switched off")
_OPEN_CLOSED = ("open", "closed")


def _openable(answer: str, *nouns: str) -> Entry:
    return Entry(answer, nouns, _OPEN, _CLOSED, _OPEN_CLOSED)


LEXICON: Mapping[str, Entry] = MappingProxyType(
    {
        "door": _openable("door", "door", "room door", "wooden door", "entrance", "doorway"),
        "elevator": _openable("elevator", "door", "elevator door", "elevator", "lift", "lift door"),
        "cabinet": _openable(
            "cabinet",
            "door",
            "cabinet door",
            "kitchen cabinet door",
            "shelf door",
            "cabinet",
            "cupboard",
            "closet",
            "drawer",
        ),
        "refrigerator": _openable(
            "refrigerator",
            "door",
            "refrigerator door",
            "refrigerator",
            "fridge",
            "fridge door",
            "freezer",
        ),
        "microwave": _openable(
            "microwave",
            "door",
            "microwave door",
            "oven door",
            "microwave oven door",
            "microwave",
            "microwave oven",
        ),
        "transparent_door": _openable(
            "transparent door",
            "door",
            "transparent door",
            "glass door",
            "window",
            "sliding door",
            "sliding window",
        ),
        "light": Entry(
            "light",
            ("light", "electricity", "lamp", "room light", "ceiling light"),
            (*_ON, "lit"),
            _OFF,
            ("on", "off"),
        ),
        "display": Entry(
            "display",
            ("display", "monitor", "computer monitor", "TV", "screen", "television"),
            _ON,
            _OFF,
            ("on", "off"),
        ),
        "handbag": _openable("handbag", "bag", "handbag", "purse", "tote bag"),
        "water": Entry(
            "faucet",
            ("water",),
            ("running", "running", "running", "flowing", "pouring", "coming out"),
            ("not running", "not running", "not running", "not flowing", "stopped"),
            ("running", "stopped"),
            ("in {} sink", "from {} faucet", "from {} tap", "into {} sink"),
        ),
    }
)

#: Things that all have a door, so that a question about one may be asked about another.
OPENABLE = frozenset(
    {"door", "elevator", "cabinet", "refrigerator", "microwave", "transparent_door"}
)

#: Questions that are answered by a fact of the scene, not by its label. {} is a noun.
FACT_QUESTIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "inside_visible": (
            "Can you see the inside of the {}?",
            "Is the inside of this {} visible?",
            "Can one look into the {}?",
            "Is what lies behind the front of the {} uncovered?",
        ),
        "wide_open": (
            "Is the {} wide open?",
            "Is this {} fully open?",
            "Does the {} stand wide open?",
            "Does this image look like the {} is completely open?",
        ),
        "slightly_open": (
            "Is the {} only slightly open?",
            "Is this {} just partly open?",
            "Is the {} half open?",
            "Is there only a small opening at the {}?",
        ),
        "leaf_at_angle": (
            "Does the {} stand at an angle?",
            "Is a leaf of the {} turned out of its frame?",
        ),
        "flush": (
            "Is the {} flush with its frame?",
            "Is there no gap at the edge of the {}?",
            "Does the {} fill its whole frame?",
        ),
        "way_free": (
            "Could a person walk through the {}?",
            "Is the way through the {} free?",
            "Can a robot pass the {} now?",
        ),
        "lamp_glows": ("Does the {} glow?", "Is the {} shining?", "Is the {} bright?"),
        "room_bright": ("Is the room bright?", "Is it bright in this room?"),
        "daylight": ("Does daylight come in?", "Is there a bright window in the room?"),
        "picture_shown": (
            "Is there a picture on the {}?",
            "Does the {} show something?",
            "Is something displayed on this {}?",
        ),
        "screen_black": ("Is the {} black?", "Is the {} dark?", "Is the {} blank?"),
        "flap_up": ("Is the flap of the {} lifted?", "Is the flap of this {} thrown back?"),
        "covered": ("Is the opening of the {} covered?", "Is the {} zipped up or covered?"),
        "stream": (
            "Is there a stream of water below the faucet?",
            "Does water come out of this tap?",
            "Is the faucet running?",
            "Is the tap on?",
        ),
        "splash": ("Does water splash into the sink?", "Is there a splash in the sink?"),
        "dry_outlet": (
            "Is the outlet of the faucet dry?",
            "Is the faucet off?",
            "Is the tap closed?",
        ),
    }
)
