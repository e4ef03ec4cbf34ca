"""The frontier against every subset, and its laws; NSGA-II of DEAP is not ahead anywhere."""

import random

import numpy as np
import pytest
from deap import base, tools
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.tables import draw_counts, draw_task
from vqa_state.answers.rates import Counts, score
from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation import cost_frontier
from vqa_state.evaluation.cost_frontier import FrontierPoint, search_frontier, thinned


def random_counts(seed, n_images, n_questions, n_copies=3) -> Counts:
    rng = np.random.default_rng(seed)
    correct = rng.integers(0, n_copies + 1, (n_images, n_questions))
    invalid = rng.integers(0, n_copies + 1 - correct)
    labels = np.where(np.arange(n_images) % 2, 1, -1).astype(np.int8)
    return Counts(correct, n_copies - correct - invalid, invalid, labels)


def lifelike(seed, n_questions, n_images=20) -> Counts:
    rng = np.random.default_rng(seed)
    return draw_counts(draw_task(rng, n_questions), n_images, rng)


def last_points(counts) -> tuple[FrontierPoint, ...]:
    *_, last = search_frontier(counts)
    assert last.finished
    return last.points


def qualities(counts, subsets):
    """(recognized, R_ave) of many subsets, the plain way."""
    correct, valid = subsets @ counts.correct.T, subsets @ (counts.correct + counts.wrong).T
    R_ave = np.where(valid > 0, correct / np.maximum(valid, 1), 0).mean(axis=1)
    return list(
        zip((2 * correct > valid).sum(axis=1).tolist(), R_ave.round(9).tolist(), strict=True)
    )


def frontier_of_all(counts):
    """Size and quality of the best of every subset, where it beats all smaller ones."""
    n = counts.n_questions
    subsets = np.arange(1, 2**n)[:, np.newaxis] >> np.arange(n) & 1
    best = {}
    for size, quality in zip(subsets.sum(axis=1).tolist(), qualities(counts, subsets), strict=True):
        best[size] = max(best.get(size, quality), quality)
    return beaten(best)


def beaten(best):
    kept = []
    for size, quality in sorted(best.items()):
        if not kept or quality > kept[-1][1]:
            kept.append((size, quality))
    return kept


def shown(points):
    return [(p.n_questions, (p.n_recognized, round(p.R_ave, 9))) for p in points]


@given(st.integers(0, 2**32), st.integers(1, 12), st.integers(1, 9))
@settings(deadline=None, max_examples=30)
def test_random_tables_have_the_frontier_of_all_subsets(seed, n_images, n_questions):
    counts = random_counts(seed, n_images, n_questions)
    assert shown(last_points(counts)) == frontier_of_all(counts)


@pytest.mark.parametrize("seed", range(6))
def test_lifelike_tables_have_the_frontier_of_all_subsets(seed):
    counts = lifelike(seed, 14)
    assert shown(last_points(counts)) == frontier_of_all(counts)


@given(st.integers(0, 2**32), st.integers(1, 6), st.integers(1, 12))
@settings(deadline=None, max_examples=20)
def test_points_are_what_they_say_and_none_is_dominated(seed, n_images, n_questions):
    counts = random_counts(seed, n_images, n_questions, n_copies=4)
    points = last_points(counts)
    for point in points:
        result = score(counts, point.subset)
        assert (point.n_recognized, point.R_ave) == (result.n_recognized, result.R_ave)
        assert (point.n_questions, point.n_images) == (len(point.subset), n_images)
        assert point.n_calls == 4 * point.n_questions
        assert list(point.subset) == sorted(set(point.subset))
    assert shown(points) == beaten(dict(shown(points)))
    assert points[0].n_questions == 1


def test_reports_never_get_worse_and_repeat_exactly():
    counts = lifelike(1, 24)
    reports = list(search_frontier(counts))
    assert reports == list(search_frontier(counts))
    assert [r.step for r in reports] == list(range(1, len(reports) + 1))
    assert [r.finished for r in reports] == [False] * (len(reports) - 1) + [True]
    assert reports[-1].step <= reports[-1].total
    for size in range(1, 25):
        best = [
            max((q for n, q in shown(r.points) if n <= size), default=(-1, -1.0)) for r in reports
        ]
        assert best == sorted(best)


