"""What is proved about a subset: kept in searches and recognizers, and shown to people."""

from enum import StrEnum

__all__ = ["Badge"]


class Badge(StrEnum):
    """What is proved about a subset, in the order of worth."""

    BEST = "proved best"
    IMAGES = "most images proved"
    FOUND = "best found"
