"""From a full answer table to recognizers: search, keep, evaluate, write.

The app and the command line walk this one road, so the same project, seed and model give the same
recognizer in both, byte for byte.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from vqa_state.answers.rates import Counts, count
from vqa_state.answers.table import AnswerTable
from vqa_state.errors import NothingToSearchError, ProjectError, require_package
from vqa_state.evaluation.held_out import Candidate, Interval, Row, evaluate
from vqa_state.project.project import Project
from vqa_state.project.searches import (
    PaperRun,
    Results,
    SavedSearch,
    read_search,
    search_path,
    table_digest,
)
from vqa_state.project.split import Split
from vqa_state.recognizer.recognizer import (
    Copies,
    ModelReference,
    Origin,
    ProofRecord,
    Recognizer,
    ScoreRecord,
    Scores,
    States,
    WeightedQuestion,
)
from vqa_state.search.default import Engine, search_with
from vqa_state.search.genetic import SearchReport
from vqa_state.search.objectives import Objective
from vqa_state.search.proof import ProofReport, prove_all
from vqa_state.storage.atomic_write import write_atomically
from vqa_state.study.collect import answer_table

__all__ = [
    "OptimizeProgress",
    "is_optimized",
    "optimize",
    "paper_recognizer",
    "recognizer_path",
    "refresh",
    "results",
    "unchosen_recognizer",
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
    project: Project, stop: Callable[[], bool] = lambda: False, *, prove: bool = True
) -> Iterator[OptimizeProgress]:
    """Search for all four objectives side by side; keep what they found and write recognizers.

    Only training images are looked at. The engine `default` then proves how good the subsets are at
    most, and may better them; it also runs the paper's search, to show both. A stop keeps the best
    so far and records that it was one.

    Args:
        project: its engine, settings, weights and seed are used.
        stop: asked after every report, and several times a second during the proofs.
        prove: False leaves the proofs out.

    Yields:
        One report a generation, then news of the proofs. The searches and recognizers are on disk
        after the last.

    Raises:
        NothingToSearchError: if no training image of one of the states has all its answers.
        MissingExtraError: if the packages of the extra `search` are not installed.
        ProjectError: if there is no question, or the files cannot be written.
    """
    if prove and project.engine is Engine.DEFAULT:  # the solver is needed last, after minutes
        require_package("ortools", "optimizing with the engine 'default'")
    train, _ = _tables(project)
    counts = count(_complete(train))
    curves: dict[Objective, list[tuple[float, float]]] = {objective: [] for objective in Objective}
    papers = _searches(project, counts, Engine.PAPER) if project.engine is Engine.DEFAULT else {}
    paper_reports: dict[Objective, SearchReport] = {}
    searches = _searches(project, counts, project.engine)
    progress = None
    began = time.monotonic()
    for reports in zip(*searches.values(), strict=True):
        progress = OptimizeProgress(
            dict(zip(searches, reports, strict=True)), seconds=time.monotonic() - began
        )
        for objective, report in progress.reports.items():
            curves[objective].append((report.best_fitness, report.mean_fitness))
        for objective, paper in papers.items():  # shorter than ours
            paper_reports[objective] = next(paper, None) or paper_reports[objective]
        yield progress
        if stop():
            break
    assert progress is not None  # noqa: S101  # a search reports at least generation 0
    if not all(report.subset for report in progress.reports.values()):
        raise NothingToSearchError(
            "a search was too small to find even one question; raise its population or generations"
        )
    if prove and progress.searched and project.engine is Engine.DEFAULT:
        found = {objective: report.subset for objective, report in progress.reports.items()}
        for proofs in prove_all(counts, found, weights=project.weights, stop=stop):
            progress = OptimizeProgress(progress.reports, proofs)
            yield progress
    _keep(project, train, progress, curves, paper_reports)


def _searches(
    project: Project, counts: Counts, engine: Engine
) -> dict[Objective, Iterator[SearchReport]]:
    return {
        objective: search_with(
            engine,
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

    Raises:
        NothingToSearchError: if no training image has all its answers.
        ProjectError: if there is no question.
    """
    searches = _kept_searches(project)
    if searches is None:
        return None
    train, test = _tables(project)
    if not _are_of(searches, train):
        return None
    chosen = {objective: one.subset for objective, one in searches.items()}
    evaluation = evaluate(train, test, chosen, seed=project.search_seed)
    return Results(searches, evaluation, _complete(train), test and _complete(test))


def is_optimized(project: Project) -> bool:
    """Whether there are `results`, without evaluating them: quick enough after every label."""
    searches = _kept_searches(project)
    if searches is None:
        return False
    try:
        train, _ = _tables(project)
    except (NothingToSearchError, ProjectError):
        return False
    return _are_of(searches, train)


def _kept_searches(project: Project) -> dict[Objective, SavedSearch] | None:
    """All four, or None: killed between two of the files, some are of the run before."""
    saved = {objective: read_search(project, objective) for objective in Objective}
    searches = {objective: one for objective, one in saved.items() if one is not None}
    if len(searches) < len(Objective):
        return None
    runs = {(one.engine, one.weights, one.settings, one.seed) for one in searches.values()}
    return searches if len(runs) == 1 else None


def _are_of(searches: Mapping[Objective, SavedSearch], train: AnswerTable) -> bool:
    return all(_fits(one, objective, train) for objective, one in searches.items())


def _fits(saved: SavedSearch, objective: Objective, train: AnswerTable) -> bool:
    """Whether a search is of these answers, and could have come from this program."""
    positions = set(saved.subset) | set(saved.paper.subset if saved.paper else ())
    return (
        saved.table == table_digest(train)
        and saved.objective is objective
        and len(set(saved.subset)) == len(saved.subset)
        and max(positions) < train.n_questions
    )


