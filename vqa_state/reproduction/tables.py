"""The paper's tables with ours beside them, the totals, and whether its three remarks hold here."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd
from scipy.stats import binomtest

from vqa_state.evaluation import CONFIDENCE, Candidate, Row, paired_test
from vqa_state.reproduction.paper import BEST_QUESTION_OF_VARIOUS_DOORS, SUBSETS, paper_tables
from vqa_state.scores import SubsetScore
from vqa_state.searches import Results

__all__ = ["Remark", "experiment_frame", "identity_holds", "remarks", "total_frame"]

#: R_invalid(all) is the mean of the two forms' in exact arithmetic; floats differ by less.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Remark:
    """Something that the paper saw in its model, and whether ours shares it."""

    claim: str
    holds: bool
    numbers: str


def experiment_frame(name: str, found: Results) -> pd.DataFrame:
    """One table: a row for each subset, every column for the paper and for us.

    "recognized" counts test images; `low` and `high` are our exact 95 % interval, as images.
    The best single question has a paper's figure for various doors only.
    """
    paper = paper_tables().query("experiment == @name").set_index("subset")
    rows = _rows(found)
    records = []
    for subset in (*SUBSETS, Candidate.BEST_QUESTION.value):
        row = rows[subset]
        test, intervals = _tested(row), row.intervals
        theirs = paper.loc[subset].to_dict() if subset in paper.index else {}
        if subset == Candidate.BEST_QUESTION.value and name == "various_doors":
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
                "questions": len(rows[Candidate.S_ALL.value].subset),
            }
        )
    return pd.DataFrame(records)


def total_frame(found: Mapping[str, Results]) -> pd.DataFrame:
    """Recognized test images of all experiments together, ours with exact 95 % intervals.

    The images of various doors are those of the four door experiments, so they count twice, in the
    paper's total as in ours. The last columns compare s+ with each other row on the same images.
    """
    frame = pd.concat([experiment_frame(name, one) for name, one in found.items()])
    records = []
    for subset in ("s+", "s-", "s_all", Candidate.BEST_QUESTION.value):
        own = frame[frame["subset"] == subset]
        n_recognized, n_images = int(own["recognized"].sum()), int(own["images"].sum())
        exact = binomtest(n_recognized, n_images).proportion_ci(CONFIDENCE, "exact")
        known = own["paper_recognized"].notna().all()
        only_first, only_second, p_value = _compared(found, subset)
        records.append(
            {
                "subset": subset,
                "paper_recognized": int(own["paper_recognized"].sum()) if known else None,
                "paper_images": int(own["paper_images"].sum()) if known else None,
                "recognized": n_recognized,
                "images": n_images,
                "low": round(exact.low * n_images, 1),
                "high": round(exact.high * n_images, 1),
                "only_s_plus": only_first,
                "only_this": only_second,
                "p_value": p_value,
            }
        )
    return pd.DataFrame(records)


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
    """A test score of s_is and of s_does, for every experiment."""
    rows = [_rows(one) for one in found.values()]
    return [(value(_tested(row["s_is"])), value(_tested(row["s_does"]))) for row in rows]


def _forms_remark(claim: str, what: str, pairs: Sequence[tuple[float, float]]) -> Remark:
    """It holds if the mean over the experiments is higher for `is`."""
    n = len(pairs)
    of_is, of_does = (sum(values) / n for values in zip(*pairs, strict=True))
    more = sum(first > second for first, second in pairs)
    equal = sum(first == second for first, second in pairs)
    numbers = (
        f"mean {what} {of_is:.3f} against {of_does:.3f}; "
        f"higher for `is` in {more} of {n} experiments, equal in {equal}"
    )
    return Remark(claim, of_is > of_does, numbers)


def _one_wording(found: Mapping[str, Results]) -> Remark:
    n_wordings = {}
    for name, one in found.items():
        questions = one.train.questions
        if len({question.wording for question in questions}) > 1:
            chosen = _rows(one)["s+"].subset
            n_wordings[name] = len({questions[number].wording for number in chosen})
    alone = [name for name, n in n_wordings.items() if n == 1]
    numbers = (
        f"s+ keeps to one wording in {len(alone)} of {len(n_wordings)} experiments that have "
        "several: " + ", ".join(f"{name} uses {n}" for name, n in n_wordings.items())
    )
    claim = "the optimized questions of one experiment all use the same wording"
    return Remark(claim, len(alone) == len(n_wordings), numbers)


def _compared(found: Mapping[str, Results], subset: str) -> tuple[int, int, float]:
    """Images that only s+, and that only `subset` recognizes, and the exact paired p-value."""
    only_first = only_second = 0
    for one in found.values():
        rows = _rows(one)
        outcome = paired_test(_tested(rows["s+"]), _tested(rows[subset]))
        only_first += outcome.n_only_first
        only_second += outcome.n_only_second
    differing = only_first + only_second
    p_value = float(binomtest(only_first, differing).pvalue) if differing else 1.0
    return only_first, only_second, p_value


def _rows(found: Results) -> dict[str, Row]:
    return {row.name.value: row for row in found.evaluation.rows}


def _tested(row: Row) -> SubsetScore:
    assert row.test is not None  # noqa: S101  # every experiment has test images
    return row.test
