"""One table for all that a user could take: kinds of vote, subsets, baselines, the rival.

Everything was chosen and trained on training images. The test columns are a look at the test
images; whoever shows them counts it.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from vqa_state.abstaining import AbstainRule
from vqa_state.answers import AnswerTable
from vqa_state.assessing import Assessment
from vqa_state.checking import Pace
from vqa_state.comparing import Comparison, compare
from vqa_state.early_stop import Schedule, calls_needed
from vqa_state.evaluation import Candidate, Interval, exact_interval
from vqa_state.pace import milliseconds
from vqa_state.scores import Objective
from vqa_state.search.proof import Badge
from vqa_state.tuning import Results, SavedSearch
from vqa_state.voting.estimates import Estimate, optimism_warning
from vqa_state.voting.kinds import Ballots, FittedVote, VoteKind

__all__ = [
    "RIVAL",
    "SideScore",
    "Standing",
    "Standings",
    "badge_sentences",
    "standings",
    "standings_frame",
]

RIVAL = "trained image classifier"

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class SideScore:
    """Recognized images of one side; every pair is (recognized, images).

    Attributes:
        whole: of all images; `positive` and `negative` of those of each state.
        interval: exact 95 % interval of the recognized share.
    """

    whole: tuple[int, int]
    positive: tuple[int, int]
    negative: tuple[int, int]
    interval: Interval


@dataclass(frozen=True, slots=True)
class Standing:
    """One row.

    Attributes:
        name: what it is.
        kind: how it counts; None for the rival.
        n_questions: it asks; 0 for the rival.
        n_calls: calls a decision; 0 for the rival, which calls no VQA model.
        early_calls: mean calls a training image if asking stops early; None for the rival.
        milliseconds: about what a decision takes; None if no pace was measured.
        train: on training images, which chose it: no interval can be honest there.
        estimate: out of bag, for the kinds of vote of the assessed subset; else None.
        test: on test images; None without them, or where the rival has not seen all of them.
        recommended: whether it is the recommended kind of vote.
    """

    name: str
    kind: VoteKind | None
    n_questions: int
    n_calls: int
    early_calls: float | None
    milliseconds: float | None
    train: SideScore
    estimate: Estimate | None
    test: SideScore | None
    recommended: bool


@dataclass(frozen=True, slots=True)
class Standings:
    """The whole table, and what it proves and does not prove.

    Attributes:
        rows: kinds of vote of the chosen objective first, then subsets, baselines, the rival.
        comparisons: on the same test images, corrected for how many they are; empty without any.
        sentences: the comparisons in words, or what is missing.
        recommendation: why one kind is recommended; "" without an assessment.
        warnings: where numbers promise more than they keep.
        badges: what is proved about each objective's subset, and what the paper's search found.
    """

    rows: tuple[Standing, ...]
    comparisons: tuple[Comparison, ...]
    sentences: tuple[str, ...]
    recommendation: str
    warnings: tuple[str, ...]
    badges: tuple[str, ...]


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
        pace: of the model on this machine, from `vqa_state.pace.read_pace`.
    """
    maker = _Maker(found, assessed, pace)
    entries = list(maker.entries(chosen))
    comparisons = _comparisons(entries, chosen)
    sentences = tuple(one.sentence() for one in comparisons)
    if found.test is None:
        sentences = ("There are no test images, so only out of bag says how good it is on new.",)
    return Standings(
        rows=tuple(entry.row for entry in entries),
        comparisons=comparisons,
        sentences=sentences,
        recommendation=_recommendation(assessed),
        warnings=tuple(_warnings(entries, assessed)),
        badges=tuple(badge_sentences(found)),
    )


def badge_sentences(found: Results) -> list[str]:
    """For each objective, what is proved, and what the paper's one search found."""
    return [_badge(objective, saved) for objective, saved in found.searches.items()]


def standings_frame(table: Standings) -> pd.DataFrame:
    """The table as a person reads it."""
    return pd.DataFrame([_words(row) for row in table.rows])


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
            {VoteKind.PAPER: _paper(subset)} if assessed is None else assessed.votes
        )
        for kind, vote in votes.items():
            estimate = None if assessed is None else assessed.estimates.get(kind)
            best = assessed is not None and assessed.recommendation.kind is kind
            yield self._voting(_name(chosen, kind), vote, estimate, recommended=best)
        for objective in searches:
            if objective is not chosen:
                vote = _paper(searches[objective].subset)
                yield self._voting(_name(objective, VoteKind.PAPER), vote)
        paper = searches[chosen].paper
        if paper is not None and paper.subset:
            yield self._voting(f"{chosen.value} of the paper's search", _paper(paper.subset))
        for row in self._found.evaluation.rows:
            if row.name.value not in set(Objective):
                yield self._voting(row.name.value, _paper(row.subset))
        yield from self._rival()

    def _voting(
        self,
        name: str,
        vote: FittedVote,
        estimate: Estimate | None = None,
        *,
        recommended: bool = False,
    ) -> _Entry:
        train = self._found.train
        on_test = self._decided(vote)
        row = Standing(
            name=name,
            kind=vote.kind,
            n_questions=vote.n_used,
            n_calls=vote.n_used * train.n_copies,
            early_calls=_early_calls(vote, train),
            milliseconds=milliseconds(self._pace, vote.n_used, train.n_copies),
            train=_side(vote.decide(self._train) == train.labels, train.labels),
            estimate=estimate,
            test=self._tested(on_test),
            recommended=recommended,
        )
        return _Entry(row, on_test)

    def _decided(self, vote: FittedVote) -> Mask | None:
        test = self._found.test
        if test is None or self._test is None:
            return None
        if vote.kind is VoteKind.WEIGHTED_P_YES and self._test.p_positive is None:
            return None
        right: Mask = vote.decide(self._test) == test.labels
        return right

    def _tested(self, right: Mask | None) -> SideScore | None:
        test = self._found.test
        return None if right is None or test is None else _side(right, test.labels)

    def _rival(self) -> Iterator[_Entry]:
        rival = None if self._assessed is None else self._assessed.rival
        if rival is None:
            return

        def right(table: AnswerTable | None) -> Mask | None:
            if table is None or not set(table.image_ids) <= set(rival.sides):
                return None
            sides = np.array([rival.sides[image_id] for image_id in table.image_ids])
            return np.asarray(sides == table.labels)

        on_train, on_test = right(self._found.train), right(self._found.test)
        if on_train is None:
            return
        row = Standing(
            name=RIVAL,
            kind=None,
            n_questions=0,
            n_calls=0,
            early_calls=None,
            milliseconds=None,
            train=_side(on_train, self._found.train.labels),
            estimate=None,
            test=self._tested(on_test),
            recommended=False,
        )
        yield _Entry(row, on_test)


