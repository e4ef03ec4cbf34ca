"""The one table in words: its cells, what is proved, where numbers promise more than they keep.

What the tables of the app show before a look at the test images must not tell of them: warnings and
badges are made of training images alone, only sentences tell of the test.
"""

import math
from collections.abc import Iterator, Sequence

import pandas as pd

from vqa_state.evaluation.estimates import Estimate, optimism_warning
from vqa_state.evaluation.intervals import Interval
from vqa_state.evaluation.paired_tests import Comparison
from vqa_state.project.searches import Results, SavedSearch
from vqa_state.search.objectives import Objective
from vqa_state.search.proof import Badge
from vqa_state.study.assess import Assessment
from vqa_state.study.leaderboard_rows import CAREFUL, RIVAL, Standing, Standings, out_of
from vqa_state.votes.selection import NEAR

__all__ = [
    "TABLE_NOTE",
    "TABLE_NOTES",
    "badge_sentences",
    "comparison_sentences",
    "standings_frame",
    "warning_sentences",
]

TABLE_NOTES = (
    "★: the recommended kind of vote. Its estimate out of bag has the choice between the kinds "
    "repeated inside, those of the other kinds have not.",
    "train: on the images that chose the questions, so it flatters and carries no interval.",
    "out of bag: on images that a repeated search did not see. Behind it stands an interval as "
    "wide as that of so many images; that of a single state has none, as it is less certain still.",
    "unknown, right at 90 %: of single out-of-bag votes, how many give no verdict, and how many "
    "verdicts are right when only the surest 90 % of the votes give one.",
    "s_all, s_is and s_does: no image chose their questions, so their training score is no "
    "flattery and stands out of bag as well.",
    "test: on images that chose nothing, with exact 95 % intervals.",
    "An unknown verdict counts as not recognized.",
)
"""What the words of the table mean, one sentence or two a word."""

TABLE_NOTE = " ".join(TABLE_NOTES)
"""What to read below the table, wherever it is shown."""

_INSTEAD = (
    "A trained classifier serves you better than questions do; this program does not export one."
)


def badge_sentences(found: Results) -> list[str]:
    """For each objective, what is proved, and what the paper's one search found."""
    return [_badge(objective, saved) for objective, saved in found.searches.items()]


def standings_frame(table: Standings) -> pd.DataFrame:
    """The table as a person reads it."""
    return pd.DataFrame([_words(row) for row in table.rows])


def comparison_sentences(
    rows: Sequence[Standing], comparisons: Sequence[Comparison], *, has_test: bool
) -> list[str]:
    """What the test images show: about the first row compared, against others, and the rival."""
    if not has_test:
        return ["There are no test images, so only out of bag says how good it is on new ones."]
    sentences = [_shows(row) for row in rows if comparisons and row.name == comparisons[0].first]
    sentences += [one.sentence() for one in comparisons]
    for one in comparisons:
        if one.second == RIVAL and one.test.difference < 0:
            luck = "" if one.significant else ", though that may be luck"
            instead = f" {_INSTEAD}" if one.significant else ""
            sentences.append(f"So the {RIVAL} wins on the test images{luck}.{instead}")
    return sentences


def _shows(row: Standing) -> str:
    """What a test score proves, and how little."""
    if row.test is None:
        return f"{row.name} was not tried on the test images."
    n_recognized, n_images = row.test.whole
    return (
        f"{row.name} recognizes {n_recognized} of {n_images} test images; that only shows that it "
        f"recognizes {row.test.interval.low:.0%} to {row.test.interval.high:.0%} of new images "
        "like these (exact 95 % interval)."
    )


def warning_sentences(
    rows: Sequence[Standing], assessed: Assessment | None, *, has_test: bool
) -> Iterator[str]:
    """Where numbers promise more than they keep, by the training images alone.

    Args:
        rows: of the table.
        assessed: of the chosen objective, or None.
        has_test: whether there are test images; without any, the rival lacks none.
    """
    if assessed is None:
        yield "Not assessed yet: nothing but the test images says how good this is on new images."
        return
    recommended = next((row for row in rows if row.recommended), None)
    if recommended is not None and recommended.estimate is not None:
        n_recognized, n_images = recommended.train.whole
        said = optimism_warning(n_recognized / n_images, recommended.estimate, n_images)
        yield from [said] if said is not None else []
    yield from _of_the_rival(rows, assessed, has_test=has_test)
    if assessed.groups_divided:
        yield "All images of one state look alike, so the out-of-bag estimates flatter."
    if not assessed.finished:
        yield f"The assessment was stopped after {assessed.n_resamples} resamples."


