"""The model card says what was measured, in tables and in sentences, and no kinder."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from vqa_state.answers.table import AnswerTable
from vqa_state.embedded_training import out_of_distribution
from vqa_state.embedded_training.card import MARKS, failures, points, tables, with_tables
from vqa_state.embedded_training.dataset import Example
from vqa_state.embedded_training.evaluate import as_json, former_speed
from vqa_state.embedded_training.experiments import questions_about
from vqa_state.embedded_training.intervals import Tally, balanced_interval
from vqa_state.embedded_training.lexicon import lexicon
from vqa_state.embedded_training.measurement_cache import AnswerCache
from vqa_state.embedded_training.measuring import WAYS
from vqa_state.embedded_training.scenes import PAPER_THINGS
from vqa_state.errors import ProjectError
from vqa_state.models.embedded.weights import weights_digest
from vqa_state.questions.grid import Question

ROOT = Path(__file__).parent.parent.parent
CARD = (ROOT / "docs" / "embedded_model.md").read_text("utf-8")
README = (ROOT / "README.md").read_text("utf-8")


@pytest.fixture
def numbers():
    return json.loads((ROOT / "docs" / "embedded_model.json").read_text("utf-8"))


class TestShipped:
    def test_says_what_was_measured(self, numbers):
        assert with_tables(CARD, numbers) == CARD

    def test_is_about_the_shipped_weights(self, numbers):
        assert numbers["file"]["digest"] == weights_digest()
        scenes = {row["name"] for row in numbers["tasks"] if row["group"] == "scenes"}
        assert scenes == set(PAPER_THINGS)

    def test_every_accuracy_has_its_interval_and_comes_from_its_pictures(self, numbers):
        for row in numbers["tasks"]:
            tally = Tally(**row["tally"])
            assert len(tally.labels) == row["n_positive"] + row["n_negative"]
            for way in WAYS:
                if row[way] is not None:
                    assert row[way] == pytest.approx(tally.balanced(way), abs=1e-4)
                    assert row["intervals"][way] == balanced_interval(tally, way)

    def test_every_pair_of_things_without_common_questions_is_measured(self, numbers):
        asked = {(row["shown"], other) for row in numbers["premises"] for other in row["refused"]}
        things = set(PAPER_THINGS)
        assert asked == {(a, b) for a in things for b in things if lexicon().is_unfit(a, b)}

    def test_readme_says_that_asking_all_was_better_on_photos(self, numbers):
        one = numbers["groups"]["photos"]
        low, high = one["gains"]["over_all"]["pictures"]
        figures = [
            f"{100 * one['means']['s_plus']['mean']:.1f} %",
            f"{100 * one['means']['s_all']['mean']:.1f} %",
            f"{points(low)} to {points(high)}",
        ]
        sentence = next(
            found for found in re.findall(r"[^.|]+(?:\.\d[^.|]+)*\.", README) if figures[0] in found
        )
        plain = " ".join(sentence.split())
        assert [figure for figure in figures if figure not in plain] == []
        assert one["gains"]["over_all"]["mean"] < 0


class TestMarks:
    @pytest.mark.parametrize("part", sorted(MARKS))
    def test_are_needed(self, part):
        with pytest.raises(ValueError, match="must hold"):
            with_tables(CARD.replace(MARKS[part][1], ""), json.loads(NUMBERS))

    def test_what_stands_around_them_stays(self):
        begins = {part: f"before {part} {begin} old {end} " for part, (begin, end) in MARKS.items()}
        card = with_tables("".join(begins.values()) + "after", json.loads(NUMBERS))
        assert card.startswith("before measured <!--")
        assert card.endswith("after")
        assert " old " not in card


NUMBERS = (ROOT / "docs" / "embedded_model.json").read_text("utf-8")


def gain(mean, pictures, tasks=None):
    return {"mean": mean, "pictures": pictures, "tasks": tasks, "n_tasks": 3, "n_pictures": 9}


def changed(numbers, group, mean, pictures, tasks=None):
    numbers["groups"][group]["gains"]["over_all"] = gain(mean, pictures, tasks)
    return failures(numbers)


class TestWords:
    @pytest.mark.parametrize(
        ("mean", "pictures", "tasks", "words"),
        [
            (-0.02, [-0.03, -0.01], [-0.03, -0.01], "loses against"),
            (-0.02, [-0.03, 0.01], [-0.03, -0.01], "loses, perhaps by chance, against"),
            (0.02, [0.01, 0.03], [-0.01, 0.03], "gains, perhaps by chance, against"),
            (0.02, [0.01, 0.03], None, "gains against"),
            (0.0001, [-0.01, 0.01], None, "neither gains nor loses against"),
        ],
    )
    def test_of_the_search_have_the_sign_of_the_gain(self, numbers, mean, pictures, tasks, words):
        said = changed(numbers, "scenes", mean, pictures, tasks)
        assert f"On scenes of the measuring split the search {words}" in said

    def test_say_plainly_that_all_questions_were_better_where_they_were(self, numbers):
        said = "Asking all questions of the grid was better there"
        for row in numbers["tasks"]:
            if row["group"] == "photos" and row["s_plus"] is not None:
                row["s_plus"], row["s_all"] = 0.7, 0.8
        assert said in failures(numbers)
        for row in numbers["tasks"]:
            if row["group"] == "photos" and row["s_plus"] is not None:
                row["s_plus"], row["s_all"] = 0.8, 0.7
        assert said not in failures(numbers)

    def test_of_leans_name_the_share_of_each_task(self, numbers):
        for row in numbers["tasks"]:
            row["called_positive"] = 0.5
        assert "Leans" not in failures(numbers)
        numbers["tasks"][0]["called_positive"] = 0.867
        numbers["tasks"][1]["called_positive"] = 0.25
        said = failures(numbers)
        assert "positive, weighed so that half would be right: 86.7 % (scenes: door)" in said
        assert "negative, weighed so that half would be right: 75.0 % (scenes: elevator)" in said

    def test_of_what_is_left_of_the_lean_count_the_tested_pictures(self, numbers):
        row = next(row for row in numbers["tasks"] if row["group"] == "foreign")
        ways = {
            "s_all": [2, 2, 0, 0],  # all called positive
            "s_plus_random": [1, 1, 2, 2],  # a quarter
            "s_plus": [2, 2, 2, 2],  # as they are
        }
        tally = {"labels": [1, 1, -1, -1], "tested": [2] * 4, "recognized": ways}
        numbers["tasks"] = [row | {"tally": tally}]
        said = "50.0 points with the whole grid, 25.0 with s+ from a random start, 0.0 with s+."
        assert f"on other people's simulators (1 task) {said}" in failures(numbers)
        numbers["tasks"] = [row | {"s_plus": None}]
        assert "The lean before" not in failures(numbers)

    def test_of_false_premises_name_the_picture_first_and_the_worst_pair_first(self, numbers):
        numbers["premises"] = [
            {"shown": "display", "n_pictures": 20, "refused": {"light": 0.01, "water": 0.21}},
            {"shown": "water", "n_pictures": 20, "refused": {"light": 0.98}},
        ]
        said = failures(numbers)
        assert "display asked about light (1 %), display asked about water (21 %)." in said
        assert "40.0 % on average over 3 pairs" in said
        table = tables(numbers)
        assert "| display | 1 | 21 |" in table
        assert "| water | 98 | – |" in table

    def test_of_new_nouns_name_the_worst(self, numbers):
        worst = numbers["nouns"][-1] | {"nouns": ["mug", "jar"], "balanced": 0.25}
        numbers["nouns"].append(worst | {"interval": [0.2, 0.3], "thing": "box_lid"})
        said = 'box lid as "mug", "jar": 25.0 % (95 % interval 20.0 % to 30.0 %)'
        assert said in failures(numbers)

    def test_an_unrecorded_training_time_is_said_to_be_so(self, numbers):
        numbers["file"]["training"].pop("seconds", None)
        assert "Training time: not recorded for the shipped weights." in tables(numbers)
        numbers["file"]["training"] |= {"seconds": "3600", "seconds_before": "600"}
        assert "Training time: 60 minutes, after 10 for scenes and features." in tables(numbers)

    def test_a_time_that_was_not_taken_is_said_to_be_so(self, numbers):
        numbers["speed"] = None
        assert "64 questions each: not measured." in tables(numbers)

    def test_a_thing_without_wholly_new_nouns_is_said_to_have_none(self, numbers):
        numbers["nouns"] = [row for row in numbers["nouns"] if not row["is_new"]]
        assert "| door | none | – | front door |" in tables(numbers)


class TestKept:
    def test_the_time_of_an_idle_machine_stays_for_the_same_weights(self, tmp_path):
        file = tmp_path / "numbers.json"
        assert former_speed(None, "w") is former_speed(file, "w") is None
        speed = {"seconds_120x64": 4.9, "threads": 2, "date": "2026-11-26"}
        file.write_text(json.dumps({"file": {"digest": "w"}, "speed": speed}), "utf-8")
        assert former_speed(file, "w") == speed
        assert former_speed(file, "other") is None

    def test_json_keeps_lists_of_numbers_on_a_line(self):
        numbers = {"a": [1, 2.5, None], "b": [[1, 2], {"c": []}], "d": "x"}
        text = as_json(numbers)
        assert json.loads(text) == numbers
        assert '"a": [1, 2.5, null]' in text


class CountingPredictor:
    """Says "yes" to whatever holds the word "open", and counts how often it is asked."""

    def __init__(self):
        self.n_asked = 0

    def read(self, questions):
        return list(questions)

    def answer(self, images, questions):
        self.n_asked += 1
        return [[("yes", 0.9) if "open" in q else ("none", 0.5) for q in questions] for _ in images]


@pytest.fixture
def pictures(tmp_path):
    made = []
    for n in range(4):
        path = tmp_path / f"{n}.png"
        Image.new("RGB", (8, 8), (50 * n, 0, 0)).save(path)
        made.append(Example(path, "door", n % 2 == 0, {}, f"door/{n}"))
    return made


@pytest.fixture
def asker(tmp_path):
    return AnswerCache(CountingPredictor(), "w", tmp_path / "answers")


QUESTIONS = (Question("Is it open?", 1), Question("Is it red?", 1))


def same(one: AnswerTable, other: AnswerTable) -> bool:
    names = ("verdicts", "p_positive", "labels")
    return all((getattr(one, name) == getattr(other, name)).all() for name in names)


class TestAnswerCache:
    def test_asks_once(self, asker, pictures):
        first = asker.ask(pictures, QUESTIONS)
        assert asker.predictor.n_asked == len(pictures)
        assert same(asker.ask(pictures, QUESTIONS), first)
        assert asker.predictor.n_asked == len(pictures)
        assert (first.verdicts[..., 0] == 1).all()
        assert (first.verdicts[..., 1] == 0).all()

    def test_asks_again_about_other_pixels_other_questions_and_other_weights(self, asker, pictures):
        asker.ask(pictures, QUESTIONS)
        asker.ask(pictures, QUESTIONS[::-1])
        asker.ask(pictures, (Question("Is it open?", -1), QUESTIONS[1]))
        AnswerCache(asker.predictor, "v", asker.folder).ask(pictures, QUESTIONS)
        Image.new("RGB", (8, 8), "white").save(pictures[0].path)
        asker.ask(pictures, QUESTIONS)
        assert asker.predictor.n_asked == 5 * len(pictures)

    def test_half_a_file_is_not_left_behind(self, asker, pictures, monkeypatch):
        def fail(*_):
            raise OSError("the disk is full")

        monkeypatch.setattr(Path, "replace", fail)
        with pytest.raises(ProjectError, match="disk is full"):
            asker.ask(pictures, QUESTIONS)
        assert list(asker.folder.iterdir()) == []


class TestOutOfDistribution:
    def test_doors_of_all_kinds_fit_each_other(self):
        assert lexicon().is_unfit("light", "display")
        assert lexicon().is_unfit("door", "water")
        assert lexicon().is_unfit("water", "door")
        assert not lexicon().is_unfit("door", "microwave")
        assert not lexicon().is_unfit("light", "light")

    def test_each_pair_is_counted_by_the_questions_of_what_is_asked(self, asker, pictures):
        found = out_of_distribution.measure_premises(
            asker, "light", pictures, ("light", "door", "water", "display")
        )
        assert found == {
            "shown": "light",
            "n_pictures": 4,
            # Whether the word "open" is in it decides; of a door's questions half have it.
            "refused": {"door": refused("door"), "water": 1.0, "display": 1.0},
        }

    def test_new_nouns_and_shared_ones_are_measured_apart(self, pictures):
        def ask(shown, questions):
            right = all("front" not in question.text for question in questions)
            verdicts = np.ones((len(shown), 1, len(questions)), np.int8)
            labels = np.array([1 if one.is_positive else -1 for one in shown], np.int8)
            verdicts *= labels[:, None, None] if right else 1
            p = np.full(verdicts.shape, 0.5, np.float32)
            names = tuple(str(one.path) for one in shown)
            return AnswerTable(names, questions, verdicts, p, labels)

        new, shared = out_of_distribution.measure_nouns(SimpleNamespace(ask=ask), "door", pictures)
        assert (new["is_new"], new["nouns"], new["balanced"]) == (True, ["exit", "hatch"], 1.0)
        assert (shared["is_new"], shared["nouns"]) == (False, ["front door"])
        assert shared["balanced"] == 0.5
        assert shared["interval"][0] < 0.5 < shared["interval"][1]


def refused(thing):
    texts = [question.text for question in questions_about(thing)]
    return round(float(np.mean(["open" not in text for text in texts])), 4)
