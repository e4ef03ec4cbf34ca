"""The user's names of the two states."""

import re
import unicodedata
from dataclasses import dataclass

from vqa_state.errors import ProjectError
from vqa_state.questions.grid import clean_text

__all__ = ["StateNames"]


@dataclass(frozen=True, slots=True)
class StateNames:
    """What the user calls the two states, for example open and closed."""

    positive: str
    negative: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "positive", clean_text(self.positive, "the first state's name"))
        object.__setattr__(self, "negative", clean_text(self.negative, "the second state's name"))
        if _folded(self.positive) == _folded(self.negative):
            raise ProjectError(
                f"both states are called {self.positive!r}; give them two different names"
            )
        if "unknown" in (_folded(self.positive), _folded(self.negative)):
            raise ProjectError(
                "a state cannot be called 'unknown', which is the word for no verdict; name what "
                "can be seen"
            )

    def of(self, label: int) -> str:
        """The name of the state with label +1 or -1."""
        return self.positive if label > 0 else self.negative

    def label(self, name: str) -> int | None:
        """+1 or -1 for a state's name, None for another word.

        Neither case nor the way that accents are written matters; nor do underscores and hyphens in
        the place of spaces, unless only they tell the two states apart.
        """
        known = {_folded(self.positive): 1, _folded(self.negative): -1}
        found = known.get(_folded(" ".join(name.split())))
        if found is None:
            spaced = {_spaced(self.positive): 1, _spaced(self.negative): -1}
            found = spaced.get(_spaced(name)) if len(spaced) == 2 else None
        return found

    def named(self, name: str) -> int:
        """+1 or -1 for a state's name in any case.

        Raises:
            ProjectError: if it is another word.
        """
        label = self.label(name)
        if label is None:
            raise ProjectError(
                f"{name!r} is no state of this project; its states are {self.positive!r} and "
                f"{self.negative!r}"
            )
        return label


def _folded(name: str) -> str:
    """For comparing: without case, and with accents as one character (macOS writes two)."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def _spaced(name: str) -> str:
    """For comparing: the same, with spaces for underscores and hyphens; the one of "-1" stays."""
    words = " ".join(_folded(name).replace("_", " ").split())
    return " ".join(re.sub(r"(?<=\S)[-\u2010\u2011](?=\S)", " ", words).split()) or words or name
