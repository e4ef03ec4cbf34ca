"""The paper's experiments: its tables as published, ours beside them, nothing paid twice."""

import dataclasses
import hashlib
import shutil
from pathlib import Path

import pytest
from pictures import picture
from scipy.stats import binomtest

from vqa_state.answers.answer import Answer
from vqa_state.cli import reproducing
from vqa_state.embedded_training.experiments import questions_about
from vqa_state.errors import ProjectError
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.questions.grid import Form
from vqa_state.reproduction.page import write_report
from vqa_state.reproduction.paper import EXPERIMENTS, REPEATED, SUBSETS, paper_tables
from vqa_state.reproduction.running import Finished, copy_projects, run
from vqa_state.reproduction.tables import (
    Finding,
    experiment_frame,
    identity_holds,
    remarks,
    shown,
    total_frame,
)
from vqa_state.search.engines import Engine
from vqa_state.search.genetic import SearchSettings
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.votes.rules import VoteKind

SAMPLES = Path(__file__).parent.parent.parent / "projects"
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
        text = (tmp_path / "tables.md").read_text()
        assert "they count twice in `recognized` of `images`" in text
        assert "- Cannot be told from luck here: `is` questions" in text
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

    def test_statistics_count_each_picture_once(self, found):
        """Various doors shows the pictures of other experiments: it adds to the counts alone."""
        total, alone = total_frame(found), total_frame({"door": found["door"]})
        once = ["distinct", "distinct_images", "low", "high", "only_s_plus", "only_this", "p_value"]
        assert total[once].equals(alone[once])
        assert (alone["distinct"] == alone["recognized"]).all()
        assert list(total["images"]) == [8] * 4
        assert list(total["distinct_images"]) == [4] * 4
        exact = binomtest(int(alone["distinct"][0]), 4).proportion_ci(0.95, "exact")
        assert total["low"][0] == round(4 * exact.low, 1)
        assert total["high"][0] == round(4 * exact.high, 1)

    def test_a_person_reads_no_nan_and_no_whole_number_with_a_point(self, found):
        cells = {cell for row in shown(total_frame(found)).itertuples(index=False) for cell in row}
        assert all(isinstance(cell, str) for cell in cells)
        assert "–" in cells  # the paper's best single questions
        assert not [cell for cell in cells if cell == "nan" or cell.endswith(".0")]

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

    def test_a_remark_says_if_it_cannot_be_told_from_luck(self, found):
        """One experiment with pictures of its own tells nothing, whatever its rates are."""
        of_invalid, of_accuracy, of_wording = remarks(found)
        assert of_invalid.finding is of_accuracy.finding is Finding.LUCK
        assert "of 1 experiments" in of_accuracy.numbers
        assert "p = 1.000" in of_accuracy.sentence
        assert of_accuracy.sentence.startswith("Cannot be told from luck here: `is` questions")
        assert of_wording.finding is Finding.NOT_ASKED

    @pytest.mark.parametrize(
        ("n_more", "n_less", "finding", "p"),
        [
            (3, 4, Finding.LUCK, "1.000"),
            (5, 0, Finding.LUCK, "0.062"),  # 2 / 2^5
            (6, 0, Finding.HOLDS, "0.031"),  # 2 / 2^6
            (0, 6, Finding.DOES_NOT_HOLD, "0.031"),
            (9, 1, Finding.HOLDS, "0.021"),  # 2 (1 + 10) / 2^10
            (8, 2, Finding.LUCK, "0.109"),  # 2 (1 + 10 + 45) / 2^10
            (0, 0, Finding.LUCK, "1.000"),
        ],
    )
    def test_the_sign_test_decides(self, found, n_more, n_less, finding, p):
        rates = [(0.2, 0.1)] * n_more + [(0.1, 0.2)] * n_less + [(0.1, 0.1)] * 3
        named = {
            f"{number}": with_rates(found["door"], *pair) for number, pair in enumerate(rates)
        } | {"various_doors": with_rates(found["door"], 0.9, 0.0)}  # it is not asked
        remark = remarks(named)[0]
        assert remark.finding is finding
        n = len(rates)
        assert f"p = {p}, two-sided sign test; higher for `is` in {n_more} of {n}" in remark.numbers
        assert f"lower in {n_less}, equal in 3" in remark.numbers


