"""Two changes of one project become one: what was read, what is here, what another program saved.

What only one of the two changed is taken from it, image by image and field by field; lists of the
grid lose what either took out and gain what either put in; looks at the test add up. What both
changed in two ways is refused by name. See docs/decisions/0017-two-programs.md.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, Final, TypeVar

from vqa_state.errors import ConflictError, QuestionError
from vqa_state.images.near_duplicates import look_alikes
from vqa_state.project.schema import LabelledImage, ProjectFile
from vqa_state.project.split import Split, astride
from vqa_state.questions.grid import Question, QuestionGrid, StatePhrase
from vqa_state.questions.states import StateNames

__all__ = ["merge"]

Images = dict[str, LabelledImage]
T = TypeVar("T")

#: Fields of project.json that are merged as a whole, those of a group together, and their names.
_FIELDS: Final = {
    ("name",): "the project's name",
    ("states",): "the names of the states",
    ("model", "fingerprint"): "the model",
    ("seed",): "the seed",
    ("augmentation",): "the kind of copies",
    ("search_seed",): "the seed of the search",
    ("engine",): "the engine",
    ("search",): "the settings of the search",
    ("weights",): "the weights of the objectives",
    ("chosen",): "the chosen objective",
    ("vote",): "the kind of vote",
    ("coverage",): "the share of verdicts",
    ("all_questions",): "the choice between all and chosen questions",
}
_SIDES = (Split.TRAIN, Split.TEST)


def merge(base: ProjectFile, mine: ProjectFile, theirs: ProjectFile) -> ProjectFile:
    """Both changes of `base` in one.

    Args:
        base: what both began with.
        mine: what is to be saved.
        theirs: what another program saved meanwhile.

    Raises:
        ConflictError: if both changed the same thing in two ways, or the two together break a rule.
    """
    conflicts: list[str] = []
    images = _images(base, mine, theirs, conflicts)
    merged: dict[str, Any] = {
        "schema_version": theirs.schema_version,
        "images": tuple(images.values()),
        "grid": _grid(base.grid, mine.grid, theirs.grid, conflicts),
        "test_looks": max(0, mine.test_looks + theirs.test_looks - base.test_looks),
    }
    for names, words in _FIELDS.items():
        values = [tuple(getattr(one, name) for name in names) for one in (base, mine, theirs)]
        merged |= dict(zip(names, _field(values, words, conflicts), strict=True))
    if conflicts:
        raise ConflictError(conflicts)
    return ProjectFile(**merged)


def _field(
    values: Sequence[tuple[object, ...]], words: str, conflicts: list[str]
) -> tuple[object, ...]:
    base, mine, theirs = values
    if _differ(base, mine, theirs):
        there, here = _said(theirs), _said(mine)
        conflicts.append(f"{words} was set to {there} by another program and to {here} here")
    return _changed(base, mine, theirs)


def _differ(base: object, mine: object, theirs: object) -> bool:
    """Whether both changed it, in two ways."""
    return base != mine != theirs != base


def _changed(base: T, mine: T, theirs: T) -> T:
    """The value of the one that changed it."""
    return theirs if mine == base else mine


def _said(values: tuple[object, ...]) -> str:
    """The first of a group names it for a person."""
    value = values[0]
    if isinstance(value, StateNames):
        return f"{value.positive!r} and {value.negative!r}"
    return repr(value) if isinstance(value, str) and type(value) is str else str(value)


def _images(
    base: ProjectFile, mine: ProjectFile, theirs: ProjectFile, conflicts: list[str]
) -> Images:
    before, ours, others = ({one.id: one for one in of.images} for of in (base, mine, theirs))
    merged: Images = {}
    for image_id in dict.fromkeys([*others, *ours]):
        three = before.get(image_id), ours.get(image_id), others.get(image_id)
        image = _image(*three, theirs.states, conflicts)
        if image is not None:
            merged[image_id] = image
    return _on_one_side(before, ours, others, merged)


def _image(
    base: LabelledImage | None,
    mine: LabelledImage | None,
    theirs: LabelledImage | None,
    states: StateNames,
    conflicts: list[str],
) -> LabelledImage | None:
    if mine in (base, theirs):
        return theirs
    if theirs == base:
        return mine
    if mine is None or theirs is None:
        there = "removed" if theirs is None else "changed"
        here = "removed" if mine is None else "changed"
        kept = mine or theirs
        assert kept is not None  # noqa: S101  # two that are None are equal
        conflicts.append(f"{kept.name} was {there} by another program and {here} here")
        return kept
    if base is None:  # both added it; the first to save gave it its name
        base = replace(theirs, label=None, split=None, accepted=False)
        mine = replace(theirs, label=mine.label, split=mine.split, accepted=mine.accepted)
    return _both(base, mine, theirs, states, conflicts)


def _both(
    base: LabelledImage,
    mine: LabelledImage,
    theirs: LabelledImage,
    states: StateNames,
    conflicts: list[str],
) -> LabelledImage:
    """The image with label and side of whoever changed them; nothing else of it ever changes."""
    labels = [(one.label, one.accepted) for one in (base, mine, theirs)]
    if mine.label == theirs.label and _differ(*labels):
        labels[1] = labels[2] = (mine.label, False)  # a person gave the label that a vote suggested
    if _differ(*labels):
        there, here = (_given(one.label, states) for one in (theirs, mine))
        conflicts.append(
            f"the label of {theirs.name} was {there} by another program and {here} here"
        )
    if _differ(base.split, mine.split, theirs.split):
        there, here = (one.split or "none" for one in (theirs, mine))
        conflicts.append(
            f"the side of {theirs.name} was set to {there} by another program and to {here} here"
        )
    label, accepted = _changed(*labels)
    split = _changed(base.split, mine.split, theirs.split)
    if label is None and base.label is not None and split is not Split.UNUSED:
        split = None  # as taking a label away does
    if accepted and split is Split.TEST:
        conflicts.append(
            f"{theirs.name} became a test image in one of the two and got a label that a vote "
            "suggested in the other, which must not judge votes"
        )
    return replace(theirs, label=label, accepted=accepted, split=split)


def _given(label: int | None, states: StateNames) -> str:
    return "taken away" if label is None else f"set to {states.of(label)}"


def _on_one_side(before: Images, ours: Images, others: Images, merged: Images) -> Images:
    """Look-alikes that each program put on another side, not knowing of the other's image.

    Those of the program that saved first keep their side.
    """
    new_here, new_there = _sided(before, ours), _sided(before, others)
    if not new_here or not new_there:
        return merged
    groups = look_alikes({one.id: one.looks for one in merged.values()})
    for group in astride(groups, {i: one.split for i, one in merged.items() if one.split}):
        movable = [i for i in group if i in new_here - new_there and not merged[i].accepted]
        sides = {others[i].split for i in group if i in others}.intersection(_SIDES)
        own = {ours[i].split for i in group if i in ours}.intersection(_SIDES)
        if new_there.intersection(group) and len(own) == len(sides) == 1:
            merged |= {i: replace(merged[i], split=next(iter(sides))) for i in movable}
    return merged


def _sided(before: Images, after: Images) -> set[str]:
    """Images that were put on a side."""
    return {
        i
        for i, one in after.items()
        if one.split in _SIDES and (i not in before or before[i].split is None)
    }


def _grid(
    base: QuestionGrid, mine: QuestionGrid, theirs: QuestionGrid, conflicts: list[str]
) -> QuestionGrid:
    lists = {
        one.name: _list(*(getattr(grid, one.name) for grid in (base, mine, theirs)))
        for one in fields(QuestionGrid)
    }
    for name in ("phrases", "custom"):
        conflicts += _two_meanings(lists[name], getattr(mine, name), getattr(theirs, name))
    try:
        return QuestionGrid(**lists)
    except QuestionError as error:
        conflicts.append(f"the questions of both programs together cannot be used: {error}")
        return theirs


def _list(base: tuple[T, ...], mine: tuple[T, ...], theirs: tuple[T, ...]) -> tuple[T, ...]:
    if base in (mine, theirs) or mine == theirs:
        return _changed(base, mine, theirs)
    kept = [one for one in theirs if one in mine or one not in base]
    return (*kept, *(one for one in mine if one not in base and one not in kept))


def _two_meanings(
    merged: Sequence[StatePhrase | Question],
    mine: Sequence[StatePhrase | Question],
    theirs: Sequence[StatePhrase | Question],
) -> list[str]:
    """Texts to which "yes" means one state here and the other there."""
    here, there, both = ({(one.text, one.yes_means) for one in of} for of in (mine, theirs, merged))
    return [
        f"'yes' to {text!r} was given another meaning by another program than here"
        for text, meaning in sorted(both - there)
        if (text, -meaning) in both and (text, -meaning) not in here
    ]
