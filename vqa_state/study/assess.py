"""What a recognizer is worth: its kinds of vote, an honest estimate, what it costs, its rival.

All of it is made of training images alone, and kept in assessments/OBJECTIVE.json until answers,
labels, look-alikes or the subset change. Only the rival also looks at the test pictures
(`vqa_state.study.linear_probe_run`).
"""

import hashlib
import json
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from vqa_state.answers.rates import Counts, count
from vqa_state.answers.table import AnswerTable
from vqa_state.evaluation.cost_frontier import FrontierPoint, search_frontier
from vqa_state.evaluation.coverage import CoveragePoint, coverage_curve, single_votes
from vqa_state.evaluation.estimates import Estimate
from vqa_state.evaluation.out_of_bag import (
    N_RESAMPLES,
    OutOfBag,
    OutOfBagProgress,
    SubsetSearch,
    out_of_bag,
)
from vqa_state.images.near_duplicates import look_alikes
from vqa_state.project.project import Project
from vqa_state.project.searches import Results, table_digest
from vqa_state.project.split import Split
from vqa_state.search.genetic import SearchSettings, search
from vqa_state.search.objectives import Objective
from vqa_state.storage.atomic_write import write_atomically
from vqa_state.study.features import Featurizer, embedded_features
from vqa_state.study.linear_probe_run import RivalRecord, RivalStage, RivalStep, try_rival
from vqa_state.study.optimize import nothing_found, results
from vqa_state.votes.fitting import fit_votes
from vqa_state.votes.rules import Ballots, FittedVote, VoteKind
from vqa_state.votes.selection import Recommendation

__all__ = ["AssessProgress", "Assessment", "RivalRecord", "Stage", "assess", "assessment"]

_QUICK = SearchSettings(population=100, generations=30)


class Stage(StrEnum):
    """What an assessment is doing, in order."""

    RESAMPLES = "repeating the search on resamples"
    FRONTIER = "looking what each further question buys"
    LOADING = RivalStage.LOADING
    RIVAL = RivalStage.LOOKING
    RIVAL_BAGS = RivalStage.BAGS
    RIVAL_TIME = RivalStage.TIMING


