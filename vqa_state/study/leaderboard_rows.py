"""Rows of the one table: what each recognizer costs, and how good it is on which images."""

from dataclasses import dataclass

from vqa_state.evaluation.coverage import CoveragePoint
from vqa_state.evaluation.estimates import Estimate
from vqa_state.evaluation.intervals import Interval
from vqa_state.evaluation.paired_tests import Comparison
from vqa_state.votes.rules import VoteKind

__all__ = ["CAREFUL", "RIVAL", "Missed", "SideScore", "Standing", "Standings", "out_of"]

RIVAL = "trained image classifier"

CAREFUL = 0.9
"""Coverage at which the table says how right the verdicts are."""


@dataclass(frozen=True, slots=True)
class SideScore:
    """Recognized images of one side; every pair is (recognized, images).

    Attributes:
        whole: of all images; `positive` and `negative` of those of each state.
        interval: exact 95 % interval of the recognized share; `positive_interval` and
            `negative_interval` of that of each state, NaN to NaN without images of it.
    """

    whole: tuple[int, int]
    positive: tuple[int, int]
    negative: tuple[int, int]
    interval: Interval
    positive_interval: Interval
    negative_interval: Interval


@dataclass(frozen=True, slots=True)
class Missed:
    """An image that a row does not recognize.

    Attributes:
        image_id: as in the answer table.
        verdict: +1 or -1, the state that it is taken for; 0 is unknown.
    """

    image_id: str
    verdict: int


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
        estimate: out of bag, for the kinds of vote of the assessed subset and for the rival; else
            None. That of the recommended kind has the choice between the kinds inside.
        test: on test images; None without them, or where the rival has not seen all of them.
        recommended: whether it is the recommended kind of vote.
        uncareful: what its single out-of-bag votes do if it abstains only where nothing leans;
            None without an assessment.
        careful: the same where `CAREFUL` of the votes shall give a verdict.
        asked: positions of its questions, ascending; empty for the rival.
        train_missed: training images that it does not recognize, in the table's order.
        test_missed: test images likewise. To show them is a look at the test images.
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
    uncareful: CoveragePoint | None = None
    careful: CoveragePoint | None = None
    asked: tuple[int, ...] = ()
    train_missed: tuple[Missed, ...] = ()
    test_missed: tuple[Missed, ...] = ()


@dataclass(frozen=True, slots=True)
class Standings:
    """The whole table, and what it proves and does not prove.

    Attributes:
        rows: kinds of vote of the chosen objective first, then subsets, baselines, the rival.
        comparisons: on the same test images, corrected for how many they are; empty without any.
        sentences: the comparisons in words, or what is missing.
        recommendation: why one kind is recommended, and which other objective's set does as well
            on training images with fewer calls; "" if there is neither.
        warnings: where numbers promise more than they keep.
        badges: what is proved about each objective's subset.
    """

    rows: tuple[Standing, ...]
    comparisons: tuple[Comparison, ...]
    sentences: tuple[str, ...]
    recommendation: str
    warnings: tuple[str, ...]
    badges: tuple[str, ...]


def out_of(pair: tuple[int, int]) -> str:
    """Recognized images out of all, in words: "17 of 20"."""
    return f"{pair[0]} of {pair[1]}"
