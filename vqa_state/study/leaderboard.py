"""One table for all that a user could take: kinds of vote, subsets, baselines, the rival.

Everything was chosen and trained on training images. The test columns are a look at the test
images; whoever shows them counts it.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.table import AnswerTable
from vqa_state.evaluation.coverage import choose_point
from vqa_state.evaluation.estimates import Estimate
from vqa_state.evaluation.held_out import Baseline
from vqa_state.evaluation.intervals import clopper_pearson
from vqa_state.evaluation.paired_tests import Comparison, compare
from vqa_state.project.searches import Results
from vqa_state.search.objectives import Objective
from vqa_state.study.assess import Assessment
from vqa_state.study.latency import milliseconds
from vqa_state.study.leaderboard_rows import CAREFUL, RIVAL, Missed, SideScore, Standing, Standings
from vqa_state.study.leaderboard_words import (
    badge_sentences,
    comparison_sentences,
    standings_frame,
    warning_sentences,
)
from vqa_state.study.recommendation import (
    cheaper_objective_sentence,
    everything_sentence,
    recommendation_sentence,
)
from vqa_state.study.vision_check import Pace
from vqa_state.votes.early_stop import calls_needed
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import Ballots, FittedVote, VoteKind, equal_vote

__all__ = ["RIVAL", "Missed", "SideScore", "Standing", "Standings", "standings", "standings_frame"]

UNCHOSEN = frozenset({Baseline.S_ALL, Baseline.S_IS, Baseline.S_DOES})
"""Sets for which no image chose anything: what they recognize of any image is no flattery."""

Mask = NDArray[np.bool_]
Sides = NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """A row, and which images it recognizes."""

    row: Standing
    test: Mask | None


def standings(
    chosen: Objective, found: Results, assessed: Assessment | None, pace: Pace | None = None
) -> Standings:
    """Put everything into one table.

    Args:
        chosen: the project's chosen objective.
        found: its present results.
        assessed: of the chosen objective, or None: then only the paper's vote has rows.
        pace: of the model on this machine, from `vqa_state.study.latency.read_pace`.
    """
    maker = _Maker(found, assessed, pace)
    entries = list(maker.entries(chosen))
    rows = tuple(entry.row for entry in entries)
    comparisons = _comparisons(entries, chosen)
    is_assessed = assessed is not None
    advice = (
        recommendation_sentence(assessed),
        everything_sentence(rows, assessed),
        cheaper_objective_sentence(rows, chosen, is_assessed=is_assessed),
    )
    has_test = found.test is not None
    closed = not has_test and found.answers.test.n_images > 0  # then its limits say why
    said = () if closed else comparison_sentences(rows, comparisons, has_test=has_test)
    return Standings(
        rows=rows,
        comparisons=comparisons,
        sentences=tuple(said),
        recommendation="\n".join(one for one in advice if one),
        warnings=tuple(warning_sentences(rows, assessed, has_test=has_test)),
        badges=tuple(badge_sentences(found)),
    )


class _Maker:
    """Judges votes on both sides."""

    def __init__(self, found: Results, assessed: Assessment | None, pace: Pace | None) -> None:
        self._found, self._assessed, self._pace = found, assessed, pace
        self._train = Ballots.of_table(found.train)
        self._test = None if found.test is None else Ballots.of_table(found.test)

    def entries(self, chosen: Objective) -> Iterator[_Entry]:
        searches, assessed = self._found.searches, self._assessed
        subset = searches[chosen].subset
        votes: Mapping[VoteKind, FittedVote] = (
            {VoteKind.PAPER: equal_vote(subset)} if assessed is None else assessed.votes
        )
        for kind, vote in votes.items():
            entry = self._voting(_name(chosen, kind), vote)
            yield entry if assessed is None else _with_estimates(entry, assessed, kind)
        for objective in searches:
            if objective is not chosen:
                vote = equal_vote(searches[objective].subset)
                yield self._voting(_name(objective, VoteKind.PAPER), vote)
        for row in self._found.evaluation.rows:
            if isinstance(row.name, Baseline):
                entry = self._voting(row.name.value, equal_vote(row.subset))
                is_open = assessed is not None and row.name in UNCHOSEN
                yield _with_own_score(entry) if is_open else entry
        yield from self._rival()

    def _voting(self, name: str, vote: FittedVote) -> _Entry:
        train, test = self._found.train, self._found.test
        on_train, on_test = vote.decide(self._train), self._decided(vote)
        row = Standing(
            name=name,
            kind=vote.kind,
            n_questions=vote.n_used,
            n_calls=vote.n_used * train.n_copies,
            early_calls=_early_calls(vote, train),
            milliseconds=milliseconds(self._pace, vote.n_used, train.n_copies),
            train=_side(on_train == train.labels, train.labels),
            estimate=None,
            test=_score(test, on_test),
            recommended=False,
            asked=vote.questions,
            train_missed=_missed(train, on_train),
            test_missed=_missed(test, on_test),
        )
        return _Entry(row, _right(test, on_test))

    def _decided(self, vote: FittedVote) -> Sides | None:
        if self._test is None:
            return None
        if vote.kind.by_p_yes and self._test.p_positive is None:
            return None
        return vote.decide(self._test)

    def _rival(self) -> Iterator[_Entry]:
        rival = None if self._assessed is None else self._assessed.rival
        if rival is None:
            return

        def seen(table: AnswerTable | None) -> Sides | None:
            if table is None or not set(table.image_ids) <= set(rival.sides):
                return None
            return np.array([rival.sides[image_id] for image_id in table.image_ids], np.int8)

        train, test = self._found.train, self._found.test
        on_train, on_test = seen(train), seen(test)
        if on_train is None:
            return
        row = Standing(
            name=RIVAL,
            kind=None,
            n_questions=0,
            n_calls=0,
            early_calls=None,
            milliseconds=rival.milliseconds,
            train=_side(on_train == train.labels, train.labels),
            estimate=rival.estimate,
            test=_score(test, on_test),
            recommended=False,
            train_missed=_missed(train, on_train),
            test_missed=_missed(test, on_test),
        )
        yield _Entry(row, _right(test, on_test))


def _with_estimates(entry: _Entry, assessed: Assessment, kind: VoteKind) -> _Entry:
    """What was learned of a kind of vote without the test images."""
    curve = assessed.curves.get(kind)
    row = replace(
        entry.row,
        estimate=assessed.estimate_of(kind),
        recommended=assessed.recommendation.kind is kind,
        uncareful=curve[0] if curve else None,
        careful=choose_point(curve, CAREFUL) if curve else None,
    )
    return _Entry(row, entry.test)


def _with_own_score(entry: _Entry) -> _Entry:
    """Repeated without an image, no choice would be another: its training score is out of bag."""
    train, unknown = entry.row.train, math.nan
    whole, positive, negative = (
        n_right / n_images if n_images else unknown
        for n_right, n_images in (train.whole, train.positive, train.negative)
    )
    own = Estimate(whole, positive, negative, unknown, unknown, unknown)
    return _Entry(replace(entry.row, estimate=own), entry.test)


def _name(objective: Objective, kind: VoteKind) -> str:
    return objective.value if kind is VoteKind.PAPER else f"{objective.value}, {kind.value}"


def _early_calls(vote: FittedVote, train: AnswerTable) -> float:
    """Copy by copy, as `Recognizer.recognize(stop_early=True)` asks."""
    shares = train.p_positive if vote.kind.by_p_yes else None
    return float(calls_needed(AbstainRule(vote), train.verdicts, shares).mean())


def _right(table: AnswerTable | None, sides: Sides | None) -> Mask | None:
    """Which images are recognized; None where nothing was decided."""
    return None if table is None or sides is None else np.asarray(sides == table.labels)


def _score(table: AnswerTable | None, sides: Sides | None) -> SideScore | None:
    right = _right(table, sides)
    return None if table is None or right is None else _side(right, table.labels)


def _missed(table: AnswerTable | None, sides: Sides | None) -> tuple[Missed, ...]:
    if table is None or sides is None:
        return ()
    pairs = zip(table.image_ids, sides, sides == table.labels, strict=True)
    return tuple(Missed(image_id, int(side)) for image_id, side, right in pairs if not right)


def _side(right: Mask, labels: NDArray[np.int8]) -> SideScore:
    def pair(images: Mask) -> tuple[int, int]:
        return int(right[images].sum()), int(images.sum())

    pairs = pair(np.ones(labels.shape, dtype=bool)), pair(labels > 0), pair(labels < 0)
    return SideScore(*pairs, *(clopper_pearson(*one) for one in pairs))


def _comparisons(entries: list[_Entry], chosen: Objective) -> tuple[Comparison, ...]:
    """The recommended vote against what the user would take instead."""
    masks = {entry.row.name: entry.test for entry in entries if entry.test is not None}
    recommended = [entry.row.name for entry in entries if entry.row.recommended]
    first = next((name for name in recommended if name in masks), chosen.value)
    seconds = [chosen.value, Baseline.BEST_QUESTION.value, Baseline.S_ALL.value, RIVAL]
    pairs = [(first, second) for second in seconds if second in masks and second != first]
    return compare(masks, pairs) if first in masks else ()
