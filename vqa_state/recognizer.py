"""The recognizer: a small JSON file that says how to recognize a state in a new image.

    verdict = Recognizer.load("refrigerator.json").recognize("photo.jpg")

Loading needs neither gradio nor a search library. The same choice gives the same bytes: no
times, dates or paths stand in the file.
"""

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from PIL import Image
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from vqa_state import models
from vqa_state.answers import PARSER_VERSION, Answer
from vqa_state.augment import MAX_COPIES, Augmentation, AugmentationKind, copies
from vqa_state.errors import ModelError, RecognizerError
from vqa_state.files import write_atomically
from vqa_state.images import pixel_hash, read_file, read_picture, rgb_pixels
from vqa_state.models.address import MAX_ADDRESS
from vqa_state.models.base import Failure, VQAModel
from vqa_state.questions import MAX_QUESTIONS
from vqa_state.scores import Objective, ObjectiveWeights
from vqa_state.search.genetic import SearchSettings
from vqa_state.verdict import State, Verdict, Vote

__all__ = [
    "Copies",
    "ModelReference",
    "Origin",
    "Recognizer",
    "ScoreRecord",
    "Scores",
    "States",
    "WeightedQuestion",
    "read_recognizer",
    "recognize_all",
]

SCHEMA_VERSION: Final = 1
MAX_FILE_BYTES: Final = 5_000_000
MAX_FINGERPRINT: Final = 10_000


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class States(_Record):
    """What the two states are called."""

    positive: Annotated[str, Field(min_length=1, max_length=300)]
    negative: Annotated[str, Field(min_length=1, max_length=300)]


class ModelReference(_Record):
    """The model that the questions were chosen for. Its revision stands in the fingerprint."""

    name: Annotated[str, Field(min_length=1, max_length=MAX_ADDRESS)]
    fingerprint: Annotated[str, Field(min_length=1, max_length=MAX_FINGERPRINT)]


class Copies(_Record):
    """The copies of an image that the questions are asked about."""

    kind: AugmentationKind
    amount: Annotated[float, Field(gt=0, le=1)]
    n_copies: Annotated[int, Field(ge=1, le=MAX_COPIES)]
    seed: Annotated[int, Field(ge=0)]


class WeightedQuestion(_Record):
    """A question, the state that "yes" speaks for, and what its answers weigh in the vote."""

    text: Annotated[str, Field(min_length=1, max_length=300)]
    yes_means: Literal[-1, 1]
    weight: Annotated[float, Field(gt=0)] = 1.0


class Origin(_Record):
    """How the questions were chosen; `finished` is False if a user stopped the search."""

    engine: Literal["paper"] = "paper"
    objective: Objective
    weights: ObjectiveWeights
    settings: SearchSettings
    seed: int
    generations: int
    finished: bool


class ScoreRecord(_Record):
    """Result on one side of the images; 95 % intervals (R_img: share recognized) on test only."""

    n_recognized: int
    n_images: int
    R_ave: float
    R_invalid: float
    R_img_interval: tuple[float, float] | None = None
    R_ave_interval: tuple[float, float] | None = None
    R_invalid_interval: tuple[float, float] | None = None


class Scores(_Record):
    """Training images chose the questions; only the test images say how good they are."""

    train: ScoreRecord
    test: ScoreRecord | None


