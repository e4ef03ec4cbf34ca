"""Which recognizer to take, and why, in sentences made of training images alone."""

import math
from collections.abc import Sequence

from vqa_state.evaluation.held_out import Baseline
from vqa_state.search.objectives import Objective
from vqa_state.study.assess import Assessment
from vqa_state.study.leaderboard_rows import Standing, out_of
from vqa_state.votes.selection import NEAR

__all__ = ["cheaper_objective_sentence", "everything_sentence", "recommendation_sentence"]


def recommendation_sentence(assessed: Assessment | None) -> str:
    """Which kind of vote to take, and why; "" without an assessment."""
    if assessed is None:
        return ""
    one, expected, n_images = (
        assessed.recommendation,
        assessed.recommended_estimate,
        len(assessed.margins),
    )
    said = f"Recommended: the vote by {one.kind.value!r}, because {one.reason}."
    if math.isnan(expected.share):
        return said
    return (
        f"{said} To be picked by such numbers flatters a vote; with the choice repeated on every "
        f"resample, it is {expected.share * n_images:.1f} of {n_images}."
    )


def everything_sentence(rows: Sequence[Standing], assessed: Assessment | None) -> str:
    """Whether asking all questions does as well as the recommended vote; "" if not, or unknown.

    Nothing was chosen for it, so its training score may stand beside an estimate out of bag.
    """
    everything = next((row for row in rows if row.name == Baseline.S_ALL.value), None)
    own = next((row for row in rows if row.recommended), None)
    if assessed is None or everything is None or everything.estimate is None or own is None:
        return ""
    n_images, kept = everything.train.whole[1], assessed.recommended_estimate.share
    ahead = everything.estimate.share - kept
    if math.isnan(ahead) or ahead < -NEAR:
        return ""
    said = (
        f"All {everything.n_questions} questions together, which no image chose, recognize "
        f"{out_of(everything.train.whole)} training images; the recommended vote keeps "
        f"{kept * n_images:.1f} out of bag"
    )
    saved = f" but saves calls ({own.n_calls} instead of {everything.n_calls})"
    saves = saved if own.n_calls < everything.n_calls else ""
    if ahead <= NEAR:
        return f"{said}. So the choice gains no accuracy here{saves}."
    return (
        f"{said}. So the choice loses accuracy here{saves}. All can be taken on Recognizer (or by "
        "`export --all-questions`); else label more images, or add questions that look at other "
        "things, such as the ready cues."
    )


def cheaper_objective_sentence(
    rows: Sequence[Standing], chosen: Objective, *, is_assessed: bool
) -> str:
    """Whether the set of another objective does as well on training images with fewer calls.

    Args:
        rows: of the table; the recommended one is compared, or the first if none is.
        chosen: the project's objective, whose rows come first.
        is_assessed: whether that objective is; others never are in the same table.

    Returns:
        One sentence about the cheapest, and how to assess it; "" if there is none.
    """
    own = next((row for row in rows if row.recommended), rows[0])
    others = [row for row in rows if row.name in set(Objective) - {chosen}]
    as_good = [row for row in others if row.train.whole[0] >= own.train.whole[0]]
    cheaper = [row for row in as_good if row.n_calls < own.n_calls]
    if not cheaper:
        return ""
    best = min(cheaper, key=lambda row: row.n_calls)
    more = best.train.whole[0] > own.train.whole[0]
    instead = f" instead of {own.train.whole[0]}" if more else ""
    return (
        f"{best.name} recognizes {'more' if more else 'as many'} training images "
        f"({out_of(best.train.whole)}{instead}) with {best.n_calls} calls instead of "
        f"{own.n_calls}; to estimate it out of bag, choose it (on Recognizer, or with `export "
        f"--objective {best.name}`) and assess{' again' if is_assessed else ' it'}."
    )