def test_beyond_64_questions_sizes_double(monkeypatch):
    """Hundreds of questions take as many steps as 64 and a few more."""
    monkeypatch.setattr(cost_frontier, "_CELLS_A_STEP", 50_000)
    counts = lifelike(3, 300)
    reports = list(search_frontier(counts))
    assert reports[-1].finished
    assert {report.total for report in reports} == {4 * (67 + 66)}
    points = reports[-1].points
    sizes = {point.n_questions for point in points}
    assert sizes <= {*range(1, 65), 128, 256, 300}
    assert shown(points) == qualities_of(counts, points)
    assert shown(points) == beaten(dict(shown(points)))
    # No worse than the plain way to grow, one question after the other.
    greedy, chosen = {}, np.zeros(300, dtype=int)
    for size in range(1, 65):
        tried = np.array([chosen + (np.arange(300) == q) for q in np.flatnonzero(chosen == 0)])
        best = max(range(len(tried)), key=qualities(counts, tried).__getitem__)
        chosen = tried[best]
        greedy[size] = qualities(counts, chosen[np.newaxis])[0]
    for size, quality in greedy.items():
        assert max(q for n, q in shown(points) if n <= size) >= quality


def qualities_of(counts, points):
    rows = np.array([np.isin(np.arange(counts.n_questions), p.subset) for p in points])
    return list(zip(rows.sum(axis=1).tolist(), qualities(counts, rows.astype(int)), strict=True))


def test_sizes_that_double_reach_what_only_many_questions_tell(monkeypatch):
    """Each question is about one image alone: as many are recognized as there are questions."""
    monkeypatch.setattr(cost_frontier, "_CELLS_A_STEP", 50_000)
    n = 150
    correct = np.zeros((n, n), dtype=int)
    np.fill_diagonal(correct, 2)
    labels = np.where(np.arange(n) % 2, 1, -1).astype(np.int8)
    counts = Counts(correct, np.zeros_like(correct), 2 - correct, labels)
    points = last_points(counts)
    assert [(p.n_questions, p.n_recognized) for p in points] == [
        (size, size) for size in [*range(1, 65), 128, 150]
    ]


def test_nothing_global_changes():
    random.seed(5)
    np.random.seed(5)
    states = random.getstate(), np.random.get_state()[1].tolist()
    last_points(lifelike(0, 12))
    assert (random.getstate(), np.random.get_state()[1].tolist()) == states


def test_a_question_that_is_always_right_is_enough():
    correct = np.array([[1, 3, 0], [2, 3, 0]])
    counts = Counts(correct, 3 - correct, 0 * correct, np.array([1, -1], dtype=np.int8))
    (point,) = last_points(counts)
    assert (point.subset, point.n_recognized, point.R_ave) == ((1,), 2, 1.0)


def test_thinned_keeps_what_recognizes_more():
    points = last_points(random_counts(3, 12, 9))
    few = thinned(points)
    numbers = [point.n_recognized for point in few]
    assert numbers == sorted({point.n_recognized for point in points})
    assert few[0] == points[0]
    assert set(few) <= set(points)
    assert thinned(()) == ()


@pytest.mark.parametrize(("n_images", "n_questions"), [(0, 3), (3, 0)])
def test_nothing_to_search(n_images, n_questions):
    empty = np.zeros((n_images, n_questions), dtype=np.int64)
    counts = Counts(empty, empty, empty, np.ones(n_images, dtype=np.int8))
    with pytest.raises(NothingToSearchError, match="no frontier"):
        search_frontier(counts)


# --- NSGA-II ----------------------------------------------------------------------------------


class TwoGoals(base.Fitness):
    weights = (1.0, -1.0)


class Individual(list):
    def __init__(self, genes):
        super().__init__(genes)
        self.fitness = TwoGoals()


def nsga2(counts, n_individuals, n_generations, seed):
    """DEAP's NSGA-II, many recognized images (then R_ave) against few questions."""
    random.seed(seed)
    n, best = counts.n_questions, {}

    def judge(individuals):
        for one, quality in zip(individuals, qualities(counts, np.array(individuals)), strict=True):
            size = sum(one)
            one.fitness.values = (quality[0] + quality[1] / 2 if size else -1, size)
            if size:
                best[size] = max(best.get(size, quality), quality)

    def random_individual():
        share = random.random()
        return Individual([int(random.random() < share) for _ in range(n)])

    single = [Individual(row) for row in np.eye(n, dtype=int).tolist()]
    population = single + [random_individual() for _ in range(n_individuals - n)]
    judge(population)
    population = tools.selNSGA2(population, n_individuals)
    for _ in range(n_generations):
        children = [Individual(p) for p in tools.selTournamentDCD(population, n_individuals)]
        for first, second in zip(children[::2], children[1::2], strict=True):
            if random.random() < 0.9:
                tools.cxTwoPoint(first, second)
            for child in (first, second):
                tools.mutFlipBit(child, 1.5 / n)
        judge(children)
        population = tools.selNSGA2(population + children, n_individuals)
    return beaten(best)


@pytest.mark.parametrize("seed", [6])
def test_nsga2_is_not_ahead_at_any_size(seed):
    counts = lifelike(2000 + seed, 64)
    ours, theirs = shown(last_points(counts)), nsga2(counts, 100, 25, seed)
    for size in range(1, 65):
        assert max(q for n, q in ours if n <= size) >= max(q for n, q in theirs if n <= size)
