"""One answer of a model: its raw text, its probability of yes, and what it says.

The raw text is what the store keeps; it is read again each time a table is made (`parse`), so
better rules need no new calls.
"""

from dataclasses import dataclass

from vqa_state.answers.parse import PARSER_VERSION, Reading, read_answer

__all__ = [
    "CUT_OFF",
    "PARSER_VERSION",
    "Answer",
    "Reading",
    "read_answer",
]

CUT_OFF = "no clear answer (cut off)"
"""What an invalid answer is called that the length limit ended before yes or no."""


@dataclass(frozen=True, slots=True)
class Answer:
    """One answer of a model: its raw text, and how sure it was.

    `p_yes` is P(yes) / (P(yes) + P(no)) in [0, 1], or None where the model has no probabilities.
    `at_limit` says that the length limit ended it, not the model. Half surrogates in the text,
    which no file can hold, become "?".
    """

    text: str
    p_yes: float | None = None
    at_limit: bool = False

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

    @property
    def cut_off(self) -> bool:
        """Whether the length limit ended it before yes or no: invalid, but not for its words."""
        return self.at_limit and self.reading is Reading.INVALID

    def verdict(self, yes_means: int) -> int:
        """+1 if the answer speaks for the positive state, -1 for the negative, 0 for neither."""
        return {Reading.YES: yes_means, Reading.NO: -yes_means, Reading.INVALID: 0}[self.reading]
