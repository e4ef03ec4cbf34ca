"""What is kept of a project's searches: searches/OBJECTIVE.json, and what is made of them."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from vqa_state.answers.completeness import Completeness
from vqa_state.answers.table import AnswerTable
from vqa_state.evaluation.held_out import Evaluation
from vqa_state.project.project import Project
from vqa_state.recognizer.recognizer import IncompleteRecord, ProofRecord
from vqa_state.search.engines import Engine
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights

__all__ = ["Results", "SavedSearch", "read_search", "search_path", "table_digest"]


class SavedSearch(BaseModel):
    """Content of searches/OBJECTIVE.json. Files of version 1 are the paper's engine's."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[1, 2] = 2
    objective: Objective
    table: str
    """Digest of the answers and labels that were searched; other ones make this result stale."""
    engine: Engine = Engine.PAPER
    weights: ObjectiveWeights
    settings: SearchSettings
    seed: int
    subset: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)]
    """Of the proof, if it found a better one than the search."""
    curve: Annotated[tuple[tuple[float, float], ...], Field(min_length=1)]
    """Best and mean fitness of each generation of the search."""
    finished: bool
    proof: ProofRecord | None = None
    incomplete: Annotated[IncompleteRecord | None, Field(exclude_if=lambda one: one is None)] = None
    """Only where training images lacked answers, and a person said that the others are enough."""

    @model_validator(mode="before")
    @classmethod
    def _without_paper(cls, content: object) -> object:
        """Earlier programs also kept what the engine `paper` had found on the same answers."""
        if isinstance(content, dict):
            return {name: value for name, value in content.items() if name != "paper"}
        return content


@dataclass(frozen=True, eq=False)
class Results:
    """The searches of a project, and how good what they found is.

    Attributes:
        searches: the last search for each objective.
        evaluation: all candidates on train and test.
        train: answers about the complete training images.
        test: answers about the test images; None if there are none, and while an answer on either
            side is missing: then the test is closed.
        answers: how far both sides are answered.
    """

    searches: Mapping[Objective, SavedSearch]
    evaluation: Evaluation
    train: AnswerTable
    test: AnswerTable | None
    answers: Completeness

    @property
    def incomplete(self) -> IncompleteRecord | None:
        """What the searches saw, if that was only part of the training images."""
        return next(iter(self.searches.values())).incomplete


def table_digest(table: AnswerTable) -> str:
    """Of all that a search sees, and of nothing of the test images."""
    digest = hashlib.sha256(repr((table.image_ids, table.questions)).encode())
    digest.update(table.verdicts.tobytes())
    digest.update(table.labels.tobytes())
    return digest.hexdigest()


def search_path(project: Project, objective: Objective) -> Path:
    """Where the search for an objective is kept."""
    return project.folder / "searches" / f"{objective.name.lower()}.json"


def read_search(project: Project, objective: Objective) -> SavedSearch | None:
    """A search that cannot be read counts as none: it takes seconds to repeat."""
    try:
        return SavedSearch.model_validate_json(search_path(project, objective).read_bytes())
    except (OSError, ValidationError):
        return None
