"""Trying the rival on a project: what it sees in each image, out of bag, and in what time.

The rival is trained and estimated on training images alone. It also looks at the test pictures, to
say what state they show; whether that is right, the report says.
"""

import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from vqa_state.answers.table import AnswerTable
from vqa_state.errors import ImageError, ModelError
from vqa_state.evaluation.estimates import Estimate
from vqa_state.evaluation.linear_probe import (
    ProbeResamples,
    fit_linear_probe,
    linear_probe_out_of_bag,
)
from vqa_state.images import read_picture
from vqa_state.images.augmentation import copies
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.search.background_task import BackgroundTask
from vqa_state.study.features import Featurizer, features_of

__all__ = ["RivalRecord", "RivalStage", "RivalStep", "try_rival"]

_STOPPED = "it was stopped"

_N_TIMED = 4  # pictures whose decision is timed; the first may warm up, so the quickest counts


class RivalStage(StrEnum):
    """What is being done, in order."""

    LOADING = "loading the rival's image network"
    LOOKING = "showing the images to the rival"
    BAGS = "training the rival on the same resamples"
    TIMING = "timing the rival's decisions"


class RivalRecord(BaseModel):
    """The trained rival, and what it is worth.

    Attributes:
        fingerprint: of the image network.
        strength: of the penalty.
        n_features: numbers that the network makes of a picture.
        milliseconds: a decision took on this machine, all copies included; None if no training
            picture could be timed. Measured, so the one thing here that differs when repeated.
        estimate: out of bag, on the resamples that the votes were estimated on.
        sides: the state that it sees in each image: +1, -1 or 0 for unknown.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    fingerprint: str
    strength: float
    n_features: int
    milliseconds: float | None
    estimate: Estimate
    sides: dict[str, Literal[-1, 0, 1]]


@dataclass(frozen=True, slots=True)
class RivalStep:
    """Where it stands.

    Attributes:
        stage: what it is doing.
        n_done: steps of this stage that are done, of `n_total`.
        rival: only in the last report; None if there is none, and then `none_because` says why.
        none_because: the reason, or "".
    """

    stage: RivalStage
    n_done: int
    n_total: int
    rival: RivalRecord | None = None
    none_because: str = ""


def try_rival(
    project: Project,
    train: AnswerTable,
    groups: NDArray[np.int64],
    bags: Sequence[NDArray[np.intp]],
    features: Callable[[], Featurizer],
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[RivalStep]:
    """Train, estimate and time the rival, reporting after every image and every bag.

    Args:
        project: its training and test pictures are looked at.
        train: the training images that the votes were fitted on.
        groups: number of each one's group of look-alikes, (n_images,).
        bags: positions of each resample's images among them.
        features: makes what the rival looks with.
        stop: asked after every report; a stopped trial leaves no rival.

    Yields:
        The last report holds the rival, or says why there is none.

    Raises:
        ProjectError: if a file cannot be written.
    """
    yield RivalStep(RivalStage.LOADING, 0, 1)
    try:  # in a thread, because importing torch takes longer than a stop may wait
        loaded = list(BackgroundTask[Featurizer](lambda put: put(features()), stop))
    except (ImportError, ModelError) as error:
        yield _none(RivalStage.LOADING, str(error))
        return
    if not loaded or stop():
        yield _none(RivalStage.LOADING, _STOPPED)
        return
    featurizer = loaded[0]
    rows: dict[str, NDArray[np.float32]] = {}
    failures: dict[str, str] = {}
    images = project.labelled(Split.TRAIN, Split.TEST)
    for looked in features_of(project, images, featurizer, stop):
        rows, failures = looked.features, looked.failures
        yield RivalStep(RivalStage.LOOKING, looked.n_done, looked.n_total)
    if stop() or not set(train.image_ids) <= set(rows):
        yield _none(RivalStage.LOOKING, next(iter(failures.values()), _STOPPED))
        return
    yield from _trained(project, train, groups, bags, featurizer, rows, stop)


def _trained(
    project: Project,
    train: AnswerTable,
    groups: NDArray[np.int64],
    bags: Sequence[NDArray[np.intp]],
    featurizer: Featurizer,
    rows: Mapping[str, NDArray[np.float32]],
    stop: Callable[[], bool],
) -> Iterator[RivalStep]:
    own = np.stack([rows[image_id] for image_id in train.image_ids])
    tried: ProbeResamples | None = None
    for tried in linear_probe_out_of_bag(own, train.labels, groups, bags):
        yield RivalStep(RivalStage.BAGS, tried.n_done, tried.n_total)
        if stop():
            break
    if tried is None or tried.n_done < tried.n_total:
        yield _none(RivalStage.BAGS, _STOPPED)
        return
    milliseconds = yield from _milliseconds(project, featurizer, stop)
    rival = fit_linear_probe(own, train.labels, groups)
    sides = rival.decide(np.stack(list(rows.values()))).tolist()
    record = RivalRecord(
        fingerprint=featurizer.fingerprint,
        strength=rival.strength,
        n_features=featurizer.n_features,
        milliseconds=milliseconds,
        estimate=tried.estimate,
        sides=dict(zip(rows, sides, strict=True)),
    )
    yield RivalStep(RivalStage.TIMING, _N_TIMED, _N_TIMED, record)


def _none(stage: RivalStage, reason: str) -> RivalStep:
    return RivalStep(stage, 1, 1, none_because=reason)


def _milliseconds(
    project: Project, featurizer: Featurizer, stop: Callable[[], bool]
) -> Generator[RivalStep, None, float | None]:
    """A decision about one image, as a user would wait for it; the classifier itself takes none.

    The network really looks, whatever features are kept. As for a VQA model's pace, making the
    copies is not counted.
    """
    taken = []
    for number, image in enumerate(project.labelled(Split.TRAIN)[:_N_TIMED], 1):
        try:
            pixels = read_picture(project.read(image)).pixels
        except ImageError:
            continue
        shown = list(copies(pixels, image.pixel_hash, project.augmentation, project.seed))
        began = time.perf_counter()
        list(featurizer(shown))
        taken.append(1000 * (time.perf_counter() - began))
        yield RivalStep(RivalStage.TIMING, number, _N_TIMED)
        if stop():
            break
    return min(taken, default=None)
