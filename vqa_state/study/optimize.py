"""From a full answer table to recognizers: search, keep, evaluate, write.

The app and the command line walk this one road, so the same project, seed and model give the same
recognizer in both, byte for byte.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from vqa_state.answers.rates import Counts, count
from vqa_state.answers.table import AnswerTable
from vqa_state.errors import NothingToSearchError, ProjectError, require_package
from vqa_state.evaluation.held_out import evaluate
from vqa_state.project.project import Project
from vqa_state.project.searches import (
    Results,
    SavedSearch,
    read_search,
    search_path,
    table_digest,
)
from vqa_state.recognizer.recognizer import IncompleteRecord, ProofRecord
from vqa_state.search.engines import Engine
from vqa_state.search.genetic import SearchReport
from vqa_state.search.objectives import Objective
from vqa_state.search.proof import ProofReport, prove_all
from vqa_state.storage.atomic_write import write_atomically
from vqa_state.storage.locks import locked
from vqa_state.study.answer_tables import SideTables, read_tables
from vqa_state.study.build_recognizer import paper_recognizer

__all__ = [
    "OptimizeProgress",
    "is_optimized",
    "nothing_found",
    "optimize",
    "recognizer_path",
    "refresh",
    "results",
]


@dataclass(frozen=True, slots=True)
class OptimizeProgress:
    """All four searches after the same generation, and later their proofs.

    Attributes:
        reports: of the searches; during the proofs, the last ones.
        proofs: of the objectives whose proof has something to tell; empty while searching.
        seconds: since the searches began.
    """

    reports: Mapping[Objective, SearchReport]
    proofs: Mapping[Objective, ProofReport] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def generation(self) -> int:
        """Generation that every search has reached."""
        return next(iter(self.reports.values())).generation

    @property
    def total(self) -> int:
        """Generations asked for; the engine `default` counts its climbs as more of them."""
        return next(iter(self.reports.values())).total

    @property
    def searched(self) -> bool:
        """Whether the searches came to their end."""
        return self.generation == self.total

    @property
    def proving(self) -> bool:
        """Whether this tells of proofs."""
        return bool(self.proofs)

    @property
    def seconds_left(self) -> float | None:
        """Of the searches, by their pace so far; None before it is known, and while proving."""
        if self.proving or not self.generation:
            return None
        return self.seconds / self.generation * (self.total - self.generation)

    @property
    def stopped(self) -> bool:
        """Whether searches or proofs were ended by the user, as far as is known by now."""
        return not self.searched or any(proof.stopped for proof in self.proofs.values())


def optimize(
    project: Project,
    stop: Callable[[], bool] = lambda: False,
    *,
    prove: bool = True,
    incomplete: bool = False,
) -> Iterator[OptimizeProgress]:
    """Search for all four objectives side by side; keep what they found and write recognizers.

    Only training images are looked at. The engine `default` then proves how good the subsets are at
    most, and may better them. A stop keeps the best so far and records that it was one.

    Args:
        project: its engine, settings, weights and seed are used.
        stop: asked after every report, and several times a second during the proofs.
        prove: False leaves the proofs out.
        incomplete: True searches on the complete training images where others lack answers. Search
            and recognizers say so, and the test stays closed.

    Yields:
        One report a generation, then news of the proofs. The searches and recognizers are on disk
        after the last.

    Raises:
        MissingAnswersError: if training images lack answers and `incomplete` is False, or if the
            complete ones do not show both states.
        NothingToSearchError: if there is no training image of one of the states.
        MissingExtraError: if the packages of the extra `search` are not installed.
        ProjectError: if there is no question, or the files cannot be written.
    """
    if prove and project.engine is Engine.DEFAULT:  # the solver is needed last, after minutes
        require_package("ortools", "optimizing with the engine 'default'")
    tables = read_tables(project)
    tables.require_training(incomplete=incomplete)
    counts = count(tables.seen)
    curves: dict[Objective, list[tuple[float, float]]] = {objective: [] for objective in Objective}
    searches = _searches(project, counts)
    progress = None
    began = time.monotonic()
    for reports in zip(*searches.values(), strict=True):
        progress = OptimizeProgress(
            dict(zip(searches, reports, strict=True)), seconds=time.monotonic() - began
        )
        for objective, report in progress.reports.items():
            curves[objective].append((report.best_fitness, report.mean_fitness))
        yield progress
        if stop():
            break
    assert progress is not None  # noqa: S101  # a search reports at least generation 0
    if not all(report.subset for report in progress.reports.values()):
        raise NothingToSearchError(
            "a search was too small to find even one question; raise its population or generations"
        )
    if prove and progress.searched and project.engine.kind.is_proved:
        found = {objective: report.subset for objective, report in progress.reports.items()}
        for proofs in prove_all(counts, found, weights=project.weights, stop=stop):
            progress = OptimizeProgress(progress.reports, proofs)
            yield progress
    _keep(project, tables, progress, curves)


def _searches(project: Project, counts: Counts) -> dict[Objective, Iterator[SearchReport]]:
    return {
        objective: project.engine.kind.search(
            counts,
            objective,
            weights=project.weights,
            settings=project.search,
            seed=project.search_seed,
        )
        for objective in Objective
    }


def results(project: Project) -> Results | None:
    """The last searches, evaluated; None if there are none or answers or labels changed since.

    The test is opened only where every answer on both sides is there.

    Raises:
        NothingToSearchError: if no training image has all its answers.
        ProjectError: if there is no question.
    """
    searches = _kept_searches(project)
    if searches is None:
        return None
    tables = _present(project)
    if not _are_of(searches, tables):
        return None
    chosen = {objective: one.subset for objective, one in searches.items()}
    evaluation = evaluate(tables.train, tables.opened, chosen, seed=project.search_seed)
    side = tables.answers.test
    counted = replace(evaluation, n_left_out_test=side.n_images - side.n_complete)
    return Results(searches, counted, tables.seen, tables.opened, tables.answers)


def nothing_found(project: Project) -> NothingToSearchError:
    """What to raise where there are no `results`: it says what to do first.

    Raises:
        NothingToSearchError: if the model was never asked.
        ProjectError: if there is no question.
    """
    lacks = read_tables(project).answers.lacks
    first = f"{lacks}: run `python -m vqa_state ask` on it, and then" if lacks else "run"
    return NothingToSearchError(
        f"{project.folder} has no search for its present answers and labels; {first} "
        "`python -m vqa_state optimize` on it"
    )


def is_optimized(project: Project) -> bool:
    """Whether there are `results`, without evaluating them: quick enough after every label."""
    searches = _kept_searches(project)
    if searches is None:
        return False
    try:
        tables = _present(project)
    except (NothingToSearchError, ProjectError):
        return False
    return _are_of(searches, tables)


def _present(project: Project) -> SideTables:
    tables = read_tables(project)
    tables.require_training(incomplete=True)  # what was searched on them, somebody said yes to
    return tables


def _kept_searches(project: Project) -> dict[Objective, SavedSearch] | None:
    """All four, or None: killed between two of the files, some are of the run before."""
    saved = {objective: read_search(project, objective) for objective in Objective}
    searches = {objective: one for objective, one in saved.items() if one is not None}
    if len(searches) < len(Objective):
        return None
    runs = {(one.engine, one.weights, one.settings, one.seed) for one in searches.values()}
    return searches if len(runs) == 1 else None


def _are_of(searches: Mapping[Objective, SavedSearch], tables: SideTables) -> bool:
    part = _part(tables)
    return all(
        _fits(one, objective, tables.train) and one.incomplete == part
        for objective, one in searches.items()
    )


def _part(tables: SideTables) -> IncompleteRecord | None:
    """What a search sees, if that is only part of the training images."""
    train = tables.answers.train
    if train.whole:
        return None
    return IncompleteRecord(n_images=train.n_complete, n_labelled=train.n_images)


def _fits(saved: SavedSearch, objective: Objective, train: AnswerTable) -> bool:
    """Whether a search is of these answers, and could have come from this program."""
    return (
        saved.table == table_digest(train)
        and saved.objective is objective
        and len(set(saved.subset)) == len(saved.subset)
        and max(saved.subset) < train.n_questions
    )


def refresh(project: Project) -> Results | None:
    """`results`, and recognizer files that agree with them: none that is of other answers.

    Raises:
        NothingToSearchError: if no training image has all its answers.
        ProjectError: if there is no question, or a file cannot be written.
    """
    before, found = _kept_searches(project), results(project)
    wanted = {
        recognizer_path(project, objective): None
        if found is None
        else paper_recognizer(project, found, objective).to_bytes()
        for objective in Objective
    }
    differing = {path: data for path, data in wanted.items() if _content(path) != data}
    if differing:
        with locked(project.folder):
            if _kept_searches(project) == before:  # else another program writes those of its own
                _write(differing)
    return found


def _content(path: Path) -> bytes | None:
    return path.read_bytes() if path.exists() else None


def _write(contents: Mapping[Path, bytes | None]) -> None:
    """Write files, and remove those of None."""
    for path, data in contents.items():
        if data is None:
            path.unlink(missing_ok=True)
        else:
            write_atomically(path, data)


def recognizer_path(project: Project, objective: Objective) -> Path:
    """Where the recognizer of an objective is written."""
    return project.folder / "recognizers" / f"{objective.name.lower()}.json"


def _keep(
    project: Project,
    tables: SideTables,
    progress: OptimizeProgress,
    curves: Mapping[Objective, list[tuple[float, float]]],
) -> None:
    contents: dict[Path, bytes | None] = {}
    for objective, report in progress.reports.items():
        proof = progress.proofs.get(objective)
        saved = SavedSearch(
            objective=objective,
            table=table_digest(tables.train),
            engine=project.engine,
            weights=project.weights,
            settings=project.search,
            seed=project.search_seed,
            subset=report.subset if proof is None else proof.subset,
            curve=tuple(curves[objective]),
            finished=progress.searched and (proof is None or not proof.stopped),
            proof=None if proof is None else _proof_record(proof),
            incomplete=_part(tables),
        )
        contents[search_path(project, objective)] = saved.model_dump_json().encode()
    with locked(project.folder):  # all four of one run, whoever else optimizes
        _write(contents)
    refresh(project)


def _proof_record(proof: ProofReport) -> ProofRecord:
    return ProofRecord(
        badge=proof.badge,
        value=round(proof.terms.value, 6),
        bound=max(round(proof.bound, 6), round(proof.terms.value, 6)),
        n_bound=proof.n_bound,
        stopped=proof.stopped,
    )
