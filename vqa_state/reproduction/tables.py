"""The paper's tables with ours beside them, the totals, and whether its three remarks hold here.

The pictures of various doors are those of the four door experiments: tables and counts hold it, as
the paper's do, but intervals and tests leave it out, for they take pictures to be independent.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import pandas as pd

from vqa_state.answers.rates import SubsetScore
from vqa_state.evaluation.held_out import Baseline, Row
from vqa_state.evaluation.intervals import CONFIDENCE, clopper_pearson
from vqa_state.evaluation.paired_tests import PairedTest, mcnemar
from vqa_state.project.searches import Results
from vqa_state.reproduction.paper import (
    BEST_QUESTION_OF_VARIOUS_DOORS,
    REPEATED,
    SUBSETS,
    paper_tables,
)

__all__ = [
    "Finding",
    "Remark",
    "experiment_frame",
    "identity_holds",
    "remarks",
    "shown",
    "total_frame",
]

#: Rates that are equal in exact arithmetic differ by less in floats.
_ROUNDING = 1e-9


class Finding(StrEnum):
    """What our experiments say to a claim of the paper's."""

    HOLDS = "holds here"
    DOES_NOT_HOLD = "does not hold here"
    LUCK = "cannot be told from luck here"
    NOT_ASKED = "cannot be told here"


@dataclass(frozen=True, slots=True)
class Remark:
    """Something that the paper saw in its model, and whether ours shares it."""

    claim: str
    finding: Finding
    numbers: str

    @property
    def sentence(self) -> str:
        """All of it in one sentence."""
        return f"{self.finding.capitalize()}: {self.claim} ({self.numbers})."


def experiment_frame(name: str, found: Results) -> pd.DataFrame:
    """One table: a row for each subset, every column for the paper and for us.

    "recognized" counts test images; `low` and `high` are our exact 95 % interval, as images.
    The best single question has a paper's figure for various doors only.
    """
    paper = paper_tables().query("experiment == @name").set_index("subset")
    rows = _rows(found)
    records = []
    for subset in (*SUBSETS, Baseline.BEST_QUESTION.value):
        row = rows[subset]
        test, intervals = _tested(row), row.intervals
        theirs = paper.loc[subset].to_dict() if subset in paper.index else {}
        if subset == Baseline.BEST_QUESTION.value and name == "various_doors":
            theirs = {"n_recognized": BEST_QUESTION_OF_VARIOUS_DOORS, "n_images": 80}
        records.append(
            {
                "experiment": name,
                "subset": subset,
                "paper_recognized": theirs.get("n_recognized"),
                "paper_images": theirs.get("n_images"),
                "recognized": test.n_recognized,
                "images": test.n_images,
                "low": round(intervals.R_img.low * test.n_images, 1) if intervals else None,
                "high": round(intervals.R_img.high * test.n_images, 1) if intervals else None,
                "paper_R_ave": theirs.get("R_ave"),
                "R_ave": round(test.R_ave, 3),
                "paper_R_invalid": theirs.get("R_invalid"),
                "R_invalid": round(test.R_invalid, 3),
                "paper_used": theirs.get("n_used"),
                "used": row.train.n_used,
                "questions": len(rows[Baseline.S_ALL.value].subset),
            }
        )
    return pd.DataFrame(records)


def total_frame(found: Mapping[str, Results]) -> pd.DataFrame:
    """Recognized test images of all experiments together.

    The pictures of various doors are those of the four door experiments. They count twice in
    `recognized` and `images`, as in the paper's total, and once in all that follows: `distinct` of
    `distinct_images` are recognized, `low` to `high` is the exact 95 % interval of `distinct`, and
    the last columns compare s+ with each other row on these images.
    """
    frame = pd.concat([experiment_frame(name, one) for name, one in found.items()])
    once = _each_picture_once(found)
    records = []
    for subset in ("s+", "s-", "s_all", Baseline.BEST_QUESTION.value):
        own = frame[frame["subset"] == subset]
        distinct = own[own["experiment"] != REPEATED]
        n_recognized, n_images = int(distinct["recognized"].sum()), int(distinct["images"].sum())
        exact = clopper_pearson(n_recognized, n_images)
        known = own["paper_recognized"].notna().all()
        only_first, only_second, p_value = _compared(once, subset)
        records.append(
            {
                "subset": subset,
                "paper_recognized": int(own["paper_recognized"].sum()) if known else None,
                "paper_images": int(own["paper_images"].sum()) if known else None,
                "recognized": int(own["recognized"].sum()),
                "images": int(own["images"].sum()),
                "distinct": n_recognized,
                "distinct_images": n_images,
                "low": round(exact.low * n_images, 1),
                "high": round(exact.high * n_images, 1),
                "only_s_plus": only_first,
                "only_this": only_second,
                "p_value": p_value,
            }
        )
    return pd.DataFrame(records)


