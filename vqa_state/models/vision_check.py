"""Does a model see at all? What it says of pictures that a person would tell apart at once.

It is shown a thing in both states, a blank picture, and the first picture again with one pixel
changed by a shade, which nobody sees. What differs between these two is noise: of a server that
calculates in varying batches, or that writes a number into its answers. Only what differs more
between states counts.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from PIL import Image

from vqa_state.answers.answer import Answer, Reading
from vqa_state.models._base import Interruptible, Reply, VQAModel

__all__ = ["N_CALLS", "PROBES", "Probe", "Said", "Sight", "is_clear", "replies_until", "sight_of"]

_FOLDER = Path(__file__).with_name("probe_pictures")

# Places in `Probe.pictures`.
_POSITIVE, _NEGATIVE, _BLANK, _AGAIN = range(4)

#: Two p_yes that differ by less are one answer, whatever the noise.
_SAME = 0.01

#: Noise is known from few pairs, so a difference must be so many times as large.
_TIMES_NOISE = 3

#: What was answered about a probe, by (picture, question); what failed is left out.
Said = Mapping[tuple[int, int], Answer]


@dataclass(frozen=True, slots=True)
class Probe:
    """A thing in both states, and what is asked about it: "yes" is right of one, then the other."""

    name: str
    questions: tuple[str, str]

    def pictures(self) -> tuple[Image.Image, ...]:
        """Positive, negative, blank, positive again; 256 x 256 RGB, part of the package."""
        names = (f"{self.name}_positive.jpg", f"{self.name}_negative.jpg")
        positive, negative = [Image.open(_FOLDER / name).convert("RGB") for name in names]
        again = positive.copy()
        red, green, blue = again.getpixel((0, 0))  # type: ignore[misc]
        again.putpixel((0, 0), (red ^ 1, green, blue))
        return positive, negative, Image.new("RGB", positive.size, (128, 128, 128)), again


PROBES = (
    Probe("light", ("Is the light on?", "Does this image look like the light is off?")),
    Probe("door", ("Is the door open?", "Does this image look like the door is closed?")),
    Probe("display", ("Is the display on?", "Does this image look like the display is off?")),
)

#: Calls of the whole look.
N_CALLS = len(PROBES) * 4 * 2


class Sight(StrEnum):
    """What the look found."""

    TELLS = "tells"
    """It says different things about the two states of at least one thing."""
    SEES = "sees"
    """It says the same about both states, but something else about another picture."""
    BLIND = "blind"
    """It says the same whatever the picture."""
    SILENT = "silent"
    """It gave no answer, or too few to tell."""


def replies_until(
    model: VQAModel,
    images: Sequence[Image.Image],
    questions: Sequence[str],
    stop: Callable[[], bool],
) -> Iterator[Reply]:
    """What it answers until `stop` says so: within a call where the model can, else after one.

    Raises:
        ModelError: if the model cannot answer anything more.
    """
    if isinstance(model, Interruptible):
        replies = model.answer_until(images, questions, stop)
    else:
        replies = model.answer(images, questions)
    for reply in replies:
        yield reply
        if stop():
            return


def sight_of(said: Sequence[Said]) -> Sight:
    """The finding, by what was said about each probe; what was cut off before yes or no is not."""
    said = [{pair: one for pair, one in probe.items() if not one.cut_off} for probe in said]
    noise = _differences(said, _POSITIVE, _AGAIN)
    states = _differences(said, _POSITIVE, _NEGATIVE)
    others = states + [one for p in (0, 1) for one in _differences(said, p, _BLANK)]
    if not noise or not others:
        return Sight.SILENT
    if _above(states, noise):
        return Sight.TELLS
    texts_count = not any(one.text for one in noise)
    if _above(others, noise) or (texts_count and any(one.text for one in others)):
        return Sight.SEES
    return Sight.BLIND


def is_clear(said: Said) -> bool:
    """Whether all that was said about a probe is right, so that no more need be shown.

    Chance does that once in 64 times.
    """
    right = {_POSITIVE: True, _NEGATIVE: False, _AGAIN: True}
    wanted = {(p, q): is_on ^ (q == 1) for p, is_on in right.items() for q in (0, 1)}
    return all(
        place in said and said[place].reading is (Reading.YES if yes else Reading.NO)
        for place, yes in wanted.items()
    )


@dataclass(frozen=True, slots=True)
class _Difference:
    """How two answers to one question differ.

    Attributes:
        p_yes: by how much, None unless both have one.
        reading: as yes, no and neither.
        text: of two that are neither yes nor no.
    """

    p_yes: float | None
    reading: bool
    text: bool


def _differences(said: Sequence[Said], first: int, second: int) -> list[_Difference]:
    pairs = [(one.get((first, q)), one.get((second, q))) for one in said for q in (0, 1)]
    return [_difference(one, other) for one, other in pairs if one and other]


def _difference(one: Answer, other: Answer) -> _Difference:
    p_yes = None
    if one.p_yes is not None and other.p_yes is not None:
        p_yes = abs(one.p_yes - other.p_yes)
    is_free = one.reading is other.reading is Reading.INVALID
    text = is_free and one.text.strip().lower() != other.text.strip().lower()
    return _Difference(p_yes, one.reading is not other.reading, text)


def _above(differences: Sequence[_Difference], noise: Sequence[_Difference]) -> bool:
    """Whether some differ by more than noise: in p_yes where both have one, else as yes and no."""
    steps = [one.p_yes for one in noise if one.p_yes is not None]
    line = max(_SAME, _TIMES_NOISE * max(steps)) if steps else 1.0
    if any(one.p_yes is not None and one.p_yes > line for one in differences):
        return True
    return _share_read_otherwise(differences) > _TIMES_NOISE * _share_read_otherwise(noise)


def _share_read_otherwise(differences: Sequence[_Difference]) -> float:
    read = [one.reading for one in differences if one.p_yes is None]
    return sum(read) / len(read) if read else 0.0
