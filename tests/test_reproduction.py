"""The paper's experiments: its tables as published, ours beside them, nothing paid twice."""

import dataclasses
import hashlib
from pathlib import Path

import pytest

from vqa_state.answers import Answer
from vqa_state.embedded.experiments import questions_about
from vqa_state.errors import ProjectError
from vqa_state.models.fake import ScriptedModel
from vqa_state.project import Project
from vqa_state.reproduction.page import write_report
from vqa_state.reproduction.paper import EXPERIMENTS, SUBSETS, paper_tables
from vqa_state.reproduction.running import Finished, copy_projects, run
from vqa_state.reproduction.tables import (
    experiment_frame,
    identity_holds,
    remarks,
    total_frame,
)
from vqa_state.search.genetic import SearchSettings
from vqa_state.splits import Split

SAMPLES = Path(__file__).parent.parent / "projects"
SMALL = SearchSettings(population=30, generations=4)


def by_pixels(image, question):
    seen = hashlib.sha256(image.tobytes() + question.encode()).digest()[0]
    return Answer(("yes", "no", "door")[seen % 5 % 3])


@pytest.fixture
def model():
    return ScriptedModel(by_pixels)


@pytest.fixture
def folders(make_project, tmp_path):
    """Two experiments of the paper's names with small searches."""
    found = []
    for name in ("door", "various_doors"):
        project = make_project(n_train=2, n_test=2)
        project.search, project.name = SMALL, f"<b>{name}</b>"
        project.save()
        target = tmp_path / "copies" / name
        target.parent.mkdir(exist_ok=True)
        project.folder.rename(target)
        found.append(target)
    return found


def finished(folders, model, seed=0):
    steps = list(run(folders, model, seed))
    return [step.progress for step in steps if isinstance(step.progress, Finished)]


class TestPaper:
    def test_has_every_row_of_every_table(self):
        rows = set(zip(paper_tables()["experiment"], paper_tables()["subset"], strict=True))
        assert rows == {(name, subset) for name in EXPERIMENTS for subset in SUBSETS}

    def test_known_totals(self):
        # Added up by hand from the columns of the paper's tables.
        sums = paper_tables().groupby("subset")["n_recognized"].sum()
        assert sums["s+"] == 20 + 20 + 20 + 19 + 76 + 17 + 15 + 20 + 20 + 18 + 17
        assert sums["s_all"] == 20 + 18 + 20 + 17 + 72 + 14 + 10 + 11 + 14 + 14 + 12

    def test_the_papers_identity_holds_in_its_tables(self):
        table = paper_tables().pivot_table("R_invalid", "experiment", "subset")
        means = (table["s_is"] + table["s_does"]) / 2
        assert (table["s_all"] - means).abs().max() < 0.0011  # three printed digits


class TestRun:
    def test_runs_all_and_writes_the_tables(self, folders, model, tmp_path):
        done = finished(folders, model)
        paths = write_report(tmp_path, "a <model>", done)
        assert [path.name for path in paths] == ["tables.csv", "tables.md", "index.html"]
        assert "various doors" in (tmp_path / "tables.md").read_text()
        page = (tmp_path / "index.html").read_text()
        assert "a &lt;model&gt;" in page
        assert "&lt;b&gt;door&lt;/b&gt;" in page
        assert "<b>door" not in page
        assert page.count("<img ") == 2 * 4
        assert "http" not in page

    def test_going_on_asks_nothing_and_searches_nothing_again(self, folders, model, monkeypatch):
        first = finished(folders, model)
        n_asked = len(model.asked)
        monkeypatch.setattr("vqa_state.reproduction.running.optimize", None)
        again = finished(folders, model)
        assert len(model.asked) == n_asked
        assert [one.results.searches for one in again] == [one.results.searches for one in first]

    def test_another_seed_searches_again(self, folders, model):
        finished(folders, model)
        again = finished(folders, model, seed=5)
        assert {one.seed for done in again for one in done.results.searches.values()} == {5}

    def test_a_stop_keeps_the_answers(self, folders, model):
        steps = list(run(folders, model, 0, stop=lambda: len(model.asked) > 0))
        assert not any(isinstance(step.progress, Finished) for step in steps)
        n_before = len(model.asked)
        assert n_before > 0
        done = finished(folders, model)
        n_calls = sum(
            one.results.train.verdicts.size + one.results.test.verdicts.size for one in done
        )
        assert len(model.asked) == n_calls

    def test_a_search_that_was_stopped_is_run_again(self, folders, model):
        list(run(folders, model, 0, stop=stop_at_search(model, folders)))
        done = finished(folders, model)
        assert all(one.finished for each in done for one in each.results.searches.values())


