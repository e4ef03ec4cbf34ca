"""The proof: CP-SAT's bound against every subset, what a badge says, stops and repetition."""

import subprocess
import sys
import threading
import time
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from search_tables import brute_force, draw_counts

from vqa_state.search import proof
from vqa_state.search.cpsat import best_value, images_come_first
from vqa_state.search.exact import enumerate_subsets
from vqa_state.search.fitness import Fitness, Terms
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights
from vqa_state.search.proof import (
    PROOF_TOLERANCE,
    Badge,
    ProofLimits,
    ProofReport,
    ProofStage,
    prove,
    prove_all,
)

WEIGHTS = [
    PAPER_WEIGHTS,
    ObjectiveWeights(beta=0),
    ObjectiveWeights(alpha=0, beta=0.5),
    ObjectiveWeights(alpha=1, beta=0.75),
    ObjectiveWeights(alpha=3.7, beta=1 / 3),
]
SHORT = ProofLimits(nodes=(1,), deterministic_time=0.02)


def last(reports):
    *_, report = reports
    return report


@pytest.fixture
def no_comparison(monkeypatch):
    """Small tables take the road of large ones."""
    monkeypatch.setattr(proof, "can_enumerate", lambda *_: False)


@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("p_invalid", [0.0, 0.2, 0.8])
def test_cpsat_proves_what_brute_force_finds(objective, weights, p_invalid):
    for seed in range(2):
        counts = draw_counts(seed, 4 + seed, 6, p_invalid=p_invalid)
        E, _, most = brute_force(counts, objective, weights)
        found = last(
            best_value(
                counts,
                objective,
                (0,),
                n_recognized=(most, most),
                weights=weights,
                deterministic_time=10,
            )
        )
        assert found.bound >= float(E) - 1e-12
        assert found.bound - found.value <= PROOF_TOLERANCE
        assert found.value == Fitness(counts, objective, weights).terms(found.subset).value


@given(st.integers(0, 2**32), st.sampled_from(Objective), st.sampled_from(WEIGHTS))
@settings(max_examples=25)
def test_every_bound_on_the_way_holds(seed, objective, weights):
    counts = draw_counts(seed, 7, 10)
    exact = last(enumerate_subsets(counts, objective, weights=weights))
    for report in best_value(
        counts,
        objective,
        (seed % 10,),
        n_recognized=(0, counts.n_images),
        weights=weights,
        deterministic_time=0.01,
    ):
        assert report.value <= exact.terms.value <= report.bound + 1e-12


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
@pytest.mark.usefixtures("no_comparison")
def test_the_long_road_ends_where_the_comparison_does(objective, weights):
    for seed in range(2):
        counts = draw_counts(seed, 8, 11)
        exact = last(enumerate_subsets(counts, objective, weights=weights))
        reports = list(prove(counts, objective, (seed,), weights=weights))
        assert reports[-1].badge is Badge.BEST
        assert reports[-1].terms.value == pytest.approx(exact.terms.value, abs=PROOF_TOLERANCE)
        for report in reports:
            assert report.terms.value <= exact.terms.value <= report.bound + 1e-12
            assert report.n_bound >= exact.terms.n_recognized
        assert [r.bound for r in reports] == sorted((r.bound for r in reports), reverse=True)
        assert [r.n_bound for r in reports] == sorted((r.n_bound for r in reports), reverse=True)


def test_more_than_90_images_are_not_fixed():
    """With one image worth less than the rest of E, fewer images may be best: nothing is fixed."""
    assert images_come_first(90, PAPER_WEIGHTS)
    assert not images_come_first(91, PAPER_WEIGHTS)
    weights = ObjectiveWeights(alpha=0.5, beta=0.9)
    worse = 0
    for seed in range(6):
        counts = draw_counts(seed, 6, 6)
        E, subset, most = brute_force(counts, Objective.S_PLUS, weights)
        fitness = Fitness(counts, Objective.S_PLUS, weights)
        worse += fitness.terms(subset).n_recognized < most
        found = last(
            best_value(
                counts,
                Objective.S_PLUS,
                (0,),
                n_recognized=(most, most),
                weights=weights,
                deterministic_time=10,
            )
        )
        assert found.value == pytest.approx(float(E), abs=PROOF_TOLERANCE)
    assert worse  # so fixing would have failed