def refresh(project: Project) -> Results | None:
    """`results`, and recognizer files that agree with them: none that is of other answers.

    Raises:
        NothingToSearchError: if no training image has all its answers.
        ProjectError: if there is no question, or a file cannot be written.
    """
    found = results(project)
    for objective in Objective:
        path = recognizer_path(project, objective)
        if found is None:
            path.unlink(missing_ok=True)
            continue
        recognizer = paper_recognizer(project, found, objective)
        if not path.exists() or path.read_bytes() != recognizer.to_bytes():
            recognizer.save(path)
    return found


def recognizer_path(project: Project, objective: Objective) -> Path:
    """Where the recognizer of an objective is written."""
    return project.folder / "recognizers" / f"{objective.name.lower()}.json"


def _keep(
    project: Project,
    train: AnswerTable,
    progress: OptimizeProgress,
    curves: Mapping[Objective, list[tuple[float, float]]],
    papers: Mapping[Objective, SearchReport],
) -> None:
    for objective, report in progress.reports.items():
        proof, paper = progress.proofs.get(objective), _ended(papers.get(objective))
        saved = SavedSearch(
            objective=objective,
            table=table_digest(train),
            engine=project.engine,
            weights=project.weights,
            settings=project.search,
            seed=project.search_seed,
            subset=report.subset if proof is None else proof.subset,
            curve=tuple(curves[objective]),
            finished=progress.searched and (proof is None or not proof.stopped),
            proof=None if proof is None else _proof_record(proof),
            paper=None if paper is None else _paper_run(paper),
        )
        write_atomically(search_path(project, objective), saved.model_dump_json().encode())
    refresh(project)


def _ended(paper: SearchReport | None) -> SearchReport | None:
    """The paper's search only if it came to its end: half of it is no result of the paper's."""
    return paper if paper is not None and paper.generation == paper.total else None


def _proof_record(proof: ProofReport) -> ProofRecord:
    return ProofRecord(
        badge=proof.badge,
        value=round(proof.terms.value, 6),
        bound=max(round(proof.bound, 6), round(proof.terms.value, 6)),
        n_bound=proof.n_bound,
        stopped=proof.stopped,
    )


def _paper_run(report: SearchReport) -> PaperRun:
    return PaperRun(
        subset=report.subset, value=report.best_fitness, n_recognized=report.terms.n_recognized
    )


def paper_recognizer(project: Project, found: Results, objective: Objective) -> Recognizer:
    """With the paper's vote, as recognizers/OBJECTIVE.json has it."""
    saved = found.searches[objective]
    origin = Origin(
        engine=saved.engine,
        objective=objective,
        weights=saved.weights,
        settings=saved.settings,
        seed=saved.seed,
        generations=len(saved.curve) - 1,
        finished=saved.finished,
        proof=saved.proof,
    )
    return _recognizer(project, found, Candidate(objective.value), origin)


def unchosen_recognizer(project: Project, found: Results) -> Recognizer:
    """All questions of the project, without a choice, by the paper's vote."""
    return _recognizer(project, found, Candidate.S_ALL, None)


def _recognizer(
    project: Project, found: Results, name: Candidate, origin: Origin | None
) -> Recognizer:
    row = next(row for row in found.evaluation.rows if row.name is name)
    questions = [found.train.questions[position] for position in row.subset]
    augmentation = project.augmentation
    return Recognizer(
        name=project.name,
        states=States(positive=project.states.positive, negative=project.states.negative),
        model=ModelReference(name=project.model, fingerprint=project.fingerprint or ""),
        copies=Copies(
            kind=augmentation.kind,
            amount=augmentation.amount,
            n_copies=augmentation.n_copies,
            seed=project.seed,
        ),
        questions=tuple(
            WeightedQuestion(text=q.text, yes_means=1 if q.yes_means > 0 else -1) for q in questions
        ),
        origin=origin,
        scores=_scores(row),
        calls_per_image=augmentation.n_copies * len(questions),
    )


def _scores(row: Row) -> Scores:
    train = ScoreRecord(
        n_recognized=row.train.n_recognized,
        n_images=row.train.n_images,
        R_ave=round(row.train.R_ave, 6),
        R_invalid=round(row.train.R_invalid, 6),
    )
    if row.test is None or row.intervals is None:
        return Scores(train=train, test=None)
    test = ScoreRecord(
        n_recognized=row.test.n_recognized,
        n_images=row.test.n_images,
        R_ave=round(row.test.R_ave, 6),
        R_invalid=round(row.test.R_invalid, 6),
        R_img_interval=_rounded(row.intervals.R_img),
        R_ave_interval=_rounded(row.intervals.R_ave),
        R_invalid_interval=_rounded(row.intervals.R_invalid),
    )
    return Scores(train=train, test=test)


def _rounded(interval: Interval) -> tuple[float, float]:
    """Six digits: the last bits of a float may differ between two machines' arithmetic."""
    return round(interval.low, 6), round(interval.high, 6)


def _tables(project: Project) -> tuple[AnswerTable, AnswerTable | None]:
    """Stored answers about both sides; None for the test if no image of it has all its answers."""
    train, test = (answer_table(project, split) for split in (Split.TRAIN, Split.TEST))
    if not train.complete.any():
        raise NothingToSearchError(
            "no training image has all its answers yet; ask the model (again), then optimize"
        )
    return train, test if test.complete.any() else None


def _complete(table: AnswerTable) -> AnswerTable:
    return table.take(table.complete)
