"""The same recognizer on another model: ask its questions there, and see what is lost.

Which questions work depends on the model, so this tells whether a recognizer can move or must be
optimized again. It looks at the test images; whoever shows it counts the look.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.answer import Answer
from vqa_state.answers.store import AnswerStore, copy_keys
from vqa_state.errors import NothingToSearchError, RecognizerError
from vqa_state.evaluation.intervals import Interval, clopper_pearson
from vqa_state.evaluation.paired_tests import compare
from vqa_state.images.augmentation import Augmentation
from vqa_state.models import VQAModel
from vqa_state.project.project import LabelledImage, Project
from vqa_state.project.split import Split
from vqa_state.questions.grid import Question, QuestionGrid
from vqa_state.recognizer.counting import NO_PROBABILITIES
from vqa_state.recognizer.recognizer import Recognizer
from vqa_state.study.collect import AskProgress, ask
from vqa_state.votes.state import State

__all__ = ["Rechecked", "SideCheck", "recheck"]


@dataclass(frozen=True, slots=True)
class SideCheck:
    """One side of a project's images on the other model.

    Attributes:
        split: train or test.
        n_images: labelled images with all their answers.
        n_left_out: labelled images that lack an answer; a test side that has one stays closed.
        n_recognized: of `n_images`.
        interval: exact 95 % interval of the recognized share.
        before: images recognized on the recognizer's own model, of the same images; None where
            the project does not hold those answers.
        lost: ids of images that only the own model recognizes; empty where unknown.
        gained: ids of images that only the other model recognizes.
    """

    split: Split
    n_images: int
    n_left_out: int
    n_recognized: int
    interval: Interval
    before: int | None
    lost: tuple[str, ...]
    gained: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The comparison in plain words."""
        what = f"{self.split.value} images"
        if not self.n_images:
            return f"Answers about {self.n_left_out} {what} are missing, so none of them is judged."
        words = f"It recognizes {self.n_recognized} of {self.n_images} {what} on the other model"
        if self.before is None:
            return f"{words}; what it recognizes on its own model is not known here."
        return (
            f"{words}, {self.before} on its own: {len(self.lost)} lost, {len(self.gained)} gained."
        )


@dataclass(frozen=True, slots=True)
class Rechecked:
    """What became of a recognizer on another model.

    Attributes:
        model: the other model's name; `fingerprint` its fingerprint.
        sides: train and test, those that have images.
        says: whether the difference on the test images is more than luck; "" if it is not known.
    """

    model: str
    fingerprint: str
    sides: tuple[SideCheck, ...]
    says: str


