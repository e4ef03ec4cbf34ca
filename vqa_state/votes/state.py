"""The three outcomes of a vote: positive, negative, unknown."""

from enum import StrEnum

__all__ = ["State"]


class State(StrEnum):
    """What a verdict says."""

    POSITIVE = "positive"
    NEGATIVE = "negative"
    UNKNOWN = "unknown"
