"""The recognizer: a small JSON file that says how to recognize a state in a new image.

    verdict = Recognizer.load("refrigerator.json").recognize("photo.jpg")

Loading needs neither gradio nor a search library. The same choice gives the same bytes: no
times, dates or paths stand in the file.
"""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from vqa_state import models
from vqa_state.answers.answer import PARSER_VERSION, Answer
from vqa_state.answers.table import MISSING
from vqa_state.errors import RecognizerError
from vqa_state.images.picture_input import PictureInput, picture_pixels
from vqa_state.models import VQAModel
from vqa_state.questions.grid import MAX_QUESTIONS
from vqa_state.recognizer.counting import Said, Shares, as_arrays, as_verdict, judged_so_far
from vqa_state.recognizer.inference import ask_all, shifted
from vqa_state.recognizer.schema import (
    Abstain,
    Copies,
    EstimateRecord,
    IncompleteRecord,
    ModelReference,
    Origin,
    ProofRecord,
    Record,
    ScoreRecord,
    Scores,
    States,
    WeightedQuestion,
    Words,
    content_digest,
    upgraded,
)
from vqa_state.recognizer.verdict import Verdict, Vote
from vqa_state.storage.atomic_write import write_atomically
from vqa_state.votes.judgement import Judgement
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import FittedVote, VoteKind

__all__ = [
    "Abstain",
    "Copies",
    "EstimateRecord",
    "IncompleteRecord",
    "ModelReference",
    "Origin",
    "ProofRecord",
    "Recognizer",
    "ScoreRecord",
    "Scores",
    "States",
    "WeightedQuestion",
    "read_recognizer",
    "recognize_all",
]

MAX_FILE_BYTES: Final = 5_000_000


