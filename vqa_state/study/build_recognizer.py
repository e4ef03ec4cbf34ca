"""Recognizers made of a project's results: of the chosen questions, or of all.

What they carry is decided here; `vqa_state.study.export` gives them another vote or lets them
abstain.
"""

from vqa_state.evaluation.held_out import Baseline, Candidate, Row
from vqa_state.evaluation.intervals import Interval
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.recognizer.recognizer import (
    Copies,
    ModelReference,
    Origin,
    Recognizer,
    ScoreRecord,
    Scores,
    States,
    WeightedQuestion,
)
from vqa_state.search.objectives import Objective

__all__ = ["paper_recognizer", "unchosen_recognizer"]


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
    return _recognizer(project, found, objective, origin)


def unchosen_recognizer(project: Project, found: Results) -> Recognizer:
    """All questions of the project, without a choice, by the paper's vote."""
    return _recognizer(project, found, Baseline.S_ALL, None)


def _recognizer(
    project: Project, found: Results, name: Candidate, origin: Origin | None
) -> Recognizer:
    row = next(row for row in found.evaluation.rows if row.name is name)
    questions = [found.train.questions[position] for position in row.subset]
    augmentation = project.augmentation
    return Recognizer(
        schema_version=3 if found.incomplete is None else 4,
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
        incomplete=found.incomplete,
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
