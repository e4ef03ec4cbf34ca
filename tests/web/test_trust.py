"""What a recognizer is worth, as the app shows it: assess, keep the report, take an engine."""

import re
import threading
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
from stand_ins import finished, picture
from starlette.testclient import TestClient

from vqa_state.errors import NothingToSearchError, ProjectError, VQAStateError
from vqa_state.project.split import Split
from vqa_state.search.engines import Engine
from vqa_state.search.objectives import Objective
from vqa_state.study.assess import assess as assess_project
from vqa_state.web import job_watcher
from vqa_state.web.arguments import RequestError
from vqa_state.web.jobs import JobState
from vqa_state.web.recognizer_choice import found_and_assessed
from vqa_state.web.security import LocalGuard
from vqa_state.web.server import build_api
from vqa_state.web.session import Desk
from vqa_state.web.tabs import optimize
from vqa_state.web.tabs.recognizer import tab as recognizer
from vqa_state.web.tabs.results import details, leaderboard
from vqa_state.web.tabs.results.galleries import choose_row

STRANGE: list[Any] = [None, "text", [], {}, True, float("nan"), float("inf"), 1e300, -1, 0]
RESAMPLES = 6


class Colours:
    """A quick image network: the mean of each channel."""

    n_features = 3
    fingerprint = "colours/1"

    def __call__(self, images: Any) -> Iterator[Any]:
        for image in images:
            yield np.asarray(image, np.float32).reshape(-1, 3).mean(axis=0)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few resamples, and a rival without a network."""
    quickly = partial(assess_project, features=Colours, n_resamples=RESAMPLES)
    monkeypatch.setattr(leaderboard, "assess", quickly)


@pytest.fixture
def client(desk: Desk) -> TestClient:
    return TestClient(LocalGuard(build_api(desk)), base_url="http://127.0.0.1")


ended = partial(finished, kind=leaderboard.KIND)


@pytest.fixture
def assessed(desk: Desk, optimized: str) -> str:
    leaderboard.start(desk, optimized)
    assert ended(desk, optimized).state is JobState.DONE
    return optimized


BOARD = (
    "advice", "use", "table", "look", "sentences", "looked", "test_missed", "buys", "frontier",
    "curve", "labels", "doubtful", "following", "link",
)  # fmt: skip


def shown(desk: Desk, pid: str) -> dict[str, Any]:
    """What the board shows, by name."""
    return dict(zip(BOARD, leaderboard.board(desk, pid), strict=True))


# ---- assess --------------------------------------------------------------------------------


def test_assessing_fills_the_board(desk: Desk, assessed: str) -> None:
    _, _, _, *values = leaderboard.view(desk, assessed, ended(desk, assessed))
    board = dict(zip(BOARD, values, strict=True))
    advice, use, table = board["advice"], board["use"], board["table"]
    frontier, curve, link = board["frontier"], board["curve"], board["link"]
    assert board["buys"].visible
    assert advice["text"].startswith("Recommended: the vote by")
    assert use.visible
    headers, rows = table.value["headers"], table.value["data"]
    assert "out of bag" in headers
    assert not [name for name in headers if name.startswith("test")]
    assert {row[0].removesuffix(" ★") for row in rows} >= {"s+", "s-", "trained image classifier"}
    assert sum(row[0].endswith("★") for row in rows) == 1
    assert [one["x"] for one in frontier["points"]] == sorted(
        one["x"] for one in frontier["points"]
    )
    assert all(one["low"] <= one["y"] <= one["high"] for one in curve["points"])
    assert link["link"]["href"] == f"/projects/{assessed}/report.html"
    assert desk.snapshot(assessed).test_looks == 0


def test_the_board_is_there_after_a_restart(desk: Desk, assessed: str) -> None:
    fresh = Desk(desk.root)
    _, _, _, advice, *_ = leaderboard.view(fresh, assessed, None)
    assert "Recommended" in advice["text"]


def test_a_frontier_point_is_what_it_says(desk: Desk, assessed: str) -> None:
    frontier = shown(desk, assessed)["frontier"]
    found, kept = found_and_assessed(desk.snapshot(assessed))
    assert found is not None
    assert kept is not None
    known = {question.text for question in found.train.questions}
    marked = [one for one in frontier["points"] if one.get("marked")]
    assert {name for one in marked for name in one["says"].split(":")[0].split(", ")} == {
        *Objective, "s_all", "best question"
    }  # fmt: skip
    line = [one for one in frontier["points"] if not one.get("marked")]
    for one, point in zip(line, kept.frontier, strict=True):
        assert set(one["lines"]) <= known
        assert len(one["lines"]) * found.train.n_copies == one["x"] == point.n_calls


def test_a_running_job_says_how_long_and_leaves_the_board(
    desk: Desk, optimized: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    reached, opened = threading.Event(), threading.Event()

    def slowly(project: Any, stop: Any) -> Iterator[Any]:
        for number, step in enumerate(
            assess_project(project, stop, features=Colours, n_resamples=RESAMPLES)
        ):
            if number == 3:
                reached.set()
                assert opened.wait(60)
            yield step

    monkeypatch.setattr(leaderboard, "assess", slowly)
    leaderboard.start(desk, optimized)
    assert reached.wait(60)
    job = desk.jobs.get(optimized, leaderboard.KIND)
    assert job is not None
    said, start, stop, *board = leaderboard.view(desk, optimized, job.snapshot)
    assert re.search(r"3 of 6, about .* left of this step", said["text"])
    assert (start.interactive, stop.interactive) == (False, True)
    assert len(board) == leaderboard.N_SHOWN
    job_watcher.Watch(leaderboard.KIND, leaderboard.view).stop(desk, optimized)
    assert "Stopping" in leaderboard.view(desk, optimized, job.snapshot)[0]["text"]
    opened.set()
    assert job.join(60).state is JobState.STOPPED
    _, _, _, advice, *_ = leaderboard.view(desk, optimized, job.snapshot)
    assert "was stopped after" in advice["text"]


def test_without_results_there_is_nothing_to_assess(desk: Desk, pid: str) -> None:
    leaderboard.start(desk, pid)
    snapshot = ended(desk, pid)
    said, *_ = leaderboard.view(desk, pid, snapshot)
    board = shown(desk, pid)
    assert said["tone"] == "bad"
    assert board["advice"]["text"] == ""
    assert "Optimize first" in board["frontier"]["empty"]
    assert not any(board[name].visible for name in ("use", "table", "buys", "labels"))
    assert not board["look"].interactive
    for handler in (leaderboard.use, leaderboard.look):
        with pytest.raises(VQAStateError):
            handler(desk, pid)
    assert desk.snapshot(pid).test_looks == 0


def test_before_assessing_the_table_says_so(desk: Desk, optimized: str) -> None:
    board = shown(desk, optimized)
    assert "Not assessed yet" in board["advice"]["text"]
    assert board["table"].visible
    assert not board["use"].visible
    assert not board["buys"].visible
    headers, rows = board["table"].value["headers"], board["table"].value["data"]
    assert {row[0] for row in rows} >= {*Objective, "s_all", "s_is", "s_does", "best question"}
    train, out = headers.index("train"), headers.index("out of bag")
    assert all(" of " in row[train] and row[out] == "–" for row in rows)


def test_changed_labels_make_it_stale(desk: Desk, assessed: str) -> None:
    with desk.changing(assessed) as project:
        project.set_labels([project.labelled(Split.TRAIN)[0].id], None)
    assert not shown(desk, assessed)["use"].visible
    with pytest.raises(NothingToSearchError):
        leaderboard.use(desk, assessed)


def test_test_images_are_shown_only_after_a_counted_look(desk: Desk, assessed: str) -> None:
    before = shown(desk, assessed)
    assert "not yet looked at" in before["look"].value
    assert (before["sentences"]["text"], before["looked"]) == ("", "")
    button, table, said, looked = leaderboard.look(desk, assessed)
    assert "looked at once" in button.value
    assert "trained image classifier" in said["text"]
    assert "test, positive" in table.value["headers"]
    assert table.value["headers"][:4] == ["recognizer", "train", "out of bag", "test"]
    assert Desk(desk.root).snapshot(assessed).test_looks == 1
    assert choose_row(desk, assessed, {"row_value": ["s_all"]}, looked)[1]["title"]


def test_what_hides_the_test_columns_hides_all_that_a_look_showed(
    desk: Desk, assessed: str
) -> None:
    """The digest too: so a row chosen afterwards shows no test image."""
    leaderboard.look(desk, assessed)
    after = shown(desk, assessed)
    assert not [name for name in after["table"].value["headers"] if name.startswith("test")]
    assert (after["sentences"]["text"], after["looked"], after["test_missed"]) == ("", "", {})


def test_the_rows_of_an_assessment_lead_to_images_too(desk: Desk, assessed: str) -> None:
    """The star is no part of the name; the classifier misses by itself, without answers."""
    for row in shown(desk, assessed)["table"].value["data"]:
        train, _, _ = choose_row(desk, assessed, {"row_value": row}, "")
        n_recognized, n_images = map(int, row[1].split(" of "))
        assert len(train["cards"]) == n_images - n_recognized
        assert train["title"].startswith(row[0].removesuffix(" ★"))
        if row[0] == "trained image classifier":
            assert all(not card["answers"] for card in train["cards"])


@pytest.mark.parametrize("strange", STRANGE)
def test_strange_projects_are_refused(desk: Desk, assessed: str, strange: Any) -> None:
    for handler in (
        leaderboard.start,
        leaderboard.board,
        leaderboard.use,
        leaderboard.look,
        recognizer.votes,
    ):
        with pytest.raises(ProjectError):
            handler(desk, strange)


def test_unlabelled_images_are_listed(desk: Desk, assessed: str) -> None:
    with desk.changing(assessed) as project:
        image = project.labelled(Split.TEST)[0]
        project.set_labels([image.id], None)
    board = shown(desk, assessed)
    following = board["following"]
    assert [card["image"] for card in following["cards"]] == [image.id]
    assert "vote" in following["cards"][0]["note"]
    assert board["labels"].visible
    assert "1 missing" in board["labels"].label


@pytest.mark.parametrize(
    ("n_unasked", "said"),
    [
        (1, "1 image without a label lacks answers; “Suggest labels” on Images asks about it"),
        (2, "2 images without a label lack answers; “Suggest labels” on Images asks about them"),
    ],
)
def test_images_without_answers_are_counted_in_words(
    desk: Desk, assessed: str, n_unasked: int, said: str
) -> None:
    with desk.changing(assessed) as project:
        for number in range(n_unasked):
            project.add(picture(100 + number, dark=True), f"new-{number}.png")
    board = shown(desk, assessed)
    assert board["following"]["title"] == said
    assert board["labels"].label == f"Labels: {n_unasked} missing"
    assert details.nothing()[3].visible is False


# ---- the report ----------------------------------------------------------------------------


def test_the_report_is_an_attachment_and_a_look(
    client: TestClient, desk: Desk, assessed: str
) -> None:
    with desk.changing(assessed) as project:
        project.name = '<script>"; ü'
    reply = client.get(f"/projects/{assessed}/report.html")
    assert reply.headers["content-disposition"].startswith('attachment; filename="report.html"')
    assert reply.headers["x-content-type-options"] == "nosniff"
    assert "<svg" in reply.text
    assert "<script>" not in reply.text
    assert desk.snapshot(assessed).test_looks == 1


def test_there_is_no_report_before_optimizing(client: TestClient, pid: str) -> None:
    assert client.get(f"/projects/{pid}/report.html").status_code == 404
    assert client.get("/projects/../report.html").status_code == 404


# ---- the engine ----------------------------------------------------------------------------


@pytest.mark.parametrize("engine", Engine)
def test_the_engine_is_kept(desk: Desk, asked: str, engine: Engine) -> None:
    optimize.choose_engine(desk, asked, engine.value)
    assert optimize.show_engine(Desk(desk.root), asked) == engine.value
    optimize.start(desk, asked, *optimize.show(desk, asked))
    job = desk.jobs.get(asked, optimize.KIND)
    assert job is not None
    assert job.join(120).state is JobState.DONE
    for chart in (
        optimize.view(desk, asked, job.snapshot)[1],
        optimize.view(Desk(desk.root), asked, None)[1],
    ):
        terms = [dict(search["terms"]) for search in chart["searches"]]
        assert all(("proof" in one) == (engine is Engine.DEFAULT) for one in terms)
        if engine is Engine.DEFAULT:
            assert {one["proof"] for one in terms} == {"proved best"}  # 16 questions: all subsets


@pytest.mark.parametrize("strange", [None, "x", 3, [], {}])
def test_a_strange_engine_is_refused(desk: Desk, pid: str, strange: Any) -> None:
    with pytest.raises(RequestError):
        optimize.choose_engine(desk, pid, strange)
    assert desk.snapshot(pid).engine is Engine.DEFAULT