class Assessment(BaseModel):
    """Content of assessments/OBJECTIVE.json. Image ids are those of training images.

    Attributes:
        objective: whose subset it is about; `subset` are its questions.
        table: digest of all that it was made of.
        finished: False if a user stopped it; what came is kept.
        n_resamples: resamples that were made.
        votes: the vote of each kind, fitted on all training images.
        estimates: out of bag, of each kind by itself; `recommended_estimate` is that of taking what
            is recommended, the choice included. `estimate_of` says which of them to show.
        recommendation: which kind to take, and why.
        groups_divided: look-alikes had to be parted, so the estimates flatter.
        curves: accuracy against coverage of each kind, from single out-of-bag votes.
        margins: out-of-bag margin of each training image, NaN if it was never out.
        frontier: what each further question buys on training images.
        rival: None if there is none, and then `no_rival` says why.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[3] = 3
    objective: Objective
    table: str
    seed: int
    finished: bool
    subset: tuple[int, ...]
    n_resamples: int
    votes: dict[VoteKind, FittedVote]
    estimates: dict[VoteKind, Estimate]
    recommended_estimate: Estimate
    recommendation: Recommendation
    groups_divided: bool
    curves: dict[VoteKind, tuple[CoveragePoint, ...]]
    margins: dict[str, float]
    frontier: tuple[FrontierPoint, ...]
    rival: RivalRecord | None
    no_rival: str

    def estimate_of(self, kind: VoteKind) -> Estimate:
        """What to show for a kind of vote: of the recommended one, the estimate with the choice.

        The kind was picked because its own estimate is the highest, or near it: that one flatters.

        Raises:
            KeyError: if there is no such kind of vote.
        """
        own = self.estimates[kind]
        return self.recommended_estimate if kind is self.recommendation.kind else own


@dataclass(frozen=True, slots=True)
class AssessProgress:
    """Where an assessment stands.

    Attributes:
        stage: what it is doing.
        n_done: steps of this stage that are done, of `n_total`.
        assessment: only in the last report: what was found and kept; it may be unfinished.
    """

    stage: Stage
    n_done: int
    n_total: int
    assessment: Assessment | None = None


def assess(
    project: Project,
    stop: Callable[[], bool] = lambda: False,
    *,
    features: Callable[[], Featurizer] = embedded_features,
    n_resamples: int = N_RESAMPLES,
) -> Iterator[AssessProgress]:
    """Assess the subset of the project's chosen objective, and keep what was found.

    Args:
        project: with searches that fit its present answers and labels.
        stop: asked after every step; what came is kept, if a single resample was made.
        features: makes what the rival looks with; called only when it is its turn.
        n_resamples: of the out-of-bag estimate.

    Yields:
        One report a step. The last one holds the assessment; after a stop, that of what came.

    Raises:
        NothingToSearchError: if nothing was searched for the present answers, or a state has fewer
            than two training images.
        ProjectError: if a file cannot be written.
    """
    found = results(project)
    if found is None:
        raise nothing_found(project)
    making = _Making(project, found)
    bags: OutOfBagProgress | None = None
    for bags in making.bags(n_resamples):
        yield AssessProgress(Stage.RESAMPLES, bags.n_done, bags.n_total)
        if stop():
            break
    assert bags is not None  # noqa: S101  # there is at least one resample, or it was refused
    frontier = yield from _frontier(making, stop)
    rival, no_rival = yield from _rival(making, bags.result(), features, stop)
    done = making.assessment(bags, frontier, rival, no_rival, finished=not stop())
    write_atomically(_path(project, done.objective), _bytes(done))
    yield AssessProgress(Stage.RIVAL_TIME, 1, 1, done)


def _frontier(
    making: "_Making", stop: Callable[[], bool]
) -> Generator[AssessProgress, None, tuple[FrontierPoint, ...]]:
    found: tuple[FrontierPoint, ...] = ()
    if stop():
        return found
    for report in search_frontier(making.counts):
        found = report.points
        yield AssessProgress(Stage.FRONTIER, report.step, report.total)
        if stop():
            break
    return found


def _rival(
    making: "_Making", out: OutOfBag, features: Callable[[], Featurizer], stop: Callable[[], bool]
) -> Generator[AssessProgress, None, tuple[RivalRecord | None, str]]:
    """The rival, or None and why there is none."""
    if stop():
        return None, "it was stopped"
    last = None
    for last in making.rival(out, features, stop):
        if last.rival is None and not last.none_because:
            yield AssessProgress(Stage(last.stage), last.n_done, last.n_total)
    return (None, "") if last is None else (last.rival, last.none_because)


def assessment(project: Project, found: Results) -> Assessment | None:
    """What is kept about the chosen objective; None if there is nothing, or it is stale.

    Args:
        project: its folder, look-alikes and choice are used.
        found: its present results.
    """
    try:
        kept = Assessment.model_validate_json(_path(project, project.chosen).read_bytes())
    except (OSError, ValidationError, ValueError):
        return None
    making = _Making(project, found)
    fits = kept.table == making.digest and kept.subset == making.subset
    inside = all(max(v.questions) < found.train.n_questions for v in kept.votes.values())
    return kept if fits and inside and kept.objective is project.chosen else None


class _Making:
    """What an assessment is made of."""

    def __init__(self, project: Project, found: Results) -> None:
        self.project, self._train = project, found.train
        self._saved = found.searches[project.chosen]
        self.subset = self._saved.subset
        self._groups = _groups(project, found.train.image_ids)
        self._labels = found.train.labels
        self.digest = self._digest()

    @property
    def counts(self) -> Counts:
        return count(self._train)

    def _digest(self) -> str:
        digest = hashlib.sha256(table_digest(self._train).encode())
        digest.update(self._train.p_positive.tobytes())
        digest.update(self._groups.tobytes())
        digest.update(repr((self.subset, self._saved.weights, self.project.search_seed)).encode())
        return digest.hexdigest()

    def bags(self, n_resamples: int) -> Iterator[OutOfBagProgress]:
        return out_of_bag(
            Ballots.of_table(self._train),
            self._labels,
            self._groups,
            seed=self.project.search_seed,
            find=self._search(),
            n_resamples=n_resamples,
        )

    def _search(self) -> SubsetSearch:
        """A small search for the same objective: as good on new images, and quick."""
        objective, weights = self._saved.objective, self._saved.weights

        def find(counts: Counts, seed: int) -> tuple[int, ...]:
            *_, last = search(counts, objective, weights=weights, settings=_QUICK, seed=seed)
            return last.subset or tuple(range(counts.n_questions))

        return find

    def rival(
        self, out: OutOfBag, features: Callable[[], Featurizer], stop: Callable[[], bool]
    ) -> Iterator[RivalStep]:
        drawn = [resample.drawn for resample in out.resamples]
        return try_rival(self._shown_to_rival(), self._train, self._groups, drawn, features, stop)

    def _shown_to_rival(self) -> Project:
        """Without its test images, if the search saw only part of the training images."""
        if self._saved.incomplete is None:
            return self.project
        images = self.project.images.values()
        trained = {one.id: one for one in images if one.split is not Split.TEST}
        return replace(self.project, images=trained)

    def assessment(
        self,
        bags: OutOfBagProgress,
        frontier: tuple[FrontierPoint, ...],
        rival: RivalRecord | None,
        no_rival: str,
        *,
        finished: bool,
    ) -> Assessment:
        out = bags.result()
        ballots = Ballots.of_table(self._train)
        margins = out.recommended_margins.tolist()
        return Assessment(
            objective=self._saved.objective,
            table=self.digest,
            seed=self.project.search_seed,
            finished=finished,
            subset=self.subset,
            n_resamples=bags.n_done,
            votes=fit_votes(ballots, self._labels, self.subset, self._groups),
            estimates=dict(out.kinds),
            recommended_estimate=out.recommended,
            recommendation=out.recommendation,
            groups_divided=out.groups_divided,
            curves={k: _curve(out, k, self._train, self._groups) for k in out.kinds},
            margins=dict(zip(self._train.image_ids, margins, strict=True)),
            frontier=frontier,
            rival=rival,
            no_rival=no_rival,
        )


def _curve(
    out: OutOfBag, kind: VoteKind, train: AnswerTable, groups: NDArray[np.int64]
) -> tuple[CoveragePoint, ...]:
    """Empty if no image was ever out of bag."""
    sureness, states = single_votes(out, kind, train)
    if np.isnan(sureness).all():
        return ()
    return coverage_curve(sureness, states, train.labels, groups)


def _groups(project: Project, image_ids: tuple[str, ...]) -> NDArray[np.int64]:
    """Number of each training image's group of look-alikes, by the order of the images.

    Among the training images alone: two that are alike only through a test image, or through one
    without a label, are two. Else a test image would decide how training images are divided.
    """
    looks = {image_id: project.images[image_id].looks for image_id in image_ids}
    group_of: Mapping[str, str] = {
        image_id: min(group) for group in look_alikes(looks) for image_id in group
    }
    names = [group_of.get(image_id, image_id) for image_id in image_ids]
    number_of = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([number_of[name] for name in names], dtype=np.int64)


def _bytes(one: Assessment) -> bytes:
    return (json.dumps(one.model_dump(mode="json"), indent=1) + "\n").encode()


def _path(project: Project, objective: Objective) -> Path:
    return project.folder / "assessments" / f"{objective.name.lower()}.json"
