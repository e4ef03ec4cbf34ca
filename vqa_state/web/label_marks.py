"""Labels and sides that a person gives in the grid of images.

A page may show less than there is by now: another window, another app or a command may have
labelled the same image. What a page has not seen it does not overwrite; it is told instead.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from vqa_state.project.project import LabelledImage, Project, StateNames
from vqa_state.project.split import Split
from vqa_state.web import arguments
from vqa_state.web.session import Desk

__all__ = ["mark"]

_NAMED = 3  # images that a refusal names


def mark(desk: Desk, pid: str, marked: Mapping[str, Any]) -> dict[str, Any]:
    """Keep labels and sides.

    Args:
        desk: with the project.
        pid: of the project.
        marked: `labels`, `splits` and `accepted` by image id, each may lack. `seen` holds
            `labels` and `splits` as they stood on the page before; an image of which the page
            says nothing there is marked in any case.

    Returns:
        Nothing, or `refused`: a sentence about images that somebody else marked otherwise
        meanwhile. All others are saved.

    Raises:
        ProjectError: if an image or a value is unknown; nothing is saved then.
    """
    labels, splits, accepted, seen = (
        arguments.json_object(marked.get(key, {}))
        for key in ("labels", "splits", "accepted", "seen")
    )
    saw = {key: arguments.json_object(seen.get(key, {})) for key in ("labels", "splits")}
    refused: dict[str, str] = {}
    with desk.changing(pid) as project:
        before = dict(project.images)
        for image_id, value in _there(labels, saw["labels"], project, refused):
            image, label = arguments.known_image(project, image_id), _label(value)
            now = before[image.id].label
            if now not in (saw["labels"].get(image_id, now), label):
                refused[image.id] = _has_label(before[image.id], project.states)
                continue
            from_a_vote = accepted.get(image_id, False) is not False
            project.set_labels([image.id], label, accepted=from_a_vote)
        for image_id, value in _there(splits, saw["splits"], project, refused):
            image = arguments.known_image(project, image_id)
            side, stands = _side(value), before[image.id].split
            if stands not in (None, saw["splits"].get(image_id, stands), side):
                refused.setdefault(image.id, f"{image.name} is for {stands}")
            elif image.id not in refused:
                project.set_splits([image.id], side)
    return {"refused": _sentence(list(refused.values()))} if refused else {}


def _there(
    marks: Mapping[str, Any], saw: Mapping[str, Any], project: Project, refused: dict[str, str]
) -> Iterator[tuple[str, Any]]:
    """The marks, without those of images that the page has shown and somebody removed."""
    for image_id, value in marks.items():
        if image_id in saw and image_id not in project.images:
            refused[image_id] = "an image was removed"
        else:
            yield image_id, value


def _label(value: object) -> int | None:
    if value is None or (type(value) is int and value in (-1, 1)):
        return value
    raise arguments.RequestError("a label must be 1, -1 or null")


def _side(value: object) -> Split | None:
    return None if value is None else arguments.choice(value, Split, "the side")


def _has_label(image: LabelledImage, states: StateNames) -> str:
    label = "without a label" if image.label is None else f"labelled {states.of(image.label)}"
    return f"{image.name} is {label}"


def _sentence(facts: list[str]) -> str:
    more = f" and {len(facts) - _NAMED} more" if len(facts) > _NAMED else ""
    return (
        f"{', '.join(facts[:_NAMED])}{more}, in another window or program meanwhile, and that "
        "stays. Look again, and mark anew what is wrong; all other marks are saved"
    )
