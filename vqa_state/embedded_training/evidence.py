"""What can be seen of a state beside its name: in which words it is asked, and when it is true.

A question about evidence is answered by a fact of the scene, so it must be answered by looking at
something else than the label does: how far a leaf stands open, whether its edge shows a gap.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from vqa_state.embedded_training.scenes.stage import Facts

__all__ = ["EVIDENCE", "Evidence"]

#: Degrees up to this are the negative state.
_SHUT = 0.02


@dataclass(frozen=True, slots=True)
class Evidence:
    """True where `above` < fact <= `up_to`.

    Attributes:
        fact: the scene's fact, in [0, 1].
        phrases: words that fit "Is this door ...?".
        questions: whole sentences; {} is a noun.
    """

    fact: str
    above: float
    up_to: float
    phrases: tuple[str, ...] = ()
    questions: tuple[str, ...] = ()

    def holds(self, is_positive: bool, facts: Facts) -> bool | None:
        """Whether it is to be seen in a picture, or None if nobody knows.

        Of a photo only the label is known: enough for "at least slightly open", too little for
        "wide open".
        """
        value = facts.get(self.fact)
        if value is not None:
            return self.above < value <= self.up_to
        if self.fact != "degree" or self.up_to not in (_SHUT, 1.0) or self.above > _SHUT:
            return None
        return is_positive == (self.above == _SHUT)


def _from(degree: float, *phrases: str, questions: tuple[str, ...] = ()) -> Evidence:
    return Evidence("degree", degree, 1.0, phrases, questions)


def _up_to(degree: float, *phrases: str, questions: tuple[str, ...] = ()) -> Evidence:
    return Evidence("degree", -1.0, degree, phrases, questions)


_OPENING = (
    _from(
        _SHUT,
        "at least slightly open",
        "not completely closed",
        "open at least a crack",
        questions=("Is there a gap at its edge?", "Can you see a gap at the edge of the {}?"),
    ),
    _from(0.25, "clearly open", "more than a little open", "open by more than a crack"),
    _from(0.45, "at least half open", "more than half open", "open far enough to reach in"),
    _from(
        0.65, "wide open", "mostly open", "far open", questions=("Does the {} stand wide open?",)
    ),
    _from(0.85, "completely open", "fully open", "open all the way"),
    _up_to(
        _SHUT,
        "completely closed",
        "fully closed",
        "shut tight",
        questions=("Is the front one closed surface?", "Is there no gap at the edge of the {}?"),
    ),
    _up_to(0.25, "closed or almost closed", "shut or nearly shut", "barely open or closed"),
    _up_to(0.45, "less than half open", "no more than half open"),
    _up_to(0.65, "not wide open", "not far open"),
    Evidence(
        "degree",
        _SHUT,
        0.3,
        ("ajar", "slightly open", "just a crack open", "only slightly open"),
        ("Is there only a small opening at the {}?",),
    ),
    Evidence("degree", 0.3, 0.7, ("half open", "partly open")),
    Evidence("flush", 0.5, 1.0, ("flush with its frame", "flush with what is around it")),
)

_INSIDE = (
    Evidence(
        "inside_visible",
        0.5,
        1.0,
        questions=(
            "Is the inside visible?",
            "Can one look inside?",
            "Can you see the inside of the {}?",
            "Is there an opening in the middle of the picture?",
            "Can one look into the {}?",
        ),
    ),
    Evidence(
        "inside_visible",
        -1.0,
        0.5,
        questions=("Is everything behind the front hidden?", "Does the {} hide what is behind it?"),
    ),
)

_ANGLE = (
    Evidence(
        "leaf_at_angle",
        0.5,
        1.0,
        ("turned out of its frame", "at an angle to its frame"),
        ("Does something stand at an angle to the front?", "Does the {} stand at an angle?"),
    ),
)

_WAY = (
    Evidence(
        "way_free",
        0.5,
        1.0,
        questions=(
            "Could a person walk through the {}?",
            "Is the way through the {} free?",
            "Can a robot pass the {} now?",
        ),
    ),
)

_SHINING = (
    _from(
        0.1,
        "at least dimly lit",
        "lit up",
        "glowing",
        questions=("Does light come from it?", "Is it brighter than what is around it?"),
    ),
    _from(0.65, "shining brightly", "very bright", "bright"),
    _up_to(0.1, "completely dark", "dark", questions=("Is its surface black?", "Is the {} black?")),
    _up_to(0.65, "not bright", "dim or dark"),
)

_DAYLIGHT = Evidence(
    "daylight",
    0.5,
    1.0,
    questions=("Does daylight come in?", "Is there a bright window in the room?"),
)

_STREAM = (
    _from(
        0.05,
        "coming out",
        "flowing",
        questions=(
            "Is there a stream below the faucet?",
            "Is there a bright column below the outlet?",
            "Is the faucet running?",
            "Is the tap on?",
        ),
    ),
    _from(0.6, "flowing in a strong stream", "gushing"),
    _up_to(
        0.05,
        "not coming out",
        "standing still",
        questions=(
            "Is the outlet of the faucet dry?",
            "Is the space below the faucet empty?",
            "Is the tap closed?",
        ),
    ),
    _up_to(0.6, "not flowing strongly", "not gushing"),
    Evidence("degree", 0.05, 0.6, ("only trickling", "running weakly")),
    Evidence("splash", 0.5, 1.0, ("splashing",), ("Does water hit the sink?",)),
)

#: What can be seen of each thing.
EVIDENCE: Mapping[str, tuple[Evidence, ...]] = MappingProxyType(
    {
        "door": (*_OPENING, *_INSIDE, *_ANGLE, *_WAY),
        "elevator": (*_OPENING, *_INSIDE, *_ANGLE, *_WAY),
        "cabinet": (*_OPENING, *_INSIDE, *_ANGLE),
        "refrigerator": (*_OPENING, *_INSIDE, *_ANGLE),
        "microwave": (*_OPENING, *_INSIDE, *_ANGLE),
        "transparent_door": (*_OPENING, *_INSIDE, *_ANGLE, *_WAY),
        "light": (
            *_SHINING,
            _DAYLIGHT,
            Evidence("room_bright", 0.5, 1.0, questions=("Is the room bright?",)),
        ),
        "display": (
            *_SHINING,
            Evidence(
                "picture_shown",
                0.5,
                1.0,
                ("showing something", "showing a picture"),
                ("Is something to be seen on it?", "Is there a picture on the {}?"),
            ),
        ),
        "handbag": (
            *_OPENING,
            *_INSIDE,
            Evidence("flap_up", 0.5, 1.0, questions=("Is the flap of the {} lifted?",)),
        ),
        "water": _STREAM,
        "drawer": (*_OPENING, *_INSIDE),
        "window": (*_OPENING, *_INSIDE, *_ANGLE),
        "curtain": (*_OPENING, *_INSIDE, _DAYLIGHT),
        "laptop": (
            *_OPENING,
            *_INSIDE,
            *_ANGLE,
            Evidence("screen_lit", 0.5, 1.0, questions=("Is the screen of the {} lit?",)),
        ),
        "box_lid": (*_OPENING, *_INSIDE, *_ANGLE),
        "gate": (*_OPENING, *_INSIDE, *_ANGLE, *_WAY),
        "oven": (*_OPENING, *_INSIDE, *_ANGLE),
    }
)