def recheck(
    recognizer: Recognizer,
    project: Project,
    model: VQAModel,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[AskProgress | Rechecked]:
    """Ask a recognizer's questions on `model` about the project's labelled images.

    The answers go into the project's store, so nothing is paid for twice, and a search on this
    model finds them there.

    Yields:
        Progress of asking, and at the end, unless stopped, what was found.

    Raises:
        NothingToSearchError: if no image is labelled, or the model answered about none in full.
        RecognizerError: if the vote counts probabilities, and the model's first answer has none.
        ProjectError: if another program asks about this project now.
        StoreError: if an answer cannot be stored.
    """
    asked = _asked(recognizer, project)
    if recognizer.vote.by_p_yes:
        _require_probabilities(asked, model, stop)
    for progress in ask(asked, model, stop):
        yield progress
        if progress.stopped:
            return
    with AnswerStore(project.store_path) as store:
        sides = [_side(recognizer, asked, store, model.fingerprint, split) for split in _SIDES]
    if not any(side.check.n_images for side in sides):
        raise NothingToSearchError(
            f"{model.name} gave not all answers about any image; ask again, or choose another model"
        )
    yield Rechecked(
        model=model.name,
        fingerprint=model.fingerprint,
        sides=tuple(side.check for side in sides if side.check.n_images or side.check.n_left_out),
        says=_difference(sides[_SIDES.index(Split.TEST)]),
    )


_SIDES = (Split.TRAIN, Split.TEST)


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    check: SideCheck
    now: NDArray[np.bool_]
    before: NDArray[np.bool_] | None


def _asked(recognizer: Recognizer, project: Project) -> Project:
    """The project with the recognizer's questions and copies; it is never saved.

    Without its test images, if the search for the recognizer saw only part of the training images.
    """
    questions = tuple(Question(one.text, one.yes_means) for one in recognizer.questions)
    shifts, closed = recognizer.copies, recognizer.incomplete is not None
    images = project.images.items()
    return replace(
        project,
        images={key: one for key, one in images if not (closed and one.split is Split.TEST)},
        grid=QuestionGrid(custom=questions),
        augmentation=Augmentation(shifts.kind, shifts.amount, shifts.n_copies),
        seed=shifts.seed,
    )


def _require_probabilities(asked: Project, model: VQAModel, stop: Callable[[], bool]) -> None:
    """One call shows whether the model gives any, before thousands are paid for."""
    image = next(iter((*asked.labelled(Split.TRAIN), *asked.labelled(Split.TEST))), None)
    if image is None:
        return  # asking says what is missing
    (question, *_) = asked.grid.custom
    one = replace(
        asked,
        images={image.id: image},
        grid=QuestionGrid(custom=(question,)),
        augmentation=replace(asked.augmentation, n_copies=1),
    )
    for _ in ask(one, model, stop):
        pass
    (key,) = copy_keys(image.pixel_hash, one.augmentation, one.seed)
    with AnswerStore(asked.store_path) as store:
        said = store.answers(model.fingerprint, key, [question.text])
    if any(answer.p_yes is None for answer in said.values()):
        raise RecognizerError(NO_PROBABILITIES)


def _side(
    recognizer: Recognizer, asked: Project, store: AnswerStore, fingerprint: str, split: Split
) -> _Side:
    images = asked.labelled(split)
    after = [_recognized(recognizer, asked, store, fingerprint, image) for image in images]
    n_left_out = after.count(None)
    if split is Split.TEST and n_left_out:
        images, after = (), []  # the test is opened whole or not at all
    whole = [image for image, one in zip(images, after, strict=True) if one is not None]
    now = np.array([one for one in after if one is not None], bool)
    own = recognizer.model.fingerprint
    known = [_recognized(recognizer, asked, store, own, image) for image in whole]
    before = None if not whole or None in known else np.array(known, bool)
    check = SideCheck(
        split=split,
        n_images=len(whole),
        n_left_out=n_left_out,
        n_recognized=int(now.sum()),
        interval=clopper_pearson(int(now.sum()), len(whole)),
        before=None if before is None else int(before.sum()),
        lost=() if before is None else _names(whole, before & ~now),
        gained=() if before is None else _names(whole, now & ~before),
    )
    return _Side(check, now, before)


def _recognized(
    recognizer: Recognizer,
    asked: Project,
    store: AnswerStore,
    fingerprint: str,
    image: LabelledImage,
) -> bool | None:
    """Whether the vote of the stored answers gives the label; None if one is missing."""
    texts = [question.text for question in recognizer.questions]
    answers: dict[tuple[int, str], Answer] = {}
    for key in copy_keys(image.pixel_hash, asked.augmentation, asked.seed):
        said = store.answers(fingerprint, key, texts)
        if len(said) < len(texts):
            return None
        answers |= {(key.number, text): answer for text, answer in said.items()}
    state = recognizer.verdict(recognizer.votes(answers)).state
    return state is (State.POSITIVE if image.label == 1 else State.NEGATIVE)


def _names(images: Sequence[LabelledImage], chosen: NDArray[np.bool_]) -> tuple[str, ...]:
    return tuple(image.id for image, one in zip(images, chosen, strict=True) if one)


def _difference(test: _Side) -> str:
    if test.before is None or not test.check.n_images:
        return ""
    names = ("the other model", "its own model")
    both = {names[0]: test.now, names[1]: test.before}
    return compare(both, [names])[0].sentence()
