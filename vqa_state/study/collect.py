"""Which (image, copy, question) still lacks an answer; ask; store; report.

Store first, count after: a kill at any moment repeats at most the bite in flight. A failed call
is missing, is counted and shown, and is asked again the next time.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from filelock import FileLock, Timeout
from PIL import Image

from vqa_state.answers.answer import Answer
from vqa_state.answers.store import AnswerStore, CopyKey, copy_keys
from vqa_state.answers.table import MISSING, AnswerTable
from vqa_state.errors import ImageError, ModelError, NothingToSearchError, ProjectError
from vqa_state.images import pixel_hash, read_picture
from vqa_state.images.augmentation import Augmentation, AugmentationKind, MadeLate, copy_of
from vqa_state.models import Failure, Interruptible, Reply, VQAModel
from vqa_state.project.project import LabelledImage, Project
from vqa_state.project.split import Split
from vqa_state.questions.grid import Question

__all__ = ["AskPlan", "AskProgress", "answer_table", "ask", "plan"]

_BITE_SECONDS = 0.5
"""Answers are stored at least so often while a model gives them one by one."""


@dataclass(frozen=True, slots=True)
class AskPlan:
    """What asking will cost: one call is one question about one copy of one image.

    Files with the same pixels are one image here: they share their answers.
    """

    n_images: int
    n_copies: int
    n_questions: int
    n_stored: int
    n_cut_off: int = 0
    """Stored answers that the length limit ended before yes or no; they are not asked again."""

    @property
    def n_calls(self) -> int:
        """All calls of a full table, those already paid for included."""
        return self.n_images * self.n_copies * self.n_questions

    @property
    def n_to_ask(self) -> int:
        """Calls still to be paid for."""
        return self.n_calls - self.n_stored


@dataclass(frozen=True, slots=True)
class AskProgress:
    """The state of asking after one bite.

    Attributes:
        n_calls: calls of the full table.
        n_stored: answers that an earlier run had already bought.
        n_asked: answers bought and stored by this run.
        n_failed: calls of this run that gave no answer; they stay missing.
        n_cut_off: answers, stored ones included, that the length limit ended before yes or no.
        seconds: since this run began.
        last_failure: why the last failed call failed.
        stopped: the user stopped this run.
    """

    n_calls: int
    n_stored: int
    n_asked: int = 0
    n_failed: int = 0
    n_cut_off: int = 0
    seconds: float = 0.0
    last_failure: str | None = None
    stopped: bool = False

    @property
    def n_left(self) -> int:
        """Calls that this run has still to make."""
        return self.n_calls - self.n_stored - self.n_asked - self.n_failed

    @property
    def seconds_left(self) -> float | None:
        """By the pace of this run so far; None before its first reply."""
        done = self.n_asked + self.n_failed
        return self.seconds / done * self.n_left if done else None


def plan(project: Project, fingerprint: str) -> AskPlan:
    """Count what the store has and lacks.

    Raises:
        NothingToSearchError: if no image is labelled.
        ProjectError: if there is no question.
        StoreError: if the store cannot be read.
    """
    images, questions = _asked_about(project)
    with AnswerStore(project.store_path) as store:
        jobs, n_cut_off = _jobs(project, images, questions, store, fingerprint)
    n_missing = sum(len(job.questions) for job in jobs)
    n_copies = project.augmentation.n_copies
    n_calls = len(images) * n_copies * len(questions)
    return AskPlan(len(images), n_copies, len(questions), n_calls - n_missing, n_cut_off)


def ask(
    project: Project, model: VQAModel, stop: Callable[[], bool] = lambda: False
) -> Iterator[AskProgress]:
    """Buy every answer that the store lacks, image by image.

    A model that gives up on two images, one after another, is not asked on: the rest has failed,
    too, and is asked again the next time.

    Args:
        project: its labelled train and test images and its questions; read once, at the start.
        model: every answer is stored under its fingerprint.
        stop: asked before every image and after every reply; once True, what came is stored and
            the run ends.

    Yields:
        One report at the start, one after every stored bite.

    Raises:
        NothingToSearchError: if no image is labelled.
        ProjectError: if there is no question, or another program asks about this project now: two
            would pay for the same answers.
        StoreError: if an answer cannot be stored; nothing stored before is lost.
    """
    images, questions = _asked_about(project)
    began = time.monotonic()
    with _only_asker(project), AnswerStore(project.store_path) as store:
        fingerprint = model.fingerprint
        jobs, n_cut_off = _jobs(project, images, questions, store, fingerprint)
        n_calls = len(images) * project.augmentation.n_copies * len(questions)
        n_stored = n_calls - sum(len(job.questions) for job in jobs)
        progress = AskProgress(n_calls, n_stored, n_cut_off=n_cut_off)
        yield progress
        left, given_up = deque(_by_image(jobs)), ""
        while left:
            # A model gave up: on that image alone, or for good? One from the other end tells.
            image_jobs = left.pop() if given_up else left.popleft()
            before, given_up = given_up, ""
            for bite in _replies(project, model, image_jobs, stop):
                store.save(fingerprint, bite.answers)
                progress = bite.added_to(progress, time.monotonic() - began, stop())
                given_up = bite.given_up or given_up
                yield progress
            if stop():
                yield replace(progress, stopped=progress.n_left > 0)
                return
            if before and given_up and left:
                rest = _Bite([], [Failure(given_up, for_all=True)] * progress.n_left)
                yield rest.added_to(progress, time.monotonic() - began, False)
                return


@contextmanager
def _only_asker(project: Project) -> Iterator[None]:
    """The system frees the lock when its holder is killed."""
    # A job's thread may begin what another one ends, so the lock is not a thread's own.
    lock = FileLock(project.folder / ".asking.lock", thread_local=False)
    try:
        lock.acquire(timeout=0)
    except Timeout as error:
        raise ProjectError(
            f"the project {project.name!r} is being asked by another program or page; wait for it "
            "or stop it, then ask again"
        ) from error
    except OSError as error:
        raise ProjectError(
            f"cannot write into {project.folder} ({error.strerror}); check its permissions"
        ) from error
    try:
        yield
    finally:
        lock.release()


def answer_table(project: Project, split: Split) -> AnswerTable:
    """The stored answers of the project's model about the labelled images of one side.

    Answers that the store lacks are `MISSING`. No model is loaded.

    Raises:
        NothingToSearchError: if the model was never asked.
        ProjectError: if there is no question.
        StoreError: if the store cannot be read.
    """
    if project.fingerprint is None:
        raise NothingToSearchError(
            f"no question of the project {project.name!r} was asked yet; ask the model first"
        )
    images, questions = project.labelled(split), project.questions()
    shape = (len(images), project.augmentation.n_copies, len(questions))
    verdicts = np.full(shape, MISSING, np.int8)
    p_positive = np.full(shape, np.nan, np.float32)
    cut_off = np.zeros(shape, np.bool_)
    texts = [question.text for question in questions]
    with AnswerStore(project.store_path) as store:
        for i, image in enumerate(images):
            for key in copy_keys(image.pixel_hash, project.augmentation, project.seed):
                said = store.answers(project.fingerprint, key, texts)
                for q, question in enumerate(questions):
                    if question.text in said:
                        answer = said[question.text]
                        verdicts[i, key.number, q] = answer.verdict(question.yes_means)
                        p_positive[i, key.number, q] = _p_positive(answer, question)
                        cut_off[i, key.number, q] = answer.cut_off
    labels = np.array([image.label for image in images], np.int8)
    ids = tuple(image.id for image in images)
    return AnswerTable(ids, questions, verdicts, p_positive, labels, cut_off)


def _p_positive(answer: Answer, question: Question) -> float:
    if answer.p_yes is None:
        return float("nan")
    p_yes = round(answer.p_yes, 6)  # votes count millionths, the same from either side
    return p_yes if question.yes_means > 0 else 1.0 - p_yes


@dataclass(frozen=True, slots=True)
class _Job:
    """The questions that one copy of one image still lacks."""

    image: LabelledImage
    key: CopyKey
    questions: tuple[str, ...]


def _asked_about(project: Project) -> tuple[tuple[LabelledImage, ...], tuple[Question, ...]]:
    images = project.labelled(Split.TRAIN, Split.TEST)
    if not images:
        raise NothingToSearchError(
            f"the project {project.name!r} has no labelled image on the train or the test side; "
            "add images and give each a state"
        )
    distinct = {image.pixel_hash: image for image in reversed(images)}
    return tuple(reversed(distinct.values())), project.questions()


def _jobs(
    project: Project,
    images: Sequence[LabelledImage],
    questions: Sequence[Question],
    store: AnswerStore,
    fingerprint: str,
) -> tuple[list[_Job], int]:
    """What the store lacks, and how many of its answers were cut off."""
    jobs, n_cut_off = [], 0
    texts = [question.text for question in questions]
    for image in images:
        for key in copy_keys(image.pixel_hash, project.augmentation, project.seed):
            known = store.answers(fingerprint, key, texts)
            lacking = tuple(text for text in texts if text not in known)
            if lacking:
                jobs.append(_Job(image, key, lacking))
            n_cut_off += sum(answer.cut_off for answer in known.values())
    return jobs, n_cut_off


def _by_image(jobs: Iterable[_Job]) -> list[list[_Job]]:
    groups: dict[tuple[str, tuple[str, ...]], list[_Job]] = {}
    for job in jobs:  # copies of one image that lack the same questions share a call
        groups.setdefault((job.image.id, job.questions), []).append(job)
    return list(groups.values())


@dataclass(frozen=True, slots=True)
class _Bite:
    answers: list[tuple[CopyKey, str, Answer]]
    failures: list[Failure]

    @property
    def given_up(self) -> str:
        """Why the model will not answer on; "" if it may."""
        return next((failure.reason for failure in self.failures if failure.for_all), "")

    def added_to(self, progress: AskProgress, seconds: float, stopped: bool) -> AskProgress:
        after = replace(
            progress,
            n_asked=progress.n_asked + len(self.answers),
            n_failed=progress.n_failed + len(self.failures),
            n_cut_off=progress.n_cut_off + sum(answer.cut_off for *_, answer in self.answers),
            seconds=seconds,
            last_failure=self.failures[-1].reason if self.failures else progress.last_failure,
        )
        return replace(after, stopped=stopped and after.n_left > 0)


def _replies(
    project: Project, model: VQAModel, jobs: Sequence[_Job], stop: Callable[[], bool]
) -> Iterator[_Bite]:
    """All that the model says about the copies of one image, a bite at a time."""
    if stop():
        return
    questions = jobs[0].questions
    open_pairs = {(i, q) for i in range(len(jobs)) for q in range(len(questions))}
    reason = "the model gave no reply to this question"
    bite, since = _Bite([], []), time.monotonic()
    try:
        images = _copies(project, jobs)
        for reply in _asked(model, images, questions, stop):
            if (reply.image, reply.question) not in open_pairs:
                continue  # a model that repeats itself is not counted twice
            open_pairs.discard((reply.image, reply.question))
            _sort_in(reply, bite, jobs[reply.image].key, questions[reply.question])
            if stop() or time.monotonic() - since > _BITE_SECONDS:
                yield bite
                bite, since = _Bite([], []), time.monotonic()
            if stop():
                return
    except (ModelError, ImageError) as error:
        reason = str(error)
    if stop():
        open_pairs.clear()  # they were not asked, so they did not fail
    bite.failures.extend(Failure(reason) for _ in open_pairs)
    yield bite


def _asked(
    model: VQAModel,
    images: Sequence[Image.Image],
    questions: Sequence[str],
    stop: Callable[[], bool],
) -> Iterator[Reply]:
    if isinstance(model, Interruptible):
        return model.answer_until(images, questions, stop)
    return model.answer(images, questions)


def _sort_in(reply: Reply, bite: _Bite, key: CopyKey, question: str) -> None:
    if isinstance(reply.outcome, Failure):
        bite.failures.append(reply.outcome)
    else:
        bite.answers.append((key, question, reply.outcome))


def _copies(project: Project, jobs: Sequence[_Job]) -> MadeLate:
    """Made from the keys under which the answers go: the project may change meanwhile."""
    image = jobs[0].image
    pixels = read_picture(project.read(image)).pixels
    if pixel_hash(pixels) != image.pixel_hash:
        raise ImageError(
            f"{image.name} is decoded differently here than where it was added; add it again"
        )
    return MadeLate([partial(_copy, pixels, job.key) for job in jobs])


def _copy(pixels: Image.Image, key: CopyKey) -> Image.Image:
    kind = Augmentation(AugmentationKind(key.kind), key.amount)
    return copy_of(pixels, key.pixel_hash, kind, key.seed, key.number)
