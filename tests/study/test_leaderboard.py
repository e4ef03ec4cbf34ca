"""The table in words: what is known, what is not, and who wins."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binomtest
from study.test_assess import Colours
from tuned_project import tuned_copy

from vqa_state.evaluation.coverage import CoveragePoint
from vqa_state.evaluation.estimates import Estimate
from vqa_state.evaluation.intervals import Interval, clopper_pearson
from vqa_state.evaluation.paired_tests import compare
from vqa_state.project.split import Split
from vqa_state.report.page import report_page
from vqa_state.search.objectives import Objective
from vqa_state.study.assess import assess
from vqa_state.study.leaderboard import standings
from vqa_state.study.leaderboard_rows import RIVAL, SideScore, Standing, Standings
from vqa_state.study.leaderboard_words import (
    comparison_sentences,
    standings_frame,
    warning_sentences,
)
from vqa_state.study.optimize import results
from vqa_state.study.recommendation import cheaper_objective_sentence, everything_sentence
from vqa_state.votes.rules import VoteKind

NAN = math.nan


def side(*pairs):
    return SideScore(*pairs, *(clopper_pearson(*pair) for pair in pairs))


def row(name, estimate=None, test=None, *, recommended=False):
    train = side((20, 20), (12, 12), (8, 8))
    kind = None if name == RIVAL else VoteKind.PAPER
    return Standing(name, kind, 3, 18, 9.0, 7.4, train, estimate, test, recommended)


def estimate(share, positive=0.9, negative=0.5, half=0.1):
    return Estimate(share, positive, negative, 0.05, share - half, share + half)


def frame(*rows):
    return standings_frame(Standings(rows, (), (), "", (), ())).to_dict("records")


def test_out_of_bag_is_told_of_each_state():
    (known,) = frame(row("s+", estimate(0.75)))
    assert known["out of bag"] == "15.0 of 20 (13.0–17.0)"
    assert known["out of bag, positive"] == "10.8 of 12"
    assert known["out of bag, negative"] == "4.0 of 8"


@pytest.mark.parametrize("unknown", [None, Estimate(*[NAN] * 6)])
def test_what_is_not_known_is_a_dash(unknown):
    (cells,) = frame(row("s-", unknown))
    for name in ("out of bag", "out of bag, positive", "out of bag, negative", "test"):
        assert cells[name] == "–"


def test_a_state_that_was_never_out_is_a_dash_alone():
    (cells,) = frame(row("s+", estimate(0.5, positive=NAN)))
    assert (cells["out of bag, positive"], cells["out of bag, negative"]) == ("–", "4.0 of 8")


def test_test_scores_of_a_state_carry_their_clopper_pearson():
    """binomtest of 8 of 10 and of 9 of 9; a state without test images has nothing to tell."""
    (cells,) = frame(row("s+", test=side((17, 19), (8, 10), (9, 9))))
    for name, n_right, n_images in (("positive", 8, 10), ("negative", 9, 9)):
        exact = binomtest(n_right, n_images).proportion_ci(0.95, "exact")
        low, high = exact.low * n_images, exact.high * n_images
        assert cells[f"test, {name}"] == f"{n_right} of {n_images} ({low:.1f}–{high:.1f})"
    (cells,) = frame(row("s+", test=side((8, 10), (8, 10), (0, 0))))
    assert cells["test, negative"] == "–"


def test_single_votes_say_what_stays_unknown_and_how_right_the_surest_are():
    first = CoveragePoint(0.0, 20, 200, 190, 150, Interval(0.5, 0.9))
    careful = CoveragePoint(0.2, 20, 200, 180, 153, Interval(0.6, 0.95))
    (cells,) = frame(replace(row("s+", estimate(0.75)), uncareful=first, careful=careful))
    assert cells["out of bag, unknown"] == "5%"
    assert cells["out of bag, right at 90 %"] == "85% (60%–95%)"
    (cells,) = frame(row("s-"))
    assert cells["out of bag, unknown"] == cells["out of bag, right at 90 %"] == "–"


def warnings(vote, rival, *, has_test=False, rows=None):
    assessed = SimpleNamespace(
        rival=rival and SimpleNamespace(estimate=rival),
        no_rival="no network",
        recommended_estimate=vote,
        estimates={VoteKind.PAPER: estimate(1.0)},  # flatters, so it must not be compared
        recommendation=SimpleNamespace(kind=VoteKind.PAPER),
        groups_divided=False,
        finished=True,
        n_resamples=30,
    )
    rows = rows or [row("s+", vote, recommended=True), row(RIVAL, rival)]
    return [
        one for one in warning_sentences(rows, assessed, has_test=has_test) if "promise" not in one
    ]


def test_a_rival_that_wins_out_of_bag_is_said_to_win():
    (said,) = warnings(estimate(0.70), estimate(0.80))
    assert said.startswith(f"Out of bag, the {RIVAL} wins: it recognizes 16.0 of 20")
    assert "the recommended vote 14.0" in said
    assert "may be luck" in said
    assert "does not export" not in said
    (said,) = warnings(estimate(0.60), estimate(0.95, half=0.05))
    assert "wins" in said
    assert "luck" not in said
    assert "does not export" in said


def test_a_rival_that_comes_as_far_is_said_to():
    for share in (0.79, 0.80, 0.81):
        (said,) = warnings(estimate(0.80), estimate(share))
        assert "does as well without questions" in said


def test_a_rival_that_loses_or_is_unknown_needs_no_word():
    assert warnings(estimate(0.80), estimate(0.75)) == []
    assert warnings(estimate(0.80), Estimate(*[NAN] * 6)) == []
    assert warnings(estimate(0.80), None) == ["There is no trained rival: no network."]


def test_without_test_images_the_rival_lacks_none():
    vote, rival = estimate(0.9), estimate(0.7)
    assert warnings(vote, rival) == []
    (said,) = warnings(vote, rival, has_test=True)
    assert "has not seen all test images" in said
    seen = side((15, 20), (8, 10), (7, 10))
    rows = [row("s+", vote, seen, recommended=True), row(RIVAL, rival, seen)]
    assert warnings(vote, rival, has_test=True, rows=rows) == []


@pytest.mark.parametrize("rival", [0.95, 0.8, 0.5])
def test_no_warning_tells_of_the_test(rival):
    """They are shown before a look at the test images."""
    vote, said = estimate(0.8), []
    for n_right in (0, 7, 20):
        seen = side((n_right, 20), (n_right // 2, 10), (n_right // 2, 10))
        rows = [row("s+", vote, seen, recommended=True), row(RIVAL, estimate(rival), seen)]
        said.append(warnings(vote, estimate(rival), has_test=True, rows=rows))
    assert said[0] == said[1] == said[2]


@pytest.mark.parametrize(("n_lost", "luck"), [(2, True), (12, False)])
def test_a_rival_that_wins_on_the_test_is_said_to_win(n_lost, luck):
    ours = np.arange(20) >= n_lost
    comparisons = compare({"s+": ours, RIVAL: np.ones(20, bool)}, [("s+", RIVAL)])
    first, second = comparison_sentences([], comparisons, has_test=True)
    assert f"{n_lost} fewer images than {RIVAL}" in first
    assert second.startswith(f"So the {RIVAL} wins on the test images")
    assert ("may be luck" in second) is luck
    assert ("does not export" in second) is not luck
    swapped = compare({"s+": np.ones(20, bool), RIVAL: ours}, [("s+", RIVAL)])
    assert len(comparison_sentences([], swapped, has_test=True)) == 1


def test_a_test_score_says_how_little_it_shows():
    """20 of 20 shows 83 % or more: 0.025 ** (1 / 20)."""
    seen = side((20, 20), (10, 10), (10, 10))
    every = np.ones(20, bool)
    comparisons = compare({"s+": every, RIVAL: every}, [("s+", RIVAL)])
    first, *_ = comparison_sentences([row("s+", test=seen)], comparisons, has_test=True)
    assert first.startswith("s+ recognizes 20 of 20 test images; that only shows")
    assert f"{0.025 ** (1 / 20):.0%} to 100%" in first


def test_without_test_images_it_says_so():
    (said,) = comparison_sentences([], (), has_test=False)
    assert said.startswith("There are no test images")


# --- which objective to take ------------------------------------------------------------------


def costing(name, n_calls, n_recognized, **more):
    train = side((n_recognized, 20), (10, 10), (n_recognized - 10, 10))
    return replace(row(name, **more), n_calls=n_calls, train=train)


def test_a_cheaper_objective_that_does_as_well_is_named_with_the_way_to_assess_it():
    rows = [
        costing("s+", 312, 19),
        costing("s'-", 12, 19),
        costing("s-", 6, 19),
        costing("best question", 1, 20),  # no objective: nothing to choose
    ]
    said = cheaper_objective_sentence(rows, Objective.S_PLUS, is_assessed=True)
    assert said == (
        "s- recognizes as many training images (19 of 20) with 6 calls instead of 312; to estimate "
        "it out of bag, choose it (on Recognizer, or with `export --objective s-`) and assess "
        "again."
    )
    first = cheaper_objective_sentence(rows, Objective.S_PLUS, is_assessed=False)
    assert first.endswith("and assess it.")


def test_a_cheaper_objective_that_does_better_is_said_to():
    rows = [costing("s+", 312, 18), costing("s-", 6, 20)]
    said = cheaper_objective_sentence(rows, Objective.S_PLUS, is_assessed=False)
    assert said.startswith("s- recognizes more training images (20 of 20 instead of 18) with 6")


def test_it_is_the_recommended_row_that_is_compared():
    rows = [costing("s+", 5, 20), costing("s+, threshold", 60, 18, recommended=True)]
    rows += [costing("s-", 6, 18)]
    said = cheaper_objective_sentence(rows, Objective.S_PLUS, is_assessed=True)
    assert "6 calls instead of 60" in said


@pytest.mark.parametrize(("n_calls", "n_recognized"), [(6, 18), (312, 20), (400, 20)])
def test_no_objective_is_named_that_does_worse_or_costs_as_much(n_calls, n_recognized):
    rows = [costing("s+", 312, 19), costing("s-", n_calls, n_recognized)]
    assert cheaper_objective_sentence(rows, Objective.S_PLUS, is_assessed=True) == ""


# --- or all questions -------------------------------------------------------------------------


def said_of_all(n_recognized, kept, n_calls=312):
    everything = costing(
        "s_all", 384, n_recognized, estimate=Estimate(n_recognized / 20, *[NAN] * 5)
    )
    rows = [costing("s+", n_calls, 20, recommended=True), replace(everything, n_questions=64)]
    return everything_sentence(rows, SimpleNamespace(recommended_estimate=estimate(kept)))


def test_all_questions_that_do_as_well_or_better_are_told():
    assert said_of_all(18, 0.90) == (
        "All 64 questions together, which no image chose, recognize 18 of 20 training images; the "
        "recommended vote keeps 18.0 out of bag. So the choice gains no accuracy here but saves "
        "calls (312 instead of 384)."
    )
    assert "loses accuracy here but saves calls" in said_of_all(19, 0.90)
    assert "gains no accuracy here." in said_of_all(18, 0.90, n_calls=384)


def test_all_questions_that_do_worse_or_are_not_known_are_not_told():
    assert said_of_all(17, 0.90) == said_of_all(18, NAN) == ""
    assert everything_sentence([costing("s+", 6, 20, recommended=True)], None) == ""


# --- in a project -----------------------------------------------------------------------------


@pytest.fixture
def tuned(make_project, tmp_path):
    return tuned_copy(make_project, tmp_path)


def with_turned_labels(project, split):
    """The same project with every label of a side turned."""
    for image in project.labelled(split):
        project.set_labels([image.id], -image.label)
    return project


def test_what_no_image_chose_keeps_its_training_score_out_of_bag(tuned):
    kept = None
    for last in assess(tuned, features=Colours, n_resamples=3):
        kept = last.assessment
    found = results(tuned)
    rows = {one.name: one for one in standings(tuned.chosen, found, kept).rows}
    for name in ("s_all", "s_is", "s_does"):
        n_right, n_images = rows[name].train.whole
        assert rows[name].estimate.share == n_right / n_images
        assert _cell(rows[name]) == f"{n_right:.1f} of {n_images}"
    assert rows["best question"].estimate is None
    assert all(one.estimate is None for one in standings(tuned.chosen, found, None).rows)


def _cell(one):
    (cells,) = frame(one)
    return cells["out of bag"]


def test_the_advice_names_the_cheaper_objective_by_training_images_alone(tuned):
    found = results(tuned)
    by_name = {one.name.value: one for one in found.evaluation.rows}
    tuned.chosen = Objective.S_PLUS
    own = by_name["s+"]
    fewer = [
        by_name[name]
        for name in ("s'+", "s-", "s'-")
        if len(by_name[name].subset) < len(own.subset)
        and by_name[name].train.n_recognized >= own.train.n_recognized
    ]
    assert fewer, "this project has nothing to tell"
    table = standings(tuned.chosen, found, None)
    cheapest = min(len(one.subset) for one in fewer)
    assert f"{cheapest * tuned.augmentation.n_copies} calls instead of" in table.recommendation
    page = report_page(tuned, found, None, table)
    assert f"{cheapest * tuned.augmentation.n_copies} calls instead of" in page
    turned = standings(tuned.chosen, results(with_turned_labels(tuned, Split.TEST)), None)
    assert turned.recommendation == table.recommendation


def test_every_row_names_the_images_that_it_misses(tuned):
    """As the evaluation counts them, and as many as the scores say; the rival by its own sides."""
    *_, last = assess(tuned, features=Colours, n_resamples=3)
    found, kept = results(tuned), last.assessment
    rows = {one.name: one for one in standings(tuned.chosen, found, kept).rows}
    for row in found.evaluation.rows:
        seen = rows[row.name.value]
        assert seen.asked == tuple(sorted(row.subset))
        for ours, theirs in (
            (seen.train_missed, row.train_missed),
            (seen.test_missed, row.test_missed),
        ):
            wanted = [
                (one.image_id, 0 if one.n_for == one.n_against else -one.label) for one in theirs
            ]
            assert [(one.image_id, one.verdict) for one in ours] == wanted
    for row in rows.values():
        assert len(row.train_missed) == row.train.whole[1] - row.train.whole[0]
        assert len(row.test_missed) == row.test.whole[1] - row.test.whole[0]
    for one in (*rows[RIVAL].train_missed, *rows[RIVAL].test_missed):
        assert kept.rival.sides[one.image_id] == one.verdict == -tuned.images[one.image_id].label
