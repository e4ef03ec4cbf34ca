"""What stands in a recognizer's file, and how files of older versions are read.

A file of version 1 is the paper's vote: weights and threshold stood in it, but every program that
wrote one wrote weight 1 and threshold 0.5. In a file of version 2 a search chose the questions.
Version 4 is written only where `incomplete` stands, so all other files stay as they are.
"""

import ast
import hashlib
import inspect
import json
from itertools import pairwise
from textwrap import dedent
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from vqa_state.errors import ProjectError, QuestionError, RecognizerError
from vqa_state.images.augmentation import MAX_COPIES, AugmentationKind
from vqa_state.models.address import MAX_ADDRESS
from vqa_state.questions.grid import clean_text
from vqa_state.questions.states import StateNames
from vqa_state.search.badge import Badge
from vqa_state.search.engines import Engine
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.votes.rules import MAX_WEIGHT, VoteKind

if TYPE_CHECKING:
    from pydantic import GetJsonSchemaHandler
    from pydantic.json_schema import JsonSchemaValue
    from pydantic_core import CoreSchema

__all__ = [
    "SCHEMA_VERSION",
    "Abstain",
    "CarefulRecord",
    "Copies",
    "EstimateRecord",
    "IncompleteRecord",
    "ModelReference",
    "Origin",
    "ProofRecord",
    "ScoreRecord",
    "Scores",
    "States",
    "WeightedQuestion",
    "Words",
    "content_digest",
    "upgraded",
]

SCHEMA_VERSION: Final = 4
MAX_FINGERPRINT: Final = 10_000
_LONGEST = 300  # characters of a text


