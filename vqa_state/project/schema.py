"""The content of project.json: what a project is made of, and the check of a file that holds it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vqa_state.errors import ProjectError, QuestionError
from vqa_state.images.augmentation import Augmentation
from vqa_state.project.split import Split
from vqa_state.questions.grid import QuestionGrid
from vqa_state.questions.states import StateNames
from vqa_state.search.engines import Engine
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.votes.rules import VoteKind

__all__ = [
    "SCHEMA_VERSION",
    "LabelledImage",
    "ProjectFile",
    "checked_content",
    "fields_of",
    "parse_project",
]

SCHEMA_VERSION: Final = 1
_Hash = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


@dataclass(frozen=True, slots=True)
class LabelledImage:
    """One image of a project.

    Attributes:
        id: SHA-256 of the bytes as given.
        pixel_hash: SHA-256 of its RGB pixels; the copies come from it.
        looks: perceptual hash, 16 hex digits.
        suffix: kind of file, as its header says.
        name: the name that it came with; shown, never used as a path.
        label: +1, -1 or None.
        split: train, test or unused; None until it has a label.
        accepted: a vote suggested the label, and a person accepted it: it must not judge a vote.
    """

    id: _Hash
    pixel_hash: _Hash
    looks: Annotated[str, Field(pattern="^[0-9a-f]{16}$")]
    suffix: Literal["jpg", "png", "webp", "bmp", "heic", "avif"]
    name: Annotated[str, Field(max_length=200)]
    label: Literal[-1, 1] | None = None
    split: Split | None = None
    accepted: bool = False


class ProjectFile(BaseModel):
    """Content of project.json."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[1]
    name: str
    states: StateNames
    images: tuple[LabelledImage, ...]
    grid: QuestionGrid
    model: str
    fingerprint: str | None
    seed: Annotated[int, Field(ge=0, lt=2**32)]
    augmentation: Augmentation
    search_seed: Annotated[int, Field(ge=0, lt=2**32)]
    engine: Engine = Engine.DEFAULT
    search: SearchSettings
    weights: ObjectiveWeights
    chosen: Objective
    vote: VoteKind = VoteKind.PAPER
    coverage: Annotated[float, Field(gt=0, lt=1)] | None = None
    all_questions: bool = False
    test_looks: Annotated[int, Field(ge=0)]


def parse_project(data: bytes, path: Path) -> ProjectFile:
    """Check the content of project.json; `path` names it in errors.

    Raises:
        ProjectError: if it is damaged, newer than this program or cannot be used.
    """
    try:
        return ProjectFile.model_validate_json(data)
    except (QuestionError, ProjectError) as error:
        raise ProjectError(f"{path} cannot be used: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        if where == "schema_version" and first["type"] != "missing":
            raise ProjectError(
                f"{path} has schema version {first.get('input')!r}; this program reads up to "
                f"{SCHEMA_VERSION}: update the program"
            ) from error
        raise ProjectError(
            f"{path} is damaged at {where or 'its start'}: {first['msg']}; restore it from a backup"
        ) from error


def checked_content(fields: Mapping[str, object], images: Iterable[LabelledImage]) -> ProjectFile:
    """The content of project.json for a project's fields, by name; others are passed over.

    Raises:
        ProjectError: if a value cannot be kept.
    """
    own = {name: fields[name] for name in _own_fields()}
    try:
        return ProjectFile.model_validate(
            own | {"schema_version": SCHEMA_VERSION, "images": tuple(images)}
        )
    except ValidationError as error:
        first = error.errors()[0]
        raise ProjectError(
            f"the project was not saved: {'.'.join(map(str, first['loc']))} cannot be "
            f"{first['input']!r} ({first['msg']}); give another value"
        ) from error


def fields_of(content: ProjectFile) -> dict[str, Any]:
    """A project's fields, by name, as project.json has them; the images by id."""
    own = {name: getattr(content, name) for name in _own_fields()}
    return own | {"images": {image.id: image for image in content.images}}


def _own_fields() -> list[str]:
    return [name for name in ProjectFile.model_fields if name != "schema_version"]
