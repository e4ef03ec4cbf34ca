"""The benchmarks run and say what they measured; how fast is never a test."""

import importlib
import json
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vqa_state.answers.rates import score
from vqa_state.search.exact import enumerate_subsets
from vqa_state.search.fitness import Fitness
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective

ROOT = Path(__file__).parents[2]
TINY = SearchSettings(population=10, generations=3)


@pytest.fixture
def load(monkeypatch):
    """Imports a benchmark; its textbook engine seeds the global `random`, which is put back."""
    monkeypatch.syspath_prepend(ROOT)
    before = random.getstate()
    yield lambda name: importlib.import_module(f"benchmarks.{name}")
    random.setstate(before)


def test_quick_run_writes_its_rows(load, monkeypatch, tmp_path, capsys):
    """Tiny tables, one of them with an optimum that is not proved."""
    bench, prove = load("search"), load("prove_optima")
    plan = bench.Plan(
        sizes=((4, 4), (8, 6)), n_tables=3, n_textbook=2, n_proofs=1, settings=TINY, n_restarts=8
    )
    optima = [prove.prove_table(*size, number) for size in plan.sizes for number in range(3)]
    optima[4] = replace(optima[4], proved=False)
    monkeypatch.setattr(bench, "QUICK", plan)
    monkeypatch.setattr(bench, "read_optima", lambda: optima)
    bench.main(["--quick", "--json", str(tmp_path / "rows.json")])
    result = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))
    assert result["settings"]["population"] == 10
    runs = [(r["engine"], r["n_questions"], r["n_proved"], r["n_unproved"]) for r in result["rows"]]
    assert runs == [
        ("textbook_deap", 4, 2, 0),
        ("paper", 4, 3, 0),
        ("default", 4, 3, 0),
        ("textbook_deap", 8, 1, 1),
        ("paper", 8, 2, 1),
        ("default", 8, 2, 1),
    ]
    assert all(r["seconds"] > 0 and 0 <= r["hit_rate"] <= 1 for r in result["rows"])
    assert result["rows"][2]["hit_rate"] == 1  # four questions: climbs miss nothing
    assert result["proof"]["images_proved"] == result["proof"]["best_proved"] == 1
    assert result["proof"]["median_gap"] == 0
    assert "times faster" in capsys.readouterr().out


def test_a_table_that_numpy_draws_otherwise_is_refused(load):
    bench, prove = load("search"), load("prove_optima")
    optimum = replace(prove.prove_table(4, 4, 0), digest="0")
    with pytest.raises(SystemExit, match="draws other numbers"):
        list(bench.measure(bench.Plan(sizes=((4, 4),)), [optimum]))


def test_the_committed_optima_are_of_these_tables(load):
    """Digest, value and subset belong together; small tables are compared anew in full."""
    prove, tables = load("prove_optima"), load("tables")
    optima = prove.read_optima()
    assert {(one.n_questions, one.n_images) for one in optima} == set(prove.SIZES)
    for one in optima:
        counts = tables.numbered_table(one.n_questions, one.n_images, one.number)
        assert tables.digest(counts) == one.digest
        fitness = Fitness(counts, Objective.S_PLUS)
        assert fitness.terms(one.subset).value == one.value
        assert one.proved == (one.bound - one.value <= 1e-5)
        if one.n_questions == 16:
            *_, exact = enumerate_subsets(counts, Objective.S_PLUS)
            assert (exact.subset, exact.terms.value) == (one.subset, one.value)


def test_the_ways_of_proof_agree_on_random_tables(load):
    """A sample; `python -m benchmarks.agreement` checks a thousand."""
    agreement = load("agreement")
    for seed in range(40):
        case = agreement.draw_case(10_000 + seed, most_questions=11)
        assert not list(agreement.disagreements(case))


def test_all_engines_maximize_the_same_thing(load):
    """On four questions, each finds the one optimum, by its own fitness function."""
    bench, tables = load("search"), load("tables")
    counts = tables.numbered_table(4, 6, 0)
    population = np.array(list(np.ndindex(2, 2, 2, 2)), dtype=np.uint8)
    optimum = Fitness(counts, Objective.S_PLUS)(population).max()
    plan = bench.Plan(settings=SearchSettings(100, 10), n_restarts=4)
    found = [engine(counts, plan, 0) for engine in bench.ENGINES.values()]
    assert found == pytest.approx([optimum] * 3)


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


@pytest.mark.parametrize("table", [9, 40, 41])
def test_tables_on_which_cp_sat_once_went_round_without_end(load, table):
    agreement = load("agreement")
    assert list(agreement.disagreements(agreement.draw_case(table))) == []


def test_the_decision_shows_the_search_that_is_kept(load):
    bench = load("search")
    kept = json.loads((ROOT / "docs" / "search.json").read_text(encoding="utf-8"))
    rows, proof = [bench.Row(**row) for row in kept["rows"]], bench.ProofRow(**kept["proof"])
    text = (ROOT / "docs" / "decisions" / "0008-restarts.md").read_text(encoding="utf-8")
    assert f"{bench.table(rows)}\n{bench.proof_text(proof)}\n" in text
    assert (len(kept["rows"]), proof.n_tables) == (9, bench.FULL.n_proofs)


def test_hit_rates_are_shown_with_their_exact_intervals(load):
    """All of n: the lower end is the rate r whose r^n is 2.5 %."""
    bench = load("search")
    kept = json.loads((ROOT / "docs" / "search.json").read_text(encoding="utf-8"))
    rows = {(row["engine"], row["n_questions"]): bench.Row(**row) for row in kept["rows"]}
    for n_questions, n_tables in ((32, 20), (64, 10)):
        row = rows["default", n_questions]
        assert (row.hit_rate, row.n_proved, row.n_unproved) == (1, n_tables, 0)
        assert bench.hit_interval(row) == f"{100 * 0.025 ** (1 / n_tables):.0f} to 100"
    assert bench.hit_interval(replace(row, hit_rate=None, n_proved=0)) == "–"
    text = (ROOT / "docs" / "decisions" / "0008-restarts.md").read_text(encoding="utf-8")
    assert "10 of 10 tables, which leaves a rate of 69\nto 100 % (exact 95 % interval)" in text


def test_the_decision_names_the_tables_whose_optima_are_kept(load):
    numbers: dict[int, list[int]] = {}
    for one in load("prove_optima").read_optima():
        numbers.setdefault(one.n_questions, []).append(one.number)
    assert numbers == {
        16: list(range(100, 120)),
        32: list(range(100, 120)),
        64: list(range(100, 110)),
    }
    text = (ROOT / "docs" / "decisions" / "0008-restarts.md").read_text(encoding="utf-8")
    assert "100 to 119 with 16 and 32 questions, and with\n64 questions only 100 to 109" in text


def test_the_kept_search_reaches_what_it_should(load):
    """At 64 questions and 20 images: nearly always the optimum, sooner than DEAP, and proved."""
    kept = json.loads((ROOT / "docs" / "search.json").read_text(encoding="utf-8"))
    rows = {row["engine"]: row for row in kept["rows"] if row["n_questions"] == 64}
    assert rows["default"]["hit_rate"] >= 0.95
    assert rows["default"]["seconds"] <= rows["textbook_deap"]["seconds"]
    assert kept["proof"]["images_proved"] == 1
    assert kept["proof"]["median_gap"] <= 0.2
    assert kept["proof"]["seconds_most"] <= 60