class Recognizer(_Record):
    """Questions whose vote recognizes a state; see the module's first lines for its use."""

    schema_version: Literal[1] = SCHEMA_VERSION
    name: Annotated[str, Field(min_length=1, max_length=300)]
    states: States
    model: ModelReference
    copies: Copies
    questions: Annotated[
        tuple[WeightedQuestion, ...], Field(min_length=1, max_length=MAX_QUESTIONS)
    ]
    threshold: Annotated[float, Field(gt=0, lt=1)] = 0.5
    """Share of the valid votes above which the positive state wins."""
    abstain: Literal["tie"] = "tie"
    """When the verdict is unknown: exactly at the threshold, or without a valid vote."""
    parser_version: Annotated[int, Field(ge=1, le=PARSER_VERSION)] = PARSER_VERSION
    origin: Origin
    scores: Scores
    calls_per_image: int
    digest: Annotated[str, Field(pattern="^([0-9a-f]{64})?$")] = ""
    """SHA-256 of all the rest; it finds damage, it is no signature."""

    _model: VQAModel | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _consistent(self) -> "Recognizer":
        texts = [question.text for question in self.questions]
        if len(set(texts)) < len(texts):
            raise ValueError("a question stands there twice")
        if self.calls_per_image != self.copies.n_copies * len(texts):
            raise ValueError(
                f"calls_per_image must be copies × questions = "
                f"{self.copies.n_copies * len(texts)}, got {self.calls_per_image}"
            )
        return self

    @classmethod
    def load(cls, path: str | Path) -> "Recognizer":
        """Read a recognizer file. No model is loaded yet.

        Raises:
            RecognizerError: if it is missing, too large, damaged, newer than this program, or
                holds a field that this program does not know.
        """
        try:
            with Path(path).open("rb") as file:
                data = file.read(MAX_FILE_BYTES + 1)
        except OSError as error:
            raise RecognizerError(
                f"cannot read {path}: {error.strerror}; check the path"
            ) from error
        return read_recognizer(data, str(path))

    def to_bytes(self) -> bytes:
        """The file's content, with its digest."""
        content = self.model_dump(mode="json", exclude={"digest"})
        return (json.dumps(content | {"digest": _digest(content)}, indent=1) + "\n").encode()

    def save(self, path: str | Path) -> None:
        """Write the file, whole or not at all.

        Raises:
            ProjectError: if it cannot be written.
        """
        write_atomically(Path(path), self.to_bytes())

    def recognize(
        self, image: str | Path | bytes | Image.Image, model: VQAModel | None = None
    ) -> Verdict:
        """Ask this recognizer's questions about one image and count the votes.

        Args:
            image: a file's path or content, or an opened picture (a webcam frame).
            model: to share a loaded model between recognizers; without it, the one that the file
                names is loaded on first use and kept.

        Raises:
            ImageError: if the picture cannot be read.
            RecognizerError: if the model is another one than the questions were chosen for.
            ModelError: if the model cannot be loaded, or gave not all answers: a failed call is
                an error, never a verdict.
        """
        model = model or self.loaded_model()
        self.check_model(model)
        began = time.perf_counter()
        texts = [question.text for question in self.questions]
        answers = _ask(model, _pixels(image), self.copies, texts)
        milliseconds = 1000 * (time.perf_counter() - began)
        return self.verdict(self.votes(answers), milliseconds)

    def verdict(self, votes: Sequence[Vote], milliseconds: float = 0.0) -> Verdict:
        """Count votes. Source: paper II-A for weight 1 and threshold 0.5, decided with integers."""
        weight = {question.text: question.weight for question in self.questions}
        valid = [vote for vote in votes if vote.speaks_for]
        total = sum(weight[vote.question] for vote in valid)
        positive = sum(weight[vote.question] for vote in valid if vote.speaks_for > 0)
        state, reason = self._decide(positive, total)
        share = positive / total if total else float("nan")
        n_positive = sum(vote.speaks_for > 0 for vote in valid)
        return Verdict(
            state=state,
            state_name={
                State.POSITIVE: self.states.positive,
                State.NEGATIVE: self.states.negative,
                State.UNKNOWN: "unknown",
            }[state],
            reason=reason,
            confidence=max(share, 1 - share),
            n_positive=n_positive,
            n_negative=len(valid) - n_positive,
            n_invalid=len(votes) - len(valid),
            n_calls=len(votes),
            milliseconds=milliseconds,
            votes=tuple(votes),
        )

    def _decide(self, positive: float, total: float) -> tuple[State, str]:
        if not total:
            return State.UNKNOWN, "no answer was a clear yes or no"
        share = f"{positive / total:.0%} of the valid votes speak for {self.states.positive}"
        if positive > self.threshold * total:
            return State.POSITIVE, share
        if positive < self.threshold * total:
            return State.NEGATIVE, share
        return State.UNKNOWN, f"the vote is a tie: {share}"

    def loaded_model(self) -> VQAModel:
        """The model that the file names, loaded on first use and kept.

        Raises:
            NotApprovedError: if it comes from outside this package and the user never chose it.
            ModelError: if it cannot be loaded.
        """
        self._model = self._model or models.create(self.model.name)
        return self._model

    def check_model(self, model: VQAModel) -> None:
        """Do nothing for the model that the questions were chosen for.

        Raises:
            RecognizerError: if it is another one.
        """
        if model.fingerprint != self.model.fingerprint:
            raise RecognizerError(
                f"these questions were chosen for {self.model.fingerprint!r}, but the model here "
                f"is {model.fingerprint!r}; which questions work depends on the model: see what is "
                "lost with `python -m vqa_state recheck`, or optimize again with this one"
            )

    def votes(self, answers: Mapping[tuple[int, str], Answer]) -> list[Vote]:
        """This recognizer's votes among answers by (copy, question text), by copy and question.

        Raises:
            KeyError: if an answer is missing.
        """
        return [
            Vote(text, number, answer, answer.verdict(question.yes_means))
            for number in range(self.copies.n_copies)
            for question in self.questions
            for text, answer in ((question.text, answers[number, question.text]),)
        ]