@pytest.mark.parametrize("objective", Objective)
def test_up_to_24_questions_all_are_compared(objective):
    counts = draw_counts(1, 10, 13)
    exact = last(enumerate_subsets(counts, objective))
    report = last(prove(counts, objective, (0,)))
    assert report.stage is ProofStage.SUBSETS
    assert (report.subset, report.terms, report.gap) == (exact.subset, exact.terms, 0)
    assert report.finished
    assert report.sentence == "proved best"


@pytest.mark.usefixtures("no_comparison")
def test_a_limit_never_loses_the_start_and_repeats():
    counts = draw_counts(7, 10, 27, 6)
    start = tuple(range(0, 27, 3))
    value = Fitness(counts, Objective.S_PLUS).terms(start).value
    reports = list(prove(counts, Objective.S_PLUS, start, limits=SHORT))
    assert all(report.terms.value >= value for report in reports)
    assert list(prove(counts, Objective.S_PLUS, start, limits=SHORT)) == reports


def test_the_cap_holds_from_the_first_report():
    counts = draw_counts(8, 12, 26, 6)
    for objective in Objective:
        for report in prove(counts, objective, (0,), limits=SHORT):
            cap = 100 * report.n_bound / 12 + 1 + max(objective.kind.beta_sign * 0.1, 0)
            assert report.terms.value <= report.bound <= cap + 1e-9


REPORT = ProofReport(
    objective=Objective.S_PLUS,
    stage=ProofStage.VALUE,
    subset=(0,),
    terms=Terms(19, 20, 0.75, 1, 4, 95.8),
    bound=95.9133,
    n_bound=19,
)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({}, "most images proved, E within 0.12 of the bound"),
        ({"bound": 95.8}, "proved best"),
        ({"bound": 95.8 + PROOF_TOLERANCE / 2}, "proved best"),
        ({"bound": 101.1, "n_bound": 20}, "best found, bound 20"),
    ],
)
def test_the_badge_says_what_is_proved(changes, sentence):
    assert replace(REPORT, **changes).sentence == sentence


def test_a_stop_in_the_middle_of_a_solver_is_heard():
    """A limit of hours, and a stop once the solver is at it."""
    counts, stopped, reports, begun = draw_counts(9, 40, 60, 6), threading.Event(), [], []

    def stop_now():
        begun.append(time.monotonic())
        stopped.set()

    for report in best_value(
        counts,
        Objective.S_PLUS,
        (0,),
        n_recognized=(0, 40),
        deterministic_time=10_000,
        stop=stopped.is_set,
    ):
        reports.append(report)
        if len(reports) == 3:
            threading.Timer(0.2, stop_now).start()
    assert time.monotonic() - begun[0] < 20  # less than a second where nobody else works
    assert reports[-1].stopped


def test_four_side_by_side_are_four_alone():
    counts = draw_counts(10, 8, 26, 6)
    starts = dict.fromkeys(Objective, (3, 5))
    together = last(prove_all(counts, starts, limits=SHORT))
    for objective in Objective:
        assert together[objective] == last(prove(counts, objective, (3, 5), limits=SHORT))


def test_a_caller_may_leave_in_the_middle():
    before = threading.active_count()
    reports = prove_all(draw_counts(11, 12, 26, 6), dict.fromkeys(Objective, (0,)), limits=SHORT)
    next(reports)
    reports.close()
    deadline = time.monotonic() + 60
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.05)
    assert threading.active_count() <= before


@pytest.mark.parametrize("subset", [(), (99,), (1, 1)])
def test_a_start_must_be_a_subset(subset):
    with pytest.raises(ValueError, match=r"a subset is the distinct|at least one question"):
        prove(draw_counts(0), Objective.S_PLUS, subset)


@pytest.mark.parametrize("wrong", [{"nodes": ()}, {"nodes": (0,)}, {"deterministic_time": 0.0}])
def test_limits_are_limits(wrong):
    with pytest.raises(ValueError, match="must be"):
        ProofLimits(**wrong)


def test_solvers_are_imported_when_a_proof_needs_them():
    code = (
        "import sys, vqa_state.search.proof, vqa_state.search.engines.restarts\n"
        "assert not {'ortools', 'scipy.optimize', 'highspy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
