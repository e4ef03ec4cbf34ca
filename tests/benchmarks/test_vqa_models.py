"""The benchmark of models runs, compares what it says it compares, and refuses what differs."""

import importlib
import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def bench():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        yield importlib.import_module("benchmarks.vqa_models")


def test_a_quick_run_writes_its_rows(bench, tmp_path, capsys):
    """Tiny models: all four families, every answer the plain one's."""
    path = tmp_path / "rows.json"
    page = tmp_path / "page.md"
    page.write_text(f"a\n{bench._BEGIN}\nold\n{bench._END}\nb\n", encoding="utf-8")
    threads = torch.get_num_threads()
    bench.main(["--quick", "--jobs", "1", "--json", str(path), "--page", str(page)])
    assert torch.get_num_threads() == threads
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"]
    assert sorted(row["family"] for row in rows) == ["blip", "chat", "ofa", "vilt"]
    for row in rows:
        assert (row["n_questions"], row["n_unequal"]) == (16, 0)
        assert row["difference"] < 1e-4
        assert row["ratio"] == pytest.approx(row["plain_seconds"] / row["our_seconds"], rel=0.02)
        assert row["identical"] == (row["n_answers"] >= 8)
        assert row["family"] == "vilt" or row["identical"]  # a tiny ViLT knows few labels
    written = page.read_text(encoding="utf-8")
    assert written == f"a\n{bench._BEGIN}\n{bench.table(rows)}{bench._END}\nb\n"
    assert capsys.readouterr().out.count("times faster") == 4


def rows_of(bench, plain, ours):
    family = bench._FAMILIES[0]
    return bench._row(family, plain, ours, 10.0, 2.0)


def asked(bench, n, different=8):
    logits = torch.zeros(5)
    return [bench.Asked((number % different,), logits) for number in range(n)]


def test_identical_means_all_three(bench):
    plain = asked(bench, 16)
    assert rows_of(bench, plain, plain).identical
    assert rows_of(bench, plain, plain).ratio == 5
    few = asked(bench, 16, different=7)
    assert not rows_of(bench, few, few).identical
    other = [*plain[:-1], replace(plain[-1], answer=(99,))]
    assert (rows_of(bench, plain, other).n_unequal, rows_of(bench, plain, other).identical) == (
        1,
        False,
    )
    off = [*plain[:-1], replace(plain[-1], logits=torch.full((5,), 2e-4))]
    assert not rows_of(bench, plain, off).identical


def test_the_table_of_the_page_is_that_of_the_committed_run(bench):
    found = json.loads((ROOT / "docs" / "vqa_models.json").read_text(encoding="utf-8"))
    assert not found["quick"]
    assert bench.table(found["rows"]) in (ROOT / "docs" / "models.md").read_text(encoding="utf-8")
    assert {row["family"] for row in found["rows"]} == {"blip", "chat", "vilt", "ofa"}
    assert all(row["identical"] for row in found["rows"])
