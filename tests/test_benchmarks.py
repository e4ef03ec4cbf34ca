"""The benchmarks run and say what they measured; how fast is never a test."""

import importlib
import json
import random
from pathlib import Path

import numpy as np
import pytest

from vqa_state.scores import Objective, score
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import SearchSettings

ROOT = Path(__file__).parents[1]
TINY = SearchSettings(population=10, generations=3)


@pytest.fixture
def load(monkeypatch):
    """Imports a benchmark; its textbook engine seeds the global `random`, which is put back."""
    monkeypatch.syspath_prepend(ROOT)
    before = random.getstate()
    yield lambda name: importlib.import_module(f"benchmarks.{name}")
    random.setstate(before)


def test_quick_run_writes_its_rows(load, monkeypatch, tmp_path, capsys):
    bench = load("search")
    plan = bench.Plan(sizes=((8, 4), (16, 6)), n_runs=2, settings=TINY)
    monkeypatch.setattr(bench, "QUICK", plan)
    bench.main(["--quick", "--json", str(tmp_path / "rows.json")])
    result = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))
    assert result["settings"]["population"] == 10
    sizes = [(r["engine"], r["n_questions"], r["n_images"]) for r in result["rows"]]
    assert sizes == [
        ("textbook_deap", 8, 4),
        ("paper", 8, 4),
        ("textbook_deap", 16, 6),
        ("paper", 16, 6),
    ]
    assert all(r["seconds"] > 0 and r["hit_rate"] is None for r in result["rows"])
    assert "times faster" in capsys.readouterr().out


def test_both_engines_maximize_the_same_thing(load):
    """On four questions, both find the one optimum, by their own fitness functions."""
    bench, tables = load("search"), load("tables")
    rng = np.random.default_rng(0)
    counts = tables.draw_counts(tables.draw_task(rng, 4), 6, rng)
    population = np.array(list(np.ndindex(2, 2, 2, 2)), dtype=np.uint8)
    optimum = Fitness(counts, Objective.S_PLUS)(population).max()
    found = [e(counts, SearchSettings(100, 10), 0) for e in bench.ENGINES.values()]
    assert found == pytest.approx([optimum] * 2)


@pytest.mark.parametrize("n_questions", [5, 16, 64])
def test_tables_repeat_and_look_like_a_models(load, n_questions):
    """Most cells agree in all copies, and answers are neither perfect nor coin tosses."""
    tables = load("tables")

    def draw(seed):
        rng = np.random.default_rng(seed)
        return tables.draw_counts(tables.draw_task(rng, n_questions), 20, rng)

    assert (draw(1).correct == draw(1).correct).all()
    drawn = [draw(seed) for seed in range(40)]
    unanimous = np.mean([np.maximum(np.maximum(c.correct, c.wrong), c.invalid) == 6 for c in drawn])
    of_all = [score(c, range(n_questions)) for c in drawn]
    assert unanimous > 0.5
    assert 0.5 < np.mean([s.R_ave for s in of_all]) < 0.9
    assert 0 < np.mean([s.R_invalid for s in of_all]) < 0.3
    assert all((c.labels == 1).sum() == 10 for c in drawn)


def test_the_decision_names_a_command_that_exists(load, capsys):
    text = (ROOT / "docs" / "decisions" / "0002-population-as-array.md").read_text(encoding="utf-8")
    assert "`python -m benchmarks.search`" in text
    with pytest.raises(SystemExit, match="0"):
        load("search").main(["--help"])
    assert "usage: python -m benchmarks.search" in capsys.readouterr().out