def recognize_all(
    image: str | Path | bytes | Image.Image,
    recognizers: Sequence[Recognizer],
    model: VQAModel | None = None,
) -> list[Verdict]:
    """What several recognizers say about one image, for little more than the price of one.

    Each copy is encoded once, and the union of the questions is asked once (the paper's point that
    one model serves every state). The verdicts are those of `Recognizer.recognize`, one by one.

    Args:
        image: see `Recognizer.recognize`.
        recognizers: any number; those of one model with the same copies share their calls.
        model: the loaded model of all of them; without it, each one that a file names is loaded.

    Returns:
        One verdict for each recognizer, in their order; `n_calls` and `milliseconds` of each are
        those of its whole group.

    Raises:
        ImageError: if the picture cannot be read.
        RecognizerError: if a model is another one than the questions were chosen for.
        ModelError: see `Recognizer.recognize`.
    """
    pixels = _pixels(image)
    groups: dict[tuple[str, Copies], list[int]] = {}
    for place, recognizer in enumerate(recognizers):
        groups.setdefault((recognizer.model.fingerprint, recognizer.copies), []).append(place)
    found: dict[int, Verdict] = {}
    for (_, shifts), places in groups.items():
        own = model or recognizers[places[0]].loaded_model()
        members = [recognizers[place] for place in places]
        for one in members:
            one.check_model(own)
        texts = list(dict.fromkeys(q.text for one in members for q in one.questions))
        began = time.perf_counter()
        answers = _ask(own, pixels, shifts, texts)
        milliseconds = 1000 * (time.perf_counter() - began)
        for place, one in zip(places, members, strict=True):
            verdict = one.verdict(one.votes(answers), milliseconds)
            found[place] = replace(verdict, n_calls=len(answers))
    return [found[place] for place in range(len(recognizers))]


def _ask(
    model: VQAModel, pixels: Image.Image, shifts: Copies, texts: Sequence[str]
) -> dict[tuple[int, str], Answer]:
    """Every answer, by (copy, question text); a failed call is an error, never a verdict."""
    kind = Augmentation(shifts.kind, shifts.amount, shifts.n_copies)
    shifted = list(copies(pixels, pixel_hash(pixels), kind, shifts.seed))
    answers: dict[tuple[int, str], Answer] = {}
    failure = "it gave no reply to a question"
    for reply in model.answer(shifted, texts):
        if isinstance(reply.outcome, Failure):
            failure = reply.outcome.reason
        else:
            answers[reply.image, texts[reply.question]] = reply.outcome
    n_calls = len(shifted) * len(texts)
    if len(answers) < n_calls:
        raise ModelError(
            f"{n_calls - len(answers)} of {n_calls} calls to {model.name} failed ({failure}); "
            "there is no verdict: try again"
        )
    return answers


def read_recognizer(data: bytes, shown: str) -> Recognizer:
    """Check the content of a recognizer file; `shown` names it in errors.

    Raises:
        RecognizerError: see `Recognizer.load`.
    """
    if len(data) > MAX_FILE_BYTES:
        raise RecognizerError(
            f"{shown} has more than {MAX_FILE_BYTES / 1e6:.0f} MB; this is no recognizer file"
        )
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise RecognizerError(
            f"{shown} is no JSON file or is damaged; export the recognizer again"
        ) from error
    _check_version(content, shown)
    try:
        recognizer = Recognizer.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        raise RecognizerError(
            f"{shown} cannot be used at {'.'.join(map(str, first['loc'])) or 'its top'}: "
            f"{first['msg']}; export the recognizer again"
        ) from error
    if recognizer.digest != _digest(recognizer.model_dump(mode="json", exclude={"digest"})):
        raise RecognizerError(
            f"{shown} was changed after it was written: its digest does not fit; export the "
            "recognizer again"
        )
    return recognizer


def _check_version(content: Any, shown: str) -> None:
    version = content.get("schema_version") if isinstance(content, dict) else None
    if not isinstance(version, int):
        raise RecognizerError(f"{shown} is no recognizer file: it has no schema_version")
    if version > SCHEMA_VERSION:
        raise RecognizerError(
            f"{shown} has schema version {version}; this program reads up to {SCHEMA_VERSION}: "
            "update the program"
        )


def _digest(content: dict[str, Any]) -> str:
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()


def _pixels(image: str | Path | bytes | Image.Image) -> Image.Image:
    if isinstance(image, Image.Image):
        return rgb_pixels(image)
    return read_picture(image if isinstance(image, bytes) else read_file(Path(image))).pixels
