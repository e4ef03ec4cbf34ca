"""Arguments from a page are arbitrary JSON: each is checked here before anything uses it."""

import json
import math
import re
from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import Any, TypeVar

from vqa_state.errors import ProjectError, VQAStateError
from vqa_state.project.project import MAX_IMAGES, LabelledImage, Project

__all__ = [
    "RequestError",
    "TooLargeError",
    "choice",
    "choices",
    "image_id",
    "image_ids",
    "integer",
    "json_list",
    "json_object",
    "known_image",
    "lines",
    "number",
    "stated",
    "text",
]

MAX_TEXT = 100_000
MAX_LIST = 10_000_000
_IMAGE_ID = re.compile(r"[0-9a-f]{64}")

Chosen = TypeVar("Chosen", bound=StrEnum)
Made = TypeVar("Made")


class RequestError(VQAStateError):
    """A page, or something that pretends to be one, sent what no page of ours sends."""


class TooLargeError(RequestError):
    """More bytes came than are read."""


def text(value: object, what: str, longest: int = MAX_TEXT) -> str:
    """A text of sensible length; None counts as empty."""
    if value is None:
        return ""
    if not isinstance(value, str) or len(value) > longest:
        raise RequestError(f"{what} must be a text of at most {longest:,} characters")
    return value


def lines(value: object, what: str) -> list[str]:
    """The lines of a text that are not blank."""
    return [line.strip() for line in text(value, what).splitlines() if line.strip()]


def number(value: object, what: str) -> float:
    """A finite number; an empty field is an error that names it."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RequestError(f"{what} must be a number; type one")
    return value


def integer(value: object, what: str) -> int:
    """A whole number, which a page may send as 3 or 3.0."""
    found = number(value, what)
    if found != int(found):
        raise RequestError(f"{what} must be a whole number, got {found}")
    return int(found)


def choice(value: object, options: type[Chosen], what: str) -> Chosen:
    """One member of an enum, by its value."""
    known = {str(option): option for option in options}
    if not isinstance(value, str) or value not in known:
        raise RequestError(f"{what} must be one of: {', '.join(known)}")
    return known[value]


def choices(value: object, options: Iterable[Chosen], what: str) -> tuple[Chosen, ...]:
    """Some members of an enum, in the enum's own order."""
    if not isinstance(value, list):
        raise RequestError(f"{what} must be a list")
    return tuple(option for option in options if str(option) in value)


def image_id(value: object) -> str:
    """A SHA-256 in lower-case hex digits."""
    if not isinstance(value, str) or not _IMAGE_ID.fullmatch(value):
        raise RequestError("an image is named by the 64 hex digits of its SHA-256")
    return value


def image_ids(value: object) -> list[str]:
    """A list of image ids."""
    if not isinstance(value, list) or len(value) > MAX_IMAGES:
        raise RequestError(f"images must be a list of at most {MAX_IMAGES:,} ids")
    return [image_id(one) for one in value]


def known_image(project: Project, value: object) -> LabelledImage:
    """The project's image with this id."""
    found = project.images.get(image_id(value))
    if found is None:
        raise ProjectError(f"the project {project.name!r} has no such image; reload the page")
    return found


def json_object(data: bytes | object) -> dict[str, Any]:
    """A JSON object, as bytes or already read."""
    try:
        found = json.loads(data) if isinstance(data, bytes) else data
    except (ValueError, RecursionError) as error:
        raise RequestError("the request must hold a JSON object") from error
    if not isinstance(found, dict):
        raise RequestError("the request must hold a JSON object")
    return found


def json_list(value: object, what: str) -> list[Any]:
    """A JSON list, as text; an empty text is an empty list."""
    try:
        found = json.loads(text(value, what, MAX_LIST) or "[]")
    except (ValueError, RecursionError) as error:
        raise RequestError(f"{what} must be a JSON list") from error
    if not isinstance(found, list):
        raise RequestError(f"{what} must be a JSON list")
    return found


def stated(make: Callable[[], Made]) -> Made:
    """What `make` makes; the core's own ValueErrors name field and range, so they are shown."""
    try:
        return make()
    except ValueError as error:
        raise RequestError(f"{error}; change it and try again") from error
