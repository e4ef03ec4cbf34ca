"""A recognizer with the kind of vote and the coverage that the user picked."""

import math

import numpy as np

from vqa_state.answers.table import AnswerTable
from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.coverage import CoveragePoint, choose_point
from vqa_state.evaluation.intervals import clopper_pearson
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.recognizer.recognizer import (
    Abstain,
    EstimateRecord,
    Recognizer,
    ScoreRecord,
    Scores,
    WeightedQuestion,
)
from vqa_state.recognizer.schema import CarefulRecord
from vqa_state.study.assess import Assessment, assessment
from vqa_state.study.build_recognizer import paper_recognizer, unchosen_recognizer
from vqa_state.study.optimize import results
from vqa_state.votes.rules import Ballots, FittedVote, VoteKind

__all__ = ["export", "recognizer_with"]


def export(project: Project) -> Recognizer:
    """The recognizer that the project chose: its objective, vote and coverage, or all questions.

        recognizer = export(project)
        recognizer.save("fridge.json")

    Args:
        project: optimized; `chosen`, `vote`, `coverage` and `all_questions` are its choice.

    Raises:
        NothingToSearchError: if nothing was searched for its present answers and labels, or the
            choice needs an assessment first.
    """
    found = results(project)
    if found is None:
        raise NothingToSearchError(
            f"{project.folder} has no search for its present answers and labels; optimize first"
        )
    if project.all_questions:
        return unchosen_recognizer(project, found)
    plain = project.vote is VoteKind.PAPER and project.coverage is None
    assessed = None if plain else assessment(project, found)
    return recognizer_with(project, found, assessed, project.vote, project.coverage)


def recognizer_with(
    project: Project,
    found: Results,
    assessed: Assessment | None,
    kind: VoteKind = VoteKind.PAPER,
    coverage: float | None = None,
) -> Recognizer:
    """The recognizer of the project's chosen objective with another vote or with abstaining.

    Its scores and its estimate are those of the vote before it abstains; how right the verdicts are
    that abstaining leaves stands with the coverage, counted over single out-of-bag votes.

    Args:
        project: its names, model and copies are written.
        found: its present results.
        assessed: of the same objective; None allows only the paper's vote without abstaining.
        kind: how it counts.
        coverage: share of images that shall get a verdict, in (0, 1]; None abstains only at ties.

    Raises:
        NothingToSearchError: if the choice needs an assessment, or answers without probabilities
            leave no such vote.
        ValueError: if the coverage is out of range.
    """
    paper = paper_recognizer(project, found, project.chosen)
    if assessed is None:
        if kind is VoteKind.PAPER and coverage is None:
            return paper
        raise NothingToSearchError(
            "other kinds of vote and abstaining are learned by an assessment of the present "
            f"answers; run `python -m vqa_state assess {project.folder}` first"
        )
    if kind not in assessed.votes:
        raise NothingToSearchError(
            f"the model gives no probabilities, so there is no vote by {kind.value!r}; choose one "
            f"of: {', '.join(assessed.votes)}"
        )
    vote = assessed.votes[kind]
    n_questions = len(vote.questions)
    changes = {
        "questions": _questions(vote, found.train),
        "vote": kind,
        "threshold": vote.threshold,
        "abstain": _abstain(assessed, kind, coverage),
        "scores": paper.scores if kind is VoteKind.PAPER else _scores(vote, found),
        "estimate": _estimate(assessed, kind),
        "calls_per_image": paper.copies.n_copies * n_questions,
    }
    return Recognizer(**(dict(paper) | changes))


def _questions(vote: FittedVote, train: AnswerTable) -> tuple[WeightedQuestion, ...]:
    return tuple(
        WeightedQuestion(
            text=train.questions[place].text,
            yes_means=1 if (train.questions[place].yes_means > 0) != flipped else -1,
            weight=weight,
        )
        for place, weight, flipped in zip(vote.questions, vote.weights, vote.flipped, strict=True)
    )


def _abstain(assessed: Assessment, kind: VoteKind, coverage: float | None) -> Abstain:
    if coverage is None:
        return Abstain()
    curve = assessed.curves.get(kind)
    if not curve:
        raise NothingToSearchError(
            "no training image was ever out of bag, so no coverage can be learned; label more"
        )
    point = choose_point(curve, coverage)
    return Abstain(min_sureness=point.min_sureness, coverage=coverage, out_of_bag=_careful(point))


def _careful(point: CoveragePoint) -> CarefulRecord | None:
    if not point.n_covered:
        return None
    return CarefulRecord(
        n_images=point.n_images,
        n_votes=point.n_votes,
        n_verdicts=point.n_covered,
        n_right=point.n_correct,
        low=round(point.interval.low, 6),
        high=round(point.interval.high, 6),
    )


def _scores(vote: FittedVote, found: Results) -> Scores:
    train, test = (
        None if table is None else _record(vote, table) for table in (found.train, found.test)
    )
    assert train is not None  # noqa: S101  # results always have training images
    if test is not None:
        interval = clopper_pearson(test.n_recognized, test.n_images)
        pair = round(interval.low, 6), round(interval.high, 6)
        test = test.model_copy(update={"R_img_interval": pair})
    return Scores(train=train, test=test)


def _record(vote: FittedVote, table: AnswerTable) -> ScoreRecord | None:
    if vote.kind.by_p_yes and np.isnan(table.p_positive).any():
        return None
    right = vote.decide(Ballots.of_table(table)) == table.labels
    return ScoreRecord(n_recognized=int(right.sum()), n_images=table.n_images)


def _estimate(assessed: Assessment, kind: VoteKind) -> EstimateRecord | None:
    one = assessed.estimate_of(kind)
    if math.isnan(one.share):
        return None
    return EstimateRecord(
        share=round(one.share, 6),
        low=round(one.low, 6),
        high=round(one.high, 6),
        n_images=len(assessed.margins),
        n_resamples=assessed.n_resamples,
    )