def shown(frame: pd.DataFrame) -> pd.DataFrame:
    """The same table in texts, as a person reads it: "–" where there is no number."""
    return frame.astype(object).map(_shown)


def _shown(value: object) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return "–"
    if isinstance(value, float):
        return f"{value:.0f}" if value == int(value) else f"{value:.3g}"
    return str(value)


def _each_picture_once(found: Mapping[str, Results]) -> dict[str, Results]:
    """The experiments that share no picture, which statistics may take for independent."""
    return {name: one for name, one in found.items() if name != REPEATED}


def remarks(found: Mapping[str, Results]) -> list[Remark]:
    """The three properties that the paper saw in its model. Source: paper IV."""
    return [_more_invalid(found), _more_accurate(found), _one_wording(found)]


def identity_holds(found: Results) -> bool:
    """Whether R_invalid(all) is the mean of R_invalid(is) and R_invalid(does), as it must be."""
    rows = _rows(found)
    values = [_tested(rows[name]).R_invalid for name in ("s_all", "s_is", "s_does")]
    return abs(values[0] - (values[1] + values[2]) / 2) < _ROUNDING


def _more_invalid(found: Mapping[str, Results]) -> Remark:
    pairs = _both_forms(found, lambda score: score.R_invalid)
    return _forms_remark("`is` questions get more Invalid answers than `does`", "R_invalid", pairs)


def _more_accurate(found: Mapping[str, Results]) -> Remark:
    pairs = _both_forms(found, lambda score: score.R_ave)
    return _forms_remark("`is` questions are more accurate than `does`", "R_ave", pairs)


def _both_forms(
    found: Mapping[str, Results], value: Callable[[SubsetScore], float]
) -> list[tuple[float, float]]:
    """A test score of s_is and of s_does, for every experiment with pictures of its own."""
    rows = [_rows(one) for one in _each_picture_once(found).values()]
    return [(value(_tested(row["s_is"])), value(_tested(row["s_does"]))) for row in rows]


def _forms_remark(claim: str, what: str, pairs: Sequence[tuple[float, float]]) -> Remark:
    """An exact two-sided sign test over the experiments says whether `is` is higher, or lower."""
    n = len(pairs)
    if not n:
        return Remark(claim, Finding.NOT_ASKED, "no experiment has pictures of its own")
    of_is, of_does = (sum(values) / n for values in zip(*pairs, strict=True))
    more = sum(first > second + _ROUNDING for first, second in pairs)
    less = sum(second > first + _ROUNDING for first, second in pairs)
    p_value = PairedTest(n, more, less).p_value
    numbers = (
        f"p = {p_value:.3f}, two-sided sign test; higher for `is` in {more} of {n} experiments, "
        f"lower in {less}, equal in {n - more - less}; mean {what} {of_is:.3f} against "
        f"{of_does:.3f}; without {REPEATED}, whose pictures are those of others"
    )
    return Remark(claim, _finding(more, less, p_value), numbers)


def _finding(more: int, less: int, p_value: float) -> Finding:
    if p_value >= 1 - CONFIDENCE:
        return Finding.LUCK
    return Finding.HOLDS if more > less else Finding.DOES_NOT_HOLD


def _one_wording(found: Mapping[str, Results]) -> Remark:
    n_wordings = {}
    for name, one in found.items():
        questions = one.train.questions
        if len({question.wording for question in questions}) > 1:
            chosen = _rows(one)["s+"].subset
            n_wordings[name] = len({questions[number].wording for number in chosen})
    claim = "the optimized questions of one experiment all use the same wording"
    if not n_wordings:
        return Remark(claim, Finding.NOT_ASKED, "no experiment has several wordings")
    alone = [name for name, n in n_wordings.items() if n == 1]
    numbers = (
        f"s+ keeps to one wording in {len(alone)} of {len(n_wordings)} experiments that have "
        "several: " + ", ".join(f"{name} uses {n}" for name, n in n_wordings.items())
    )
    holds = len(alone) == len(n_wordings)
    return Remark(claim, Finding.HOLDS if holds else Finding.DOES_NOT_HOLD, numbers)


def _compared(found: Mapping[str, Results], subset: str) -> tuple[int, int, float]:
    """Images that only s+, and that only `subset` recognizes, and the exact paired p-value."""
    n_images = only_first = only_second = 0
    for one in found.values():
        rows = _rows(one)
        outcome = mcnemar(_tested(rows["s+"]).recognized, _tested(rows[subset]).recognized)
        n_images += outcome.n_images
        only_first += outcome.n_only_first
        only_second += outcome.n_only_second
    return only_first, only_second, PairedTest(n_images, only_first, only_second).p_value


def _rows(found: Results) -> dict[str, Row]:
    return {row.name.value: row for row in found.evaluation.rows}


def _tested(row: Row) -> SubsetScore:
    assert row.test is not None  # noqa: S101  # every experiment has test images
    return row.test