def stop_at_search(model, folders):
    """Stop once the first project's answers are all there."""
    project = Project.open(folders[0])
    n_images = len(project.labelled(Split.TRAIN, Split.TEST))
    n_calls = n_images * project.augmentation.n_copies * len(project.questions())
    calls = []

    def stop():
        calls.append(1)
        return len(model.asked) >= n_calls and len(calls) > 3

    return stop


class TestTables:
    @pytest.fixture
    def found(self, folders, model):
        return {one.project.folder.name: one.results for one in finished(folders, model)}

    def test_every_subset_beside_the_papers(self, found):
        frame = experiment_frame("door", found["door"]).set_index("subset")
        assert list(frame.index) == [*SUBSETS, "best question"]
        assert frame.loc["s_does", "paper_recognized"] == 15
        rows = {row.name.value: row for row in found["door"].evaluation.rows}
        assert frame.loc["s+", "recognized"] == rows["s+"].test.n_recognized
        assert (frame["low"] <= frame["recognized"]).all()
        assert (frame["recognized"] <= frame["high"]).all()

    def test_the_best_question_is_known_for_various_doors_only(self, found):
        of_door = experiment_frame("door", found["door"]).set_index("subset")
        various = experiment_frame("various_doors", found["various_doors"]).set_index("subset")
        assert of_door["paper_recognized"].isna()["best question"]
        assert various.loc["best question", "paper_recognized"] == 72

    def test_totals_add_up(self, found):
        total = total_frame(found).set_index("subset")
        for subset in ("s+", "s-", "s_all"):
            assert total.loc[subset, "recognized"] == sum(
                row.test.n_recognized
                for one in found.values()
                for row in one.evaluation.rows
                if row.name.value == subset
            )
        assert total.loc["s+", "paper_recognized"] == 20 + 76
        assert total.loc["s+", "p_value"] == 1  # against itself

    def test_the_identity_is_checked_on_our_numbers(self, found):
        one = found["door"]
        assert identity_holds(one)
        rows = tuple(
            dataclasses.replace(row, test=dataclasses.replace(row.test, R_invalid=0.9))
            if row.name.value == "s_is"
            else row
            for row in one.evaluation.rows
        )
        evaluation = dataclasses.replace(one.evaluation, rows=rows)
        assert not identity_holds(dataclasses.replace(one, evaluation=evaluation))

    def test_remarks_say_what_holds(self, found):
        assert [type(remark.holds) for remark in remarks(found)] == [bool] * 3


class TestSamples:
    def test_all_eleven_are_there_and_small(self):
        assert {path.parent.name for path in SAMPLES.glob("*/project.json")} >= set(EXPERIMENTS)
        files = [path for name in EXPERIMENTS for path in (SAMPLES / name / "images").iterdir()]
        assert sum(path.stat().st_size for path in files) <= 12e6

    @pytest.mark.parametrize("name", EXPERIMENTS)
    def test_counts_are_the_papers(self, name):
        project = Project.open(SAMPLES / name)
        expected = 40 if name == "various_doors" else 10
        for side in (Split.TRAIN, Split.TEST):
            labels = [image.label for image in project.labelled(side)]
            assert (labels.count(1), labels.count(-1)) == (expected, expected)
        (n_questions,) = set(paper_tables().query("experiment == @name")["n_questions"])
        assert len(project.questions()) == n_questions
        assert project.questions() == questions_about(name)

    @pytest.mark.parametrize("name", EXPERIMENTS)
    def test_no_picture_is_on_both_sides(self, name):
        project = Project.open(SAMPLES / name)
        sides = [
            {image.pixel_hash for image in project.labelled(side)}
            for side in (Split.TRAIN, Split.TEST)
        ]
        assert not sides[0] & sides[1]
        assert project.fingerprint is None
        assert project.test_looks == 0


def test_copies_are_made_once_and_leave_the_samples_alone(tmp_path):
    before = (SAMPLES / "door" / "project.json").read_bytes()
    (folder,) = copy_projects(SAMPLES, tmp_path, ["door"])
    project = Project.open(folder)
    project.name = "changed"
    project.save()
    copy_projects(SAMPLES, tmp_path, ["door"])
    assert Project.open(folder).name == "changed"
    assert (SAMPLES / "door" / "project.json").read_bytes() == before


def test_a_missing_project_is_named(tmp_path):
    with pytest.raises(ProjectError, match="door"):
        copy_projects(tmp_path, tmp_path / "out", ["door"])
