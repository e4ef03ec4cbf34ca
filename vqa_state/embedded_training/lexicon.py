"""The words in which people ask about the things and their states."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

__all__ = ["HELD_OUT_NOUNS", "LEXICON", "OPENABLE", "UNRELATED", "Entry", "shares_a_word"]


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


_OPEN = ("open", "open", "open", "open", "opened", "standing open")
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
        "drawer": _openable("drawer", "drawer", "desk drawer", "kitchen drawer", "chest"),
        "window": _openable("window", "window", "room window", "sash", "casement"),
        "curtain": _openable("curtain", "curtain", "window curtain", "drape", "blind"),
        "laptop": _openable("laptop", "laptop", "laptop computer", "lid", "laptop lid", "computer"),
        "box_lid": _openable("box", "box", "lid", "pot", "container", "pot lid", "box lid"),
        "gate": _openable("gate", "gate", "garden gate", "fence gate", "fence door"),
        "oven": _openable("oven", "oven", "oven door", "door", "stove door", "kitchen oven"),
    }
)

#: Things that all have a door, so that a question about one may be asked about another.
OPENABLE = frozenset(
    {
        "door",
        "elevator",
        "cabinet",
        "refrigerator",
        "microwave",
        "transparent_door",
        "window",
        "drawer",
        "gate",
        "oven",
        "box_lid",
    }
)

#: Nouns that no training question uses: they show whether words that were never taught are read.
#: Some share a word with a taught noun, see `shares_a_word`.
HELD_OUT_NOUNS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "door": ("front door", "exit", "hatch"),
        "elevator": ("elevator entrance", "lift entrance", "hoist", "dumbwaiter"),
        "cabinet": ("wardrobe", "kitchen unit", "sideboard"),
        "refrigerator": ("icebox", "cooler", "larder"),
        "microwave": ("appliance", "small oven", "cooker"),
        "transparent_door": ("pane", "glass panel", "vitrine"),
        "light": ("bulb", "lighting", "luminaire"),
        "display": ("flat screen", "panel", "telly"),
        "handbag": ("shoulder bag", "satchel", "clutch"),
        "water": ("tap water", "liquid", "fluid"),
    }
)

_SHORTEST = 3


def shares_a_word(noun: str) -> bool:
    """Whether a word of a noun is one of `LEXICON`'s, holds one, or is part of one.

    "icebox" holds "box", "cabin" is part of "cabinet": words are read by their letters, too. Words
    of fewer than three letters must be equal.
    """
    return any(_alike(word, taught) for word in noun.lower().split() for taught in _taught())


def _taught() -> set[str]:
    """All words of nouns and of what follows them."""
    spoken = [text for entry in LEXICON.values() for text in (*entry.nouns, *entry.tails)]
    return {word.lower() for text in spoken for word in text.split()} - {"{}"}


def _alike(word: str, taught: str) -> bool:
    shorter, longer = sorted((word, taught), key=len)
    return word == taught or (len(shorter) >= _SHORTEST and shorter in longer)


#: Questions that no picture of these things answers.
UNRELATED = (
    "Is the sky blue?",
    "Is the cat asleep?",
    "Is it raining?",
    "Is the car red?",
    "Is the man tall?",
    "Is the soup hot?",
    "Are the children happy?",
    "Is the train late?",
    "Is the dog running?",
    "Does the flower smell good?",
    "Is the coffee strong?",
    "Is the road wet?",
    "Is the music loud?",
    "Is this book interesting?",
    "Has the meeting started?",
    "Is the horse brown?",
    "Does the clock show noon?",
    "Is the cake sweet?",
    "Is the ball round?",
    "Is the moon full?",
    "Is the river deep?",
    "Does the baby cry?",
    "Is the phone ringing?",
    "Is the shirt clean?",
    "Is the plane landing?",
    "Is the tree green?",
    "Is it cold outside?",
    "Is the bicycle broken?",
    "Are the apples ripe?",
    "Is the shop crowded?",
    "Is the bridge long?",
    "Is the sea calm?",
)
