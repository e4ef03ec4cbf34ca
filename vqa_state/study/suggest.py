"""Which image to label next, which label to doubt, and which labels to suggest.

Only training images and images without a label are looked at, never test images. An image without a
label is asked the chosen recognizer's questions first, and its answers go into the same store.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from vqa_state.errors import NothingToSearchError, ProjectError
from vqa_state.evaluation.label_ranking import (
    DoubtfulLabel,
    OpenImage,
    Suggestion,
    closest_votes,
    doubtful_labels,
    suggestions,
)
from vqa_state.models import VQAModel
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.project.split import Split
from vqa_state.questions.grid import Question, QuestionGrid
from vqa_state.study.assess import Assessment
from vqa_state.study.collect import AskProgress, answer_table, ask
from vqa_state.votes.rules import Ballots, FittedVote, equal_vote

__all__ = ["Hints", "accept", "ask_unlabelled", "hints"]


@dataclass(frozen=True, slots=True)
class Hints:
    """What a person could label.

    Attributes:
        next: images without a label, the closest vote first.
        suggestions: labels for them, the surest first; a person accepts them. None for an image
            that looks like a test image: it would become a training image.
        doubtful: training images whose out-of-bag vote is strongly against their label.
        n_unasked: images without a label that lack answers; ask them first.
    """

    next: tuple[OpenImage, ...]
    suggestions: tuple[Suggestion, ...]
    doubtful: tuple[DoubtfulLabel, ...]
    n_unasked: int


def ask_unlabelled(
    project: Project,
    found: Results,
    assessed: Assessment | None,
    model: VQAModel,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[AskProgress]:
    """Ask the chosen recognizer's questions about images without a label; answers are stored.

    Raises:
        NothingToSearchError: if every image has a label.
        ProjectError: if the model is no longer the one that was asked, or another program asks
            about this project now.
    """
    if model.fingerprint != project.fingerprint:
        raise ProjectError(
            f"the model {model.name!r} is no longer the one that answered before, so its answers "
            "cannot join that vote; ask and optimize again"
        )
    shadow = _shadow(project, _questions(found, _vote(project, found, assessed)))
    if not shadow.images:
        raise NothingToSearchError("every image has a label already; add more images")
    yield from ask(shadow, model, stop)


def hints(project: Project, found: Results, assessed: Assessment | None) -> Hints:
    """What could be labelled next, by the recommended vote, or the paper's if nothing is assessed.

    Raises:
        StoreError: if the answers cannot be read.
    """
    vote = _vote(project, found, assessed)
    doubtful: tuple[DoubtfulLabel, ...] = ()
    if assessed is not None:
        ids = found.train.image_ids
        margins = np.array([assessed.margins[image_id] for image_id in ids])
        doubtful = doubtful_labels(ids, found.train.labels, margins)
    table = answer_table(_shadow(project, _questions(found, vote)), Split.TRAIN)
    whole = table.take(table.complete)
    if not whole.n_images:
        return Hints((), (), doubtful, table.n_images)
    own = np.asarray(_moved(vote).margins(Ballots.of_table(whole)))
    silent = (whole.verdicts == 0).all(axis=(1, 2))
    own = np.where(silent & (own == 0), np.nan, own)
    ids = whole.image_ids
    tested = _like_a_test_image(project)
    return Hints(
        next=closest_votes(ids, own),
        suggestions=tuple(one for one in suggestions(ids, own) if one.image_id not in tested),
        doubtful=doubtful,
        n_unasked=table.n_images - whole.n_images,
    )


def accept(project: Project, chosen: tuple[Suggestion, ...]) -> tuple[Suggestion, ...]:
    """Give images the labels that a person accepted; they become training images.

    A label that a vote suggested must not judge the vote, so none of them goes to the test side.
    Nor does it take the place of a label that somebody gave meanwhile.

    Returns:
        Those whose image still had no label.
    """
    images = project.images
    open_ones = tuple(
        one for one in chosen if one.image_id in images and images[one.image_id].label is None
    )
    for one in open_ones:
        project.set_labels([one.image_id], one.label, accepted=True)
    return open_ones


def _like_a_test_image(project: Project) -> set[str]:
    """Images of groups of look-alikes that hold a test image."""
    return {
        image_id
        for group in project.look_alikes()
        if any(project.images[one].split is Split.TEST for one in group)
        for image_id in group
    }


def _vote(project: Project, found: Results, assessed: Assessment | None) -> FittedVote:
    if assessed is not None:
        return assessed.votes[assessed.recommendation.kind]
    return equal_vote(found.searches[project.chosen].subset)


def _questions(found: Results, vote: FittedVote) -> tuple[Question, ...]:
    return tuple(found.train.questions[place] for place in vote.questions)


def _moved(vote: FittedVote) -> FittedVote:
    """The vote on a table of its own questions only."""
    return replace(vote, questions=tuple(range(vote.n_used)))


def _shadow(project: Project, questions: tuple[Question, ...]) -> Project:
    """The images without a label, as if they were training images; it is never saved."""
    plain = tuple(Question(one.text, one.yes_means) for one in questions)
    images = {
        one.id: replace(one, label=1, split=Split.TRAIN)
        for one in project.images.values()
        if one.label is None and one.split is not Split.UNUSED
    }
    return replace(project, images=images, grid=QuestionGrid(custom=plain))