class Record(BaseModel):
    """A part of the file; it never changes and knows no other fields than its own."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        defer_build=True,  # importing a recognizer takes half as long
    )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: "CoreSchema", handler: "GetJsonSchemaHandler"
    ) -> "JsonSchemaValue":
        """The schema with what the docstring under each field says.

        Pydantic's `use_attribute_docstrings` reads every source file whenever this is imported.
        """
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema)["properties"]
        for name, text in _attribute_docstrings(cls).items():
            properties[name].setdefault("description", text)
        return schema


def _attribute_docstrings(record: type[Record]) -> dict[str, str]:
    """The string under each annotated attribute of a class, by the attribute's name."""
    (tree,) = ast.parse(dedent(inspect.getsource(record))).body
    assert isinstance(tree, ast.ClassDef)  # noqa: S101  # it is the source of a class
    return {
        field.target.id: inspect.cleandoc(below.value.value)
        for field, below in pairwise(tree.body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }


def _cleaned(text: str) -> str:
    """As a project has it: answers are found again, and no terminal obeys it."""
    try:
        return clean_text(text, "a text", _LONGEST)
    except QuestionError as error:
        raise ValueError(str(error)) from error  # pydantic names the place


Words = Annotated[str, Field(min_length=1, max_length=_LONGEST), AfterValidator(_cleaned)]
Seed = Annotated[int, Field(ge=0, lt=2**32)]
Share = Annotated[float, Field(ge=0, le=1)]


class States(Record):
    """What the two states are called."""

    positive: Words
    """What a verdict for the positive state is called."""
    negative: Words
    """What a verdict for the negative state is called; another word, and not "unknown"."""

    @model_validator(mode="after")
    def _differ(self) -> "States":
        try:
            StateNames(self.positive, self.negative)
        except ProjectError as error:
            raise ValueError(str(error)) from error
        return self


class ModelReference(Record):
    """The model that the questions are for. Its revision stands in the fingerprint."""

    name: Annotated[str, Field(min_length=1, max_length=MAX_ADDRESS)]
    """How the model was called where it was asked: a name or an address."""
    fingerprint: Annotated[str, Field(min_length=1, max_length=MAX_FINGERPRINT)]
    """Tells two models apart: weights, prompt, precision. Another one's answers do not count."""


class Copies(Record):
    """The copies of an image that the questions are asked about."""

    kind: AugmentationKind
    """rgb-shift: one shift a channel. gaussian-noise: noise on every value."""
    amount: Annotated[float, Field(gt=0, le=1)]
    """Share of full scale: the largest shift, or the noise's standard deviation."""
    n_copies: Annotated[int, Field(ge=1, le=MAX_COPIES)]
    """Number of copies; the image itself is not asked about."""
    seed: Seed
    """With the pixels and the copy's number, it gives the copy; docs/recognizer.md says how."""


class WeightedQuestion(Record):
    """A question, the state that "yes" counts for, and what its answers weigh in the vote.

    A weighted vote may count a question for the state that its words do not name: the model's
    "yes" then says the opposite, as the training images showed.
    """

    text: Words
    """What the model is asked, as it stands here."""
    yes_means: Literal[-1, 1]
    """+1: a yes speaks for the positive state and a no for the negative one; -1: the reverse."""
    weight: Annotated[int, Field(ge=1, le=MAX_WEIGHT)] = 1
    """What each answer to it weighs; 1 in the votes "paper" and "threshold"."""


class CarefulRecord(Record):
    """How right the verdicts are that abstaining leaves, by votes that never saw their image.

    Of `n_votes` single out-of-bag votes on `n_images` training images, `n_verdicts` are sure
    enough, and `n_right` of these are right. `low` to `high` is a 95 % interval of that share,
    which knows that an image has several votes (vqa_state/evaluation/coverage.py).
    """

    n_images: Annotated[int, Field(ge=1)]
    """Training images."""
    n_votes: Annotated[int, Field(ge=1)]
    """Single votes on them by recognizers that never saw the image."""
    n_verdicts: Annotated[int, Field(ge=1)]
    """Votes that are sure enough for a verdict."""
    n_right: Annotated[int, Field(ge=0)]
    """Verdicts that are right."""
    low: Share
    """Lower end of the 95 % interval of n_right / n_verdicts."""
    high: Share
    """Upper end of it."""

    @model_validator(mode="after")
    def _possible(self) -> "CarefulRecord":
        if not self.n_right <= self.n_verdicts <= self.n_votes or self.low > self.high:
            raise ValueError(
                f"{self.n_right} right of {self.n_verdicts} verdicts of {self.n_votes} votes, "
                f"interval {self.low} to {self.high}: such counts cannot be"
            )
        return self

    def sentence(self) -> str:
        """The counts in words."""
        return (
            f"Of {self.n_votes} votes on {self.n_images} training images by recognizers that never "
            f"saw them, {self.n_verdicts} are sure enough, and {self.n_right} of these are right "
            f"({self.n_right / self.n_verdicts:.0%}, 95 % interval {self.low:.0%} to "
            f"{self.high:.0%})."
        )


class Abstain(Record):
    """When the verdict is unknown, besides at a tie and where no answer counts.

    `min_sureness` 0 asks for nothing more. `coverage` is the share of images that was to get a
    verdict when it was learned, None if it was not learned; `out_of_bag` then says how right they
    are. It does not stand in the file where it is not known.
    """

    min_sureness: Share = 0.0
    """Sureness below which the verdict is unknown; docs/recognizer.md has its formula."""
    coverage: Annotated[float | None, Field(gt=0, le=1)] = None
    """Share of images that was to get a verdict; it changes no verdict."""
    out_of_bag: Annotated[CarefulRecord | None, Field(exclude_if=lambda one: one is None)] = None
    """How right the remaining verdicts are; it changes no verdict."""


class ProofRecord(Record):
    """What is proved about the subset: no other has a larger E than `bound`.

    `n_bound` images of the `n_images` training ones are the most that any subset recognizes.
    """

    badge: Badge
    """What was proved: the best subset, the most images, or only a bound."""
    value: float
    """E of the subset, the value that the search makes as large as it can."""
    bound: float
    """No subset has a larger E."""
    n_bound: Annotated[int, Field(ge=0)]
    """No subset recognizes more training images."""
    stopped: bool
    """Whether a user ended the proof."""


class Origin(Record):
    """How the questions were chosen; `finished` is False if a user stopped the search.

    The weighted kinds of vote choose their questions and weights themselves, from all questions.
    """

    engine: Engine = Engine.PAPER
    """How it was searched."""
    objective: Objective
    """What was made as large as possible: s+ for accuracy, s- for few questions."""
    weights: ObjectiveWeights
    """Of the terms of E."""
    settings: SearchSettings
    """Of the genetic algorithm."""
    seed: Seed
    """Of the search."""
    generations: Annotated[int, Field(ge=0)]
    """That were run; the engine "default" counts its climbs as more of them."""
    finished: bool
    """Whether search and proof came to their end."""
    proof: ProofRecord | None = None
    """Null where nothing was proved."""


class ScoreRecord(Record):
    """Result on one side of the images; 95 % intervals (R_img: share recognized) on test only.

    Rates and their intervals are those of the paper's vote; None for another kind of vote.
    """

    n_recognized: Annotated[int, Field(ge=0)]
    """Images whose verdict is their label."""
    n_images: Annotated[int, Field(ge=1)]
    """Images with a label and all their answers."""
    R_ave: float | None = None
    """Mean over the images of their share of right answers among the valid ones."""
    R_invalid: float | None = None
    """Share of invalid answers."""
    R_img_interval: tuple[float, float] | None = None
    """Exact, of n_recognized / n_images."""
    R_ave_interval: tuple[float, float] | None = None
    """By bootstrap over the images."""
    R_invalid_interval: tuple[float, float] | None = None
    """By bootstrap over the images."""

    @model_validator(mode="after")
    def _possible(self) -> "ScoreRecord":
        if self.n_recognized > self.n_images:
            raise ValueError(f"{self.n_recognized} of {self.n_images} images cannot be recognized")
        return self


class Scores(Record):
    """Training images chose the questions; only the test images say how good they are.

    Unless `origin` is null: then no image chose a question, and the training images say it as
    well, apart from the one choice to take all.
    """

    train: ScoreRecord
    """On the training images."""
    test: ScoreRecord | None
    """On held-out images; null without any, and where answers are missing."""


class EstimateRecord(Record):
    """What share of new images this kind of vote will recognize, from training images alone.

    Of the vote before it abstains. Out of bag: search and fits, and for the recommended kind the
    choice between the kinds, were repeated on `n_resamples` resamples, and judged on the images
    that each lacked. The interval is one of 95 %.
    """

    share: Share
    """Of new images that will be recognized."""
    low: Share
    """Lower end of its interval."""
    high: Share
    """Upper end of its interval."""
    n_images: Annotated[int, Field(ge=1)]
    """Training images that it was made of."""
    n_resamples: Annotated[int, Field(ge=1)]
    """Resamples that it was made of."""

    @model_validator(mode="after")
    def _in_order(self) -> "EstimateRecord":
        if not self.low <= self.share <= self.high:
            raise ValueError(f"{self.share} is not from {self.low} to {self.high}")
        return self


class IncompleteRecord(Record):
    """The search saw only part of the labelled training images; the others lacked answers.

    A person said that these are enough. The test was not opened for it.
    """

    n_images: Annotated[int, Field(ge=1)]
    """Training images that have all their answers; search and scores are of these."""
    n_labelled: Annotated[int, Field(ge=2)]
    """All labelled training images, more than `n_images`."""

    @model_validator(mode="after")
    def _part(self) -> "IncompleteRecord":
        if self.n_images >= self.n_labelled:
            raise ValueError(f"{self.n_images} of {self.n_labelled} images are not a part of them")
        return self


def content_digest(content: dict[str, Any]) -> str:
    """SHA-256 of all but the digest itself."""
    rest = {key: value for key, value in content.items() if key != "digest"}
    canonical = json.dumps(rest, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()


def upgraded(content: dict[str, Any], shown: str) -> dict[str, Any]:
    """The content as this version has it.

    Raises:
        RecognizerError: if it has no version, or comes from a newer program.
    """
    version = content.get("schema_version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise RecognizerError(f"{shown} is no recognizer file: it has no schema_version")
    if version > SCHEMA_VERSION:
        raise RecognizerError(
            f"{shown} has schema version {version}; this program reads up to {SCHEMA_VERSION}: "
            "update the program"
        )
    if version >= 3:
        return content
    if version == 2:
        return content | {"schema_version": 3}
    plain = content.get("threshold", 0.5) == 0.5
    changed = {
        "schema_version": 3,
        "vote": VoteKind.PAPER.value if plain else VoteKind.THRESHOLD.value,
        "abstain": {} if content.get("abstain", "tie") == "tie" else content["abstain"],
    }
    return content | changed
