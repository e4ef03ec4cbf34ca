"""Optimize where answers are missing: it waits for a yes to what it shows, and opens no test."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from stand_ins import finished, says
from starlette.testclient import TestClient

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.errors import MissingAnswersError, NothingToSearchError
from vqa_state.models import Failure
from vqa_state.project.split import Split
from vqa_state.recognizer.recognizer import Recognizer
from vqa_state.search.engines import Engine
from vqa_state.search.objectives import Objective
from vqa_state.study.answer_tables import read_tables
from vqa_state.study.optimize import recognizer_path
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.jobs import JobState
from vqa_state.web.security import LocalGuard
from vqa_state.web.server import build_api
from vqa_state.web.session import Desk
from vqa_state.web.tabs import optimize, partly
from vqa_state.web.tabs.ask import tab as ask
from vqa_state.web.tabs.recognizer import tab as recognizer
from vqa_state.web.tabs.recognizer import transfer
from vqa_state.web.tabs.results import leaderboard
from vqa_state.web.tabs.results import tab as results


class Mortal:
    """Answers until `left` calls are over; then every call fails."""

    def __init__(self) -> None:
        self.left = 10**9

    def __call__(self, image: Image.Image, question: str) -> Answer | Failure:
        self.left -= 1
        return says(image, question) if self.left >= 0 else Failure("it died", for_all=True)


@pytest.fixture
def mortal(monkeypatch: pytest.MonkeyPatch) -> Mortal:
    """A model under the name "mortal", whose life a test sets."""
    life = Mortal()
    monkeypatch.setitem(models._factories, "mortal", lambda: ScriptedModel(life))
    return life


@pytest.fixture
def part(desk: Desk, pid: str, mortal: Mortal) -> str:
    """Id of a project whose model died before its last images."""
    with desk.changing(pid) as project:
        project.engine = Engine.PAPER
        project.augmentation = replace(project.augmentation, n_copies=1)
    mortal.left = 230
    asked(desk, pid)
    answers = read_tables(desk.snapshot(pid)).answers
    assert (answers.part_is_searchable, answers.test.n_images > 0) == (True, True)
    return pid


def asked(desk: Desk, pid: str) -> None:
    ask.start(desk, pid, "mortal")
    assert finished(desk, pid, ask.KIND).state is JobState.DONE


def optimized(desk: Desk, pid: str) -> Any:
    return optimize.view(desk, pid, finished(desk, pid, optimize.KIND))[0]


def shown(value: Any) -> bool:
    return bool(value.visible)


def test_it_says_what_is_missing_and_what_can_be_done(desk: Desk, part: str) -> None:
    said = optimize.view(desk, part, None)[0]["text"]
    answers = read_tables(desk.snapshot(part)).answers
    assert f"{answers.train.lacks}. Ask the model for them on the tab Ask" in said
    button, offered = partly.show(desk, part)
    assert (shown(button), offered) == (True, answers.part)
    assert button.value == f"Optimize on {answers.part} images"
    assert answers.train.lacks in results.show(desk, part, "", "")[0]["text"]


def test_without_a_yes_nothing_is_searched(desk: Desk, part: str) -> None:
    with pytest.raises(MissingAnswersError, match="on the tab Ask, then optimize; or search on"):
        optimize.start(desk, part, *optimize.show(desk, part))
    assert desk.jobs.get(part, optimize.KIND) is None


@pytest.mark.parametrize("offered", ["", "1 of 8", None, 5])
def test_a_yes_to_another_part_is_none(desk: Desk, part: str, offered: Any) -> None:
    with pytest.raises(MissingAnswersError, match="training images have all their answers; open"):
        optimize.start_on_part(desk, part, offered, *optimize.show(desk, part))
    assert desk.jobs.get(part, optimize.KIND) is None


@pytest.fixture
def agreed(desk: Desk, part: str) -> str:
    """Id of a project that was searched on a part."""
    offered = partly.show(desk, part)[1]
    optimize.start_on_part(desk, part, offered, *optimize.show(desk, part))
    assert finished(desk, part, optimize.KIND).state is JobState.DONE
    return part


@pytest.fixture
def client(desk: Desk) -> TestClient:
    return TestClient(LocalGuard(build_api(desk)), base_url="http://127.0.0.1")


def test_a_search_on_a_part_is_told_everywhere_and_opens_no_test(
    desk: Desk, agreed: str, client: TestClient
) -> None:
    answers = read_tables(desk.snapshot(agreed)).answers
    saw, closed = answers.limits
    for text in (
        optimized(desk, agreed)["text"],
        optimize.view(Desk(desk.root), agreed, None)[0]["text"],
        results.show(desk, agreed, "", "")[0]["text"],
    ):
        assert saw in text
        assert closed in text
    assert (
        f"these {answers.part} have all their answers" in recognizer.show(desk, agreed)[1]["text"]
    )
    with pytest.raises(NothingToSearchError, match="The test stays closed"):
        leaderboard.look(desk, agreed)
    page = client.get(f"/projects/{agreed}/report.html")
    assert (page.status_code, "The test stays closed" in page.text) == (200, True)
    taken = client.get(f"/projects/{agreed}/recognizers/s+.json").json()
    assert (taken["scores"]["test"], taken["incomplete"]["n_labelled"]) == (
        None,
        answers.train.n_images,
    )
    assert desk.snapshot(agreed).test_looks == 0


def test_a_recheck_of_a_part_is_no_look(desk: Desk, agreed: str, mortal: Mortal) -> None:
    mortal.left = 10**9
    transfer.start(desk, agreed, "mortal")
    assert finished(desk, agreed, transfer.KIND).state is JobState.DONE
    assert desk.snapshot(agreed).test_looks == 0


def written(desk: Desk, pid: str) -> list[bytes]:
    project = desk.snapshot(pid)
    return [recognizer_path(project, one).read_bytes() for one in Objective]


def test_when_the_model_is_back_it_is_the_undisturbed_search(
    desk: Desk, agreed: str, mortal: Mortal, labelled_folder: Path, tmp_path: Path
) -> None:
    mortal.left = 10**9
    asked(desk, agreed)
    assert not shown(partly.show(desk, agreed)[0])
    optimize.start(desk, agreed, *optimize.show(desk, agreed))
    assert optimized(desk, agreed)["text"].startswith("Done.")
    late = written(desk, agreed)
    assert Recognizer.load(recognizer_path(desk.snapshot(agreed), Objective.S_PLUS)).scores.test
    (desk.snapshot(agreed).store_path).unlink()
    for path in (desk.root / agreed / "recognizers").iterdir():
        path.unlink()
    asked(desk, agreed)
    optimize.start(desk, agreed, *optimize.show(desk, agreed))
    finished(desk, agreed, optimize.KIND)
    assert written(desk, agreed) == late


def test_optimizing_again_for_another_model_ends_where_it_dies(
    desk: Desk, part: str, mortal: Mortal
) -> None:
    mortal.left = 3
    transfer.start_again(desk, part, "mortal")
    snapshot = finished(desk, part, transfer.KIND)
    assert snapshot.state is JobState.FAILED
    assert "Nothing was searched; what was answered is kept" in str(snapshot.failure)
    assert "it died" in transfer.view(desk, part, snapshot)[0]["text"]
    assert not (desk.root / part / "recognizers").exists()


def test_a_test_image_without_answers_keeps_the_test_closed(
    desk: Desk, part: str, mortal: Mortal
) -> None:
    mortal.left = 10**9
    asked(desk, part)
    optimize.start(desk, part, *optimize.show(desk, part))
    finished(desk, part, optimize.KIND)
    with desk.changing(part) as project:
        moved = project.labelled(Split.TEST)[0]
        project.set_splits([moved.id], Split.UNUSED)
    assert "closed" not in results.show(desk, part, "", "")[0]["text"]
    with desk.changing(part) as project:
        project.set_splits([moved.id], Split.TEST)
        project.images[moved.id] = replace(project.images[moved.id], pixel_hash="0" * 64)
    said = results.show(desk, part, "", "")[0]["text"]
    assert "The test stays closed until all its answers are there: 1 of" in said
    assert desk.snapshot(part).test_looks == 0