def _of_the_rival(
    rows: Sequence[Standing], assessed: Assessment, *, has_test: bool
) -> Iterator[str]:
    if assessed.rival is None:
        yield f"There is no trained rival: {assessed.no_rival}."
        return
    row = next((row for row in rows if row.name == RIVAL), None)
    if row is None:
        yield "The rival has not seen all training images; assess again."
        return
    said = _rival_out_of_bag(
        assessed.recommended_estimate,
        assessed.rival.estimate,
        row.train.whole[1],
    )
    yield from [said] if said else []
    if has_test and row.test is None:
        yield "The rival has not seen all test images; assess again to judge it on them."


def _rival_out_of_bag(vote: Estimate, rival: Estimate, n_images: int) -> str:
    """Whether the rival wins out of bag, or comes as far; "" if the vote does, or is unknown."""
    ahead = rival.share - vote.share
    if math.isnan(ahead) or ahead < -NEAR:
        return ""
    figures = (
        f"it recognizes {rival.share * n_images:.1f} of {n_images} training images, the "
        f"recommended vote {vote.share * n_images:.1f}"
    )
    if ahead <= NEAR:
        return f"Out of bag, the {RIVAL} does as well without questions: {figures}."
    if rival.low > vote.high:
        return f"Out of bag, the {RIVAL} wins: {figures}. {_INSTEAD}"
    return (
        f"Out of bag, the {RIVAL} wins: {figures}; the 95 % intervals overlap, so that may be luck."
    )


def _badge(objective: Objective, saved: SavedSearch) -> str:
    if saved.proof is None:
        found = f"{saved.engine.value} search, nothing proved"
    else:
        gap = math.ceil(max(0.0, saved.proof.bound - saved.proof.value) * 100) / 100
        found = f"{saved.proof.badge.value} (E = {saved.proof.value:.3f}"
        found += "" if saved.proof.badge is Badge.BEST else f", at most {gap:.2f} below the bound"
        found += f"; no subset recognizes more than {saved.proof.n_bound} training images)"
    return f"{objective.value}: {found}."


def _words(row: Standing) -> dict[str, object]:
    n_images, test = row.train.whole[1], row.test
    return {
        "recognizer": f"{row.name} ★" if row.recommended else row.name,
        "questions": row.n_questions or "–",
        "calls": row.n_calls or "–",
        "calls, stopping early": "–" if row.early_calls is None else f"{row.early_calls:.0f}",
        "ms": "–" if row.milliseconds is None else f"{row.milliseconds:.0f}",
        "train": out_of(row.train.whole),
        **_estimated(row, n_images),
        **_careful(row),
        "test": "–" if test is None else _between(test.whole, test.interval),
        "test, positive": "–" if test is None else _between(test.positive, test.positive_interval),
        "test, negative": "–" if test is None else _between(test.negative, test.negative_interval),
    }


def _careful(row: Standing) -> dict[str, object]:
    """What single out-of-bag votes leave open, and how right the surest of them are."""
    first, careful = row.uncareful, row.careful
    names = "out of bag, unknown", f"out of bag, right at {CAREFUL:.0%}".replace("%", " %")
    if first is None or careful is None or not careful.n_covered:
        return dict.fromkeys(names, "–")
    low, high = careful.interval.low, careful.interval.high
    cells = f"{1 - first.coverage:.0%}", f"{careful.accuracy:.0%} ({low:.0%}–{high:.0%})"
    return dict(zip(names, cells, strict=True))


def _estimated(row: Standing, n_images: int) -> dict[str, object]:
    """Out of bag, of all training images and of those of each state; not known is not 0."""
    one = row.estimate
    if one is None or math.isnan(one.share):
        return dict.fromkeys(("out of bag", "out of bag, positive", "out of bag, negative"), "–")
    low, high = one.low * n_images, one.high * n_images
    between = "" if math.isnan(low) else f" ({low:.1f}–{high:.1f})"
    return {
        "out of bag": f"{_part(one.share, n_images)}{between}",
        "out of bag, positive": _part(one.positive, row.train.positive[1]),
        "out of bag, negative": _part(one.negative, row.train.negative[1]),
    }


def _between(pair: tuple[int, int], interval: Interval) -> str:
    """With the interval in images; a state without images has none."""
    if pair[1] == 0:
        return "–"
    return f"{out_of(pair)} ({interval.low * pair[1]:.1f}–{interval.high * pair[1]:.1f})"


def _part(share: float, n_images: int) -> str:
    return "–" if math.isnan(share) else f"{share * n_images:.1f} of {n_images}"