def _paper(subset: tuple[int, ...]) -> FittedVote:
    chosen = tuple(sorted(subset))
    n_used = len(chosen)
    return FittedVote(VoteKind.PAPER, chosen, (1,) * n_used, (False,) * n_used, 0.5)


def _name(objective: Objective, kind: VoteKind) -> str:
    return objective.value if kind is VoteKind.PAPER else f"{objective.value}, {kind.value}"


def _early_calls(vote: FittedVote, train: AnswerTable) -> float:
    """Copy by copy, as `Recognizer.recognize(stop_early=True)` asks."""
    schedule = Schedule(vote.questions, train.n_copies)
    shares = train.p_positive if vote.kind is VoteKind.WEIGHTED_P_YES else None
    return float(calls_needed(AbstainRule(vote), schedule, train.verdicts, shares).mean())


def _side(right: Mask, labels: NDArray[np.int8]) -> SideScore:
    def pair(images: Mask) -> tuple[int, int]:
        return int(right[images].sum()), int(images.sum())

    whole = pair(np.ones(labels.shape, dtype=bool))
    return SideScore(whole, pair(labels > 0), pair(labels < 0), exact_interval(*whole))


def _comparisons(entries: list[_Entry], chosen: Objective) -> tuple[Comparison, ...]:
    """The recommended vote against what the user would take instead."""
    masks = {entry.row.name: entry.test for entry in entries if entry.test is not None}
    recommended = [entry.row.name for entry in entries if entry.row.recommended]
    first = next((name for name in recommended if name in masks), chosen.value)
    seconds = [chosen.value, Candidate.BEST_QUESTION.value, Candidate.S_ALL.value, RIVAL]
    pairs = [(first, second) for second in seconds if second in masks and second != first]
    return compare(masks, pairs) if first in masks else ()


def _recommendation(assessed: Assessment | None) -> str:
    if assessed is None:
        return ""
    one = assessed.recommendation
    return f"Recommended: the vote by {one.kind.value!r}, because {one.reason}."


def _warnings(entries: list[_Entry], assessed: Assessment | None) -> Iterator[str]:
    if assessed is None:
        yield "Not assessed yet: nothing but the test images says how good this is on new images."
        return
    for entry in entries:
        row = entry.row
        if row.estimate is not None and row.recommended:
            n_recognized, n_images = row.train.whole
            said = optimism_warning(n_recognized / n_images, row.estimate, n_images)
            if said is not None:
                yield said
    if assessed.groups_divided:
        yield "All images of one state look alike, so the out-of-bag estimates flatter."
    if not assessed.finished:
        yield f"The assessment was stopped after {assessed.n_resamples} resamples."
    if assessed.rival is None:
        yield f"There is no trained rival: {assessed.no_rival}."
    elif not any(entry.row.name == RIVAL and entry.row.test for entry in entries):
        yield "The rival has not seen all test images; assess again to judge it on them."


def _badge(objective: Objective, saved: SavedSearch) -> str:
    if saved.proof is None:
        found = f"{saved.engine.value} search, nothing proved"
    else:
        gap = math.ceil(max(0.0, saved.proof.bound - saved.proof.value) * 100) / 100
        found = f"{saved.proof.badge.value} (E = {saved.proof.value:.3f}"
        found += "" if saved.proof.badge is Badge.BEST else f", at most {gap:.2f} below the bound"
        found += f"; no subset recognizes more than {saved.proof.n_bound} training images)"
    if saved.paper is not None:
        found += f"; the paper's one search found E = {saved.paper.value:.3f}"
    return f"{objective.value}: {found}."


def _words(row: Standing) -> dict[str, object]:
    def share(pair: tuple[int, int]) -> str:
        return f"{pair[0]} of {pair[1]}"

    n_images = row.train.whole[1]
    one, test = row.estimate, row.test
    known = one is not None and not math.isnan(one.share)
    return {
        "recognizer": f"{row.name} ★" if row.recommended else row.name,
        "questions": row.n_questions or "–",
        "calls": row.n_calls or "–",
        "calls, stopping early": "–" if row.early_calls is None else f"{row.early_calls:.0f}",
        "ms": "–" if row.milliseconds is None else f"{row.milliseconds:.0f}",
        "train": share(row.train.whole),
        "out of bag": f"{one.share * n_images:.1f} of {n_images} "
        f"({one.low * n_images:.1f}–{one.high * n_images:.1f})"
        if one is not None and known
        else "–",
        "test": "–"
        if test is None
        else f"{share(test.whole)} ({test.interval.low * test.whole[1]:.1f}–"
        f"{test.interval.high * test.whole[1]:.1f})",
        "test, positive": "–" if test is None else share(test.positive),
        "test, negative": "–" if test is None else share(test.negative),
    }
