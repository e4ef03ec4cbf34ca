"""The user's own subsets beside the frontier: true, deaf to the test, readable."""

import re
from html import unescape

import numpy as np
import pytest
from tuned_project import tuned_copy

from vqa_state.answers.rates import count
from vqa_state.evaluation.cost_frontier import FrontierPoint, search_frontier
from vqa_state.project.split import Split
from vqa_state.report.plots import frontier_plot
from vqa_state.study.frontier_marks import MarkedPoint, cheaper_sentence, marked_points
from vqa_state.study.optimize import results


@pytest.fixture
def tuned(make_project, tmp_path):
    return tuned_copy(make_project, tmp_path)


def test_they_are_what_the_training_answers_say(tuned):
    """Counted one answer at a time, the paper's way."""
    found = results(tuned)
    marks = marked_points(found)
    names = sorted(name for mark in marks for name in mark.names)
    assert names == sorted(["s+", "s'+", "s-", "s'-", "s_all", "best question"])
    subset_of = {row.name.value: row.subset for row in found.evaluation.rows}
    train = found.train
    for mark in marks:
        point = mark.point
        assert {tuple(sorted(subset_of[name])) for name in mark.names} == {point.subset}
        n_right = 0
        for verdicts, label in zip(train.verdicts, train.labels, strict=True):
            votes = [int(v) for copy in verdicts for v in copy[list(point.subset)]]
            n_right += votes.count(int(label)) > votes.count(-int(label))
        assert (point.n_recognized, point.n_images) == (n_right, 8)
        assert point.n_calls == point.n_questions * 2 == 2 * len(point.subset)
        assert f"{n_right} of 8 training images" in mark.says
    assert len({mark.point.subset for mark in marks}) == len(marks)
    calls = [mark.point.n_calls for mark in marks]
    assert calls == sorted(calls)


def test_the_test_images_move_none(tuned):
    before = marked_points(results(tuned))
    for image in tuned.labelled(Split.TEST):
        tuned.set_labels([image.id], -image.label)
    assert marked_points(results(tuned)) == before


@pytest.mark.parametrize(
    ("recognized", "said"),
    [
        ((20, 20, 20), "s- recognizes as many training images as s+ with 1 question instead of 9."),
        ((18, 20, 20), "s_x recognizes as many training images as s+ with 4 questions instead"),
        ((18, 21, 20), "s_x recognizes 1 more with 4 questions instead of 9."),
        ((19, 19, 20), ""),
    ],
)
def test_a_cheaper_one_is_named_if_it_recognizes_as_many(recognized, said):
    marks = [
        MarkedPoint((name,), FrontierPoint(n, 6 * n, tuple(range(n)), right, 22, 0.9))
        for name, n, right in zip(("s-", "s_x", "s+"), (1, 4, 9), recognized, strict=True)
    ]
    sentence = cheaper_sentence(marks, "s+")
    assert sentence.startswith(said)
    assert bool(sentence) == bool(said)


def test_the_picture_shows_each_with_its_name(tuned):
    found = results(tuned)
    *_, last = search_frontier(count(found.train))
    marks = marked_points(found)
    picture = frontier_plot(last.points, marks)
    assert picture.count('class="dot"') == len(last.points)
    assert picture.count('z" class="own"') == len(marks)
    for mark in marks:
        assert mark.says.replace("'", "&#x27;") in picture
    assert "stopped" in frontier_plot((), marks)


def boxes(picture):
    """Left, right and base line of every label."""
    found = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" class="own">([^<]*)<', picture)
    return [(float(x), float(x) + 6.5 * len(unescape(words)), float(y)) for x, y, words in found]


@pytest.mark.parametrize("seed", range(20))
def test_labels_do_not_cover_each_other_or_leave_the_picture(seed):
    rng = np.random.default_rng(seed)
    names = ["s+", "s'+", "s-", "s'-", "s_all", "best one"]
    marks = []
    for name, size in zip(names, sorted(rng.integers(1, 65, 6).tolist()), strict=True):
        recognized = int(rng.integers(17, 21))
        point = FrontierPoint(size, 6 * size, tuple(range(size)), recognized, 20, 0.9)
        marks.append(MarkedPoint((name,), point))
    picture = frontier_plot([marks[-1].point], marks)
    labels = boxes(picture)
    for number, (left, right, base) in enumerate(labels):
        assert left >= 0
        assert right <= 700
        assert base <= 300
        for other_left, other_right, other_base in labels[:number]:
            apart = right <= other_left or other_right <= left or abs(base - other_base) >= 12
            assert apart