def with_rates(found, of_is, of_does):
    """The same results with other shares of Invalid answers."""
    rates = {"s_is": of_is, "s_does": of_does}
    rows = tuple(
        dataclasses.replace(
            row,
            test=dataclasses.replace(
                row.test, R_invalid=rates.get(row.name.value, row.test.R_invalid)
            ),
        )
        for row in found.evaluation.rows
    )
    return dataclasses.replace(found, evaluation=dataclasses.replace(found.evaluation, rows=rows))


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

    def test_various_doors_alone_shows_pictures_of_others(self):
        tested = {
            name: {image.id for image in Project.open(SAMPLES / name).labelled(Split.TEST)}
            for name in EXPERIMENTS
        }
        doors = [tested[name] for name in ("door", "elevator", "cabinet", "refrigerator")]
        assert tested.pop(REPEATED) == set().union(*doors)
        assert len(set().union(*tested.values())) == sum(map(len, tested.values())) == 200

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


@pytest.fixture
def copied(tmp_path):
    """A sample and a finished-looking copy of it: what a run sets itself is not the sample's."""
    source = tmp_path / "samples"
    for name in ("door", "light"):
        shutil.copytree(SAMPLES / name, source / name)
    folder, _ = copy_projects(source, tmp_path / "out", ["door", "light"])
    project = Project.open(folder)
    project.model, project.fingerprint, project.search_seed = "other", "f", 3
    project.engine, project.test_looks, project.vote = Engine.PAPER, 2, VoteKind.THRESHOLD
    project.save()
    return source, tmp_path / "out"


def test_a_copy_of_the_same_is_kept_and_the_samples_are_left_alone(copied):
    source, out = copied
    before = (source / "door" / "project.json").read_bytes()
    folder, _ = copy_projects(source, out, ["door", "light"])
    assert Project.open(folder).test_looks == 2
    assert (source / "door" / "project.json").read_bytes() == before


def renamed(project):
    project.name = "refrigerator"


def with_another_image(project):
    project.add(picture(5), "5.png", 1)


def with_another_label(project):
    project.set_labels([next(iter(project.images))], None)


def with_another_side(project):
    project.set_splits([next(iter(project.images))], Split.UNUSED)


def with_another_grid(project):
    project.grid = dataclasses.replace(project.grid, forms=(Form.IS,))


def with_fewer_copies(project):
    project.augmentation = dataclasses.replace(project.augmentation, n_copies=1)


@pytest.mark.parametrize(
    ("change", "differs"),
    [
        (renamed, "name"),
        (with_another_image, "images"),
        (with_another_label, "images"),
        (with_another_side, "images"),
        (with_another_grid, "grid"),
        (with_fewer_copies, "augmentation"),
    ],
)
@pytest.mark.parametrize("where", ["copy", "sample"])
def test_another_project_or_a_stale_copy_is_refused_and_left_as_it_is(
    copied, change, differs, where
):
    source, out = copied
    project = Project.open((source if where == "sample" else out) / "door")
    change(project)
    project.save()
    shutil.rmtree(out / "light")
    before = (out / "door" / "project.json").read_bytes()
    with pytest.raises(
        ProjectError, match=f"{differs} differ. .* choose another folder with --out"
    ):
        copy_projects(source, out, ["light", "door"])
    assert (out / "door" / "project.json").read_bytes() == before
    assert not (out / "light").exists()  # all is looked at before anything is copied


def test_the_folder_of_the_samples_is_refused(copied, monkeypatch):
    source, out = copied
    monkeypatch.chdir(source)
    for place in (source, source / "mine", Path(), source / "door" / ".."):
        with pytest.raises(ProjectError, match="folder of the samples"):
            copy_projects(source, place, ["door"])
    shutil.rmtree(out / "door")
    (out / "door").symlink_to(source / "door")
    with pytest.raises(ProjectError, match="folder of the samples"):
        copy_projects(source, out, ["door"])


def test_a_missing_project_is_named(tmp_path):
    with pytest.raises(ProjectError, match="door"):
        copy_projects(tmp_path / "samples", tmp_path / "out", ["door"])


def test_the_command_prints_a_table_to_read(run, make_project, tmp_path, registry, monkeypatch):
    for name in ("door", "various_doors"):
        project = make_project(f"samples/{name}", n_train=2, n_test=2)
        project.search = SMALL
        project.save()
    registry["pixels"] = lambda: ScriptedModel(by_pixels)
    monkeypatch.setattr(reproducing, "EXPERIMENTS", ("door", "various_doors"))
    where = ["--out", tmp_path / "out", "--projects", tmp_path / "samples", "--model", "pixels"]
    code, out, err = run("reproduce", *where)
    assert code == 0
    assert "96" in out.split()  # of the paper's 20 + 80 images, not "96.0"
    assert "nan" not in out
    assert "count each picture once: without various doors" in " ".join(err.split())
    code, _, err = run("reproduce", "--out", tmp_path / "samples", *where[2:])
    assert (code, "folder of the samples" in " ".join(err.split())) == (1, True)