class Recognizer(Record):
    """Questions whose vote recognizes a state; see the module's first lines for its use."""

    schema_version: Literal[3, 4] = 3
    """Of this form of the file; 4 where `incomplete` stands. docs/recognizer.md says how a verdict
    comes from it."""
    name: Words
    """Of the project; shown, no more."""
    states: States
    """What verdicts are called."""
    model: ModelReference
    """The model to ask."""
    copies: Copies
    """What to ask about: these copies of an image."""
    questions: Annotated[
        tuple[WeightedQuestion, ...], Field(min_length=1, max_length=MAX_QUESTIONS)
    ]
    """What to ask about every copy; no text stands there twice."""
    vote: VoteKind = VoteKind.PAPER
    """How answers are counted; docs/recognizer.md has the formulas."""
    threshold: Annotated[float, Field(gt=0, lt=1)] = 0.5
    """Share above which the positive state wins; at most six digits."""
    abstain: Abstain = Abstain()
    """When the verdict is unknown; always exactly at the threshold or without a valid vote."""
    parser_version: Annotated[int, Field(ge=1, le=PARSER_VERSION)] = PARSER_VERSION
    """Of the rules that read yes or no out of a text."""
    origin: Origin | None
    """How a search chose the questions; null where nothing chose, and all of the project's are
    asked. It changes no verdict."""
    scores: Scores
    """How good it was on the project's images; it changes no verdict."""
    estimate: EstimateRecord | None = None
    """How good it will be on new images; it changes no verdict. Null where it is not known."""
    incomplete: Annotated[IncompleteRecord | None, Field(exclude_if=lambda one: one is None)] = None
    """Stands there only where training images lacked answers; it changes no verdict. `scores.test`
    is null then."""
    calls_per_image: int
    """Copies × questions."""
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
        self._check_vote()
        self._check_part()
        self.rule()  # says what is wrong with weights or threshold
        return self

    def _check_vote(self) -> None:
        """The simple kinds weigh nothing, and the paper's wins by the majority."""
        simple = not self.vote.weighted
        if simple and any(question.weight != 1 for question in self.questions):
            raise ValueError(f"the vote by {self.vote.value!r} gives every question the weight 1")
        if self.vote is VoteKind.PAPER and self.threshold != 0.5:
            raise ValueError(f"the paper's vote has the threshold 0.5, got {self.threshold}")

    def _check_part(self) -> None:
        """A search on part of the images says so, and opened no test."""
        part = self.incomplete
        if (part is None) != (self.schema_version == 3):
            raise ValueError("schema version 4 is that of files with `incomplete`, and of no other")
        if part is not None and self.scores.test is not None:
            raise ValueError("a search on part of the images has no test score")
        if part is not None and self.scores.train.n_images != part.n_images:
            raise ValueError(
                f"its training score is of {self.scores.train.n_images} images, its search of "
                f"{part.n_images}"
            )

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
        digest = {"digest": content_digest(content)}
        return (json.dumps(content | digest, indent=1) + "\n").encode()

    def save(self, path: str | Path) -> None:
        """Write the file, whole or not at all.

        Raises:
            ProjectError: if it cannot be written.
        """
        write_atomically(Path(path), self.to_bytes())

    def rule(self) -> AbstainRule:
        """The vote and its abstaining; the questions' positions are those of this file."""
        n_questions = len(self.questions)
        vote = FittedVote(
            kind=self.vote,
            questions=tuple(range(n_questions)),
            weights=tuple(question.weight for question in self.questions),
            flipped=(False,) * n_questions,  # a flip stands in yes_means
            threshold=self.threshold,
        )
        return AbstainRule(vote, self.abstain.min_sureness)

    def recognize(
        self,
        image: PictureInput,
        model: VQAModel | None = None,
        *,
        stop_early: bool = False,
    ) -> Verdict:
        """Ask this recognizer's questions about one image and count the votes.

        Args:
            image: a path, a file's content, a Pillow image, or a frame as an array of uint8 RGB
                values, shape (height, width, 3).
            model: to share a loaded model between recognizers; without it, the one that the file
                names is loaded on first use and kept.
            stop_early: ask copy by copy, and only until the rest cannot change the verdict. The
                state is always the same; `n_skipped` says what was saved. Worth it where calls are
                slow or cost money.

        Raises:
            ImageError: if the picture cannot be read.
            RecognizerError: if the model is another one than the questions were chosen for, or
                gives no probability where the vote needs one.
            ModelError: if the model cannot be loaded, or gave not all answers: a failed call is
                an error, never a verdict.
        """
        model = model or self.loaded_model()
        self.check_model(model)
        began = time.perf_counter()
        texts = [question.text for question in self.questions]
        pictures = shifted(picture_pixels(image), self.copies)
        if not stop_early:
            votes = self.votes(ask_all(model, pictures, texts))
            return self.verdict(votes, 1000 * (time.perf_counter() - began))
        answers: dict[tuple[int, str], Answer] = {}
        for number in range(len(pictures)):
            said = ask_all(model, pictures[number : number + 1], texts)
            answers |= {(number, text): answer for (_, text), answer in said.items()}
            votes = self.votes(answers, n_copies=number + 1)
            verdict = self.verdict_so_far(votes, 1000 * (time.perf_counter() - began))
            if verdict is not None:
                return verdict
        raise AssertionError("a vote on all copies is always settled")

    def verdict(self, votes: Sequence[Vote], milliseconds: float = 0.0) -> Verdict:
        """Count the votes of all questions about all copies, in whole numbers.

        Raises:
            ValueError: if an answer is missing.

        Source: paper II-A for the paper's vote; `vqa_state.votes.reject_option` for the rest.
        """
        judged = self.rule().judge(*self._arrays(votes))
        reason = judged.reason(self.states.positive, self.states.negative)
        return self._verdict(votes, judged, reason, milliseconds)

    def verdict_so_far(self, votes: Sequence[Vote], milliseconds: float = 0.0) -> Verdict | None:
        """The verdict, if the answers that are still missing cannot change it; else None.

        Its sureness is the least that the open answers could leave; if unknown, the most.
        """
        rule, (said, p_positive) = self.rule(), self._arrays(votes)
        n_open = int((said == MISSING).sum())
        if n_open == 0:
            return self.verdict(votes, milliseconds)
        judged = judged_so_far(rule, said, p_positive)
        if judged is None:
            return None
        reason = judged.reason_so_far(self.states.positive, self.states.negative, n_open)
        return self._verdict(votes, judged, reason, milliseconds)

    def _verdict(
        self, votes: Sequence[Vote], judged: Judgement, reason: str, milliseconds: float
    ) -> Verdict:
        n_skipped = self.calls_per_image - len(votes)
        return as_verdict(votes, judged, self.states, reason, n_skipped, milliseconds)

    def _arrays(self, votes: Sequence[Vote]) -> tuple[Said, Shares | None]:
        return as_arrays(votes, self.questions, self.copies.n_copies, self.vote)

    @property
    def caution(self) -> str:
        """What to know before relying on it, in a sentence; "" if there is nothing."""
        if self.parser_version == PARSER_VERSION:
            return ""
        return (
            f"{self.name}: its questions were chosen and scored when answers were read by older "
            f"rules (parser_version {self.parser_version}); its verdicts are by those of this "
            f"program ({PARSER_VERSION}), by which “No doubt” is no “no”: export it again from its "
            "project, and both are alike"
        )

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
                f"these questions are for {self.model.fingerprint!r}, but the model here "
                f"is {model.fingerprint!r}. If it is the same model elsewhere, on another device "
                "or at another precision, name it as it was: `python -m vqa_state recognize "
                "--model ADDRESS`, with ?device=DEVICE&precision=PRECISION&max_tokens=N at the "
                "address's end. "
                "Otherwise see what is lost with `python -m vqa_state recheck`, or optimize again: "
                "which questions work depends on the model"
            )

    def votes(
        self, answers: Mapping[tuple[int, str], Answer], n_copies: int | None = None
    ) -> list[Vote]:
        """This recognizer's votes among answers by (copy, question text), by copy and question.

        With `n_copies`, only those about the first so many copies.

        Raises:
            KeyError: if an answer is missing.
        """
        return [
            Vote(text, number, answer, answer.verdict(question.yes_means))
            for number in range(self.copies.n_copies if n_copies is None else n_copies)
            for question in self.questions
            for text, answer in ((question.text, answers[number, question.text]),)
        ]


def recognize_all(
    image: PictureInput,
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
    pixels = picture_pixels(image)
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
        answers = ask_all(own, shifted(pixels, shifts), texts)
        milliseconds = 1000 * (time.perf_counter() - began)
        for place, one in zip(places, members, strict=True):
            verdict = one.verdict(one.votes(answers), milliseconds)
            found[place] = replace(verdict, n_calls=len(answers))
    return [found[place] for place in range(len(recognizers))]


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
        content: Any = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise RecognizerError(
            f"{shown} is no JSON file or is damaged; export the recognizer again"
        ) from error
    if not isinstance(content, dict):
        raise RecognizerError(f"{shown} is no recognizer file: it has no schema_version")
    whole = content.get("digest") == content_digest(content)
    try:
        recognizer = Recognizer.model_validate_json(json.dumps(upgraded(content, shown)))
    except ValidationError as error:
        first = error.errors()[0]
        raise RecognizerError(
            f"{shown} cannot be used at {'.'.join(map(str, first['loc'])) or 'its top'}: "
            f"{first['msg']}; export the recognizer again"
        ) from error
    if not whole:
        raise RecognizerError(
            f"{shown} was changed after it was written: its digest does not fit; export the "
            "recognizer again"
        )
    return recognizer
