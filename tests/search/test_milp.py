"""The most recognized images: against brute force, and what a limit leaves open."""

import threading
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from search_tables import draw_counts, repeat_questions

from vqa_state.answers.rates import Counts
from vqa_state.search import milp
from vqa_state.search.exact import enumerate_subsets
from vqa_state.search.milp import most_images
from vqa_state.search.objectives import Objective


def last(reports):
    *_, report = reports
    return report


def hard_counts(n_images=36, n_questions=24) -> Counts:
    """Answers that nothing hangs together in: the solver does not prove this in one node."""
    rng = np.random.default_rng(0)
    correct = rng.integers(0, 2, (n_images, n_questions))
    labels = np.where(np.arange(n_images) % 2, 1, -1).astype(np.int8)
    return Counts(correct, 1 - correct, np.zeros_like(correct), labels)


def recognized(counts, objective, subset):
    chosen = list(subset)
    asked = counts.correct + counts.wrong + (counts.invalid if objective.kind.primed else 0)
    return int((2 * counts.correct - asked)[:, chosen].sum(axis=1).__gt__(0).sum())


@given(st.integers(0, 2**32), st.integers(1, 10), st.integers(2, 9), st.sampled_from(Objective))
@settings(max_examples=60)
def test_the_most_of_all_subsets(seed, n_questions, n_images, objective):
    counts = draw_counts(seed, n_images, n_questions)
    most = last(enumerate_subsets(counts, objective)).n_most
    found = last(most_images(counts, objective, (0,)))
    assert found.proved
    assert found.n_recognized == found.bound == most
    assert recognized(counts, objective, found.subset) == most


def test_equal_questions_count_as_often_as_they_stand_there():
    counts = repeat_questions(draw_counts(4, n_questions=5), 2)
    found = last(most_images(counts, Objective.S_PLUS, (0,)))
    assert found.n_recognized == last(enumerate_subsets(counts, Objective.S_PLUS)).n_most


def test_a_limit_leaves_a_bound_that_holds_and_repeats():
    counts = hard_counts()
    reports = list(most_images(counts, Objective.S_PLUS, (0,), node_limits=(1, 2)))
    assert reports == list(most_images(counts, Objective.S_PLUS, (0,), node_limits=(1, 2)))
    assert not reports[-1].proved
    bounds, found = [r.bound for r in reports], [r.n_recognized for r in reports]
    assert bounds == sorted(bounds, reverse=True)
    assert found == sorted(found)
    for report in reports:
        assert recognized(counts, Objective.S_PLUS, report.subset) == report.n_recognized


def test_a_stop_does_not_wait_for_the_solver(monkeypatch):
    """The solver's place is taken by one that works until the test is over."""
    over = threading.Event()
    monkeypatch.setattr(milp, "_solve", lambda *_: over.wait(60))
    start = time.monotonic()
    reports = list(most_images(hard_counts(), Objective.S_PLUS, (0,), stop=lambda: True))
    over.set()
    assert time.monotonic() - start < 10
    assert reports[-1].stopped
    assert reports[-1].n_recognized == reports[0].n_recognized


def test_an_error_of_the_solver_is_raised(monkeypatch):
    def fail(*_):
        raise RuntimeError("no memory")

    monkeypatch.setattr(milp, "_solve", fail)
    with pytest.raises(RuntimeError, match="no memory"):
        list(most_images(hard_counts(), Objective.S_PLUS, (0,)))
