"""The benchmark of what the recommended vote gains says what it measured."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest

from vqa_state.answers.rates import count
from vqa_state.evaluation.estimates import Estimate
from vqa_state.search.genetic import SearchSettings
from vqa_state.votes.rules import VoteKind

ROOT = Path(__file__).parents[2]
TINY = SearchSettings(population=10, generations=3)


@pytest.fixture
def bench(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    return importlib.import_module("benchmarks.generalization")


def test_quick_run_writes_its_figures(bench, monkeypatch, tmp_path, capsys):
    plan = bench.Plan(n_tasks=3, n_resamples=2, settings=TINY, n_processes=1)
    monkeypatch.setattr(bench, "QUICK", plan)
    # In this process: a new one would import everything again.
    monkeypatch.setattr(
        bench, "measure", lambda plan: [bench.run_task(n, plan) for n in range(plan.n_tasks)]
    )
    bench.main(["--quick", "--json", str(tmp_path / "figures.json")])
    result = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    assert result["n_tasks"] == 3
    assert result["gain_of_20"]["low"] <= result["gain_of_20"]["mean"]
    assert {"oob_bias_of_20", "oob_rmse_of_20", "kind_gains_of_20", "seconds"} <= set(result)
    assert sum(result["recommended"].values()) == 3
    assert "3 tasks" in capsys.readouterr().out


def test_the_full_plan_is_as_large_as_promised(bench):
    assert bench.FULL.n_tasks >= 200
    assert (bench.N_TRAIN, bench.N_TEST) == (20, 400)


def test_a_task_repeats_and_no_kind_sees_the_test_images(bench, monkeypatch):
    plan = bench.Plan(n_resamples=2, settings=TINY)
    first, again = bench.run_task(1, plan), bench.run_task(1, plan)
    assert first == again
    real, drawn = bench.draw_counts, []

    def other_test_images(task, n_images, rng):
        drawn.append(n_images)
        return real(task, n_images, np.random.default_rng(9) if n_images == 400 else rng)

    monkeypatch.setattr(bench, "draw_counts", other_test_images)
    other = bench.run_task(1, plan)
    assert drawn == [20, 400]
    assert other.test != first.test
    assert [one.promised for one in other.careful] == [one.promised for one in first.careful]
    assert (other.train, other.recommended, other.estimate, other.n_used) == (
        first.train,
        first.recommended,
        first.estimate,
        first.n_used,
    )


def test_the_figures_are_paired_and_in_images_of_20(bench):
    def outcome(paper, weighted, kind, estimate, covered):
        return bench.Outcome(
            test={VoteKind.PAPER: paper, VoteKind.WEIGHTED_ANSWERS: weighted},
            train={VoteKind.PAPER: 1.0, VoteKind.WEIGHTED_ANSWERS: 1.0},
            recommended=kind,
            estimate=Estimate(estimate, 1, 1, 0.1, estimate - 0.06, estimate + 0.06),
            own_estimate=Estimate(estimate + 0.1, 1, 1, 0.1, 0, 1),
            n_used={VoteKind.PAPER: 4, VoteKind.WEIGHTED_ANSWERS: 9},
            careful=(
                bench.Careful(covered, 0.8, 0.85, 0.7, 0.9),
                bench.Careful(0.0, np.nan, 0.9, 0.7, 1.0)
                if covered < 0.9
                else bench.Careful(0.5, 0.6, 0.9, 0.7, 1.0),
            ),
        )

    result = bench.summarize(
        [
            outcome(0.8, 0.9, VoteKind.WEIGHTED_ANSWERS, 0.85, 0.95),
            outcome(0.6, 0.5, VoteKind.PAPER, 0.7, 0.85),
        ]
    )
    assert result["s_plus_of_20"] == pytest.approx(14)
    assert result["gain_of_20"]["mean"] == pytest.approx(1)  # 2 and 0
    # With two tasks, t = 12.706 times the standard error, 1.
    assert result["gain_of_20"]["low"] == pytest.approx(1 - 12.706, abs=1e-3)
    assert result["kind_gains_of_20"]["weighted answers"]["mean"] == pytest.approx(0)
    assert result["oob_bias_of_20"] == pytest.approx(20 * (-0.05 + 0.1) / 2)
    assert result["oob_own_bias_interval_of_20"]["mean"] == pytest.approx(20 * (0.05 + 0.2) / 2)
    first, second = result["coverage"]["0.9"], result["coverage"]["0.7"]
    assert first["actual"]["mean"] == pytest.approx(0.9)
    assert first["actual"]["low"] == pytest.approx(0.9 - 12.706 * 0.05, abs=1e-3)
    assert (first["accuracy"], first["accuracy_bias"]["mean"]) == pytest.approx((0.8, 0.05))
    assert (first["accuracy_interval_holds"], second["accuracy_interval_holds"]) == (1, 0)
    # Where no new image got a verdict, there is no accuracy to miss.
    assert (second["actual"]["mean"], second["accuracy"]) == pytest.approx((0.25, 0.6))
    assert result["oob_rmse_of_20"] == pytest.approx(20 * np.sqrt((0.05**2 + 0.1**2) / 2))
    assert result["oob_interval_holds"] == 0.5
    assert result["train_bias_of_20"] == pytest.approx(20 * (0.1 + 0.4) / 2)
    assert result["recommended"] == {"weighted answers": 1, "paper": 1}


def test_answers_are_those_that_were_counted(bench):
    task = bench.draw_task(np.random.default_rng(3), 16)
    counts = bench.draw_counts(task, 12, np.random.default_rng(4))
    spread = count(bench.answers(counts, np.random.default_rng(5)))
    for name in ("correct", "wrong", "invalid", "labels"):
        assert np.array_equal(getattr(spread, name), getattr(counts, name))


def test_the_decision_shows_the_figures_that_are_kept(bench):
    result = json.loads((ROOT / "docs" / "generalization.json").read_text(encoding="utf-8"))
    text = (ROOT / "docs" / "decisions" / "0009-kinds-of-vote.md").read_text(encoding="utf-8")
    assert bench.table(result) in text
    assert "`python -m benchmarks.generalization`" in text
    assert result["n_tasks"] == bench.FULL.n_tasks


def test_the_kept_figures_show_a_gain_and_an_honest_estimate(bench):
    """On the kept figures: a gain that is none of luck, and an estimate that hardly flatters."""
    result = json.loads((ROOT / "docs" / "generalization.json").read_text(encoding="utf-8"))
    assert result["gain_of_20"]["low"] > 0
    assert abs(result["oob_bias_of_20"]) < 0.3


def test_the_kept_figures_keep_the_wanted_coverage(bench):
    result = json.loads((ROOT / "docs" / "generalization.json").read_text(encoding="utf-8"))
    for wanted, one in result["coverage"].items():
        assert abs(one["actual"]["mean"] - float(wanted)) < 0.04
        assert abs(one["accuracy_bias"]["mean"]) < 0.02
