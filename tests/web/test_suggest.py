"""Suggested labels on Images: asked for, shown, accepted with one key, never on the test side."""

import re
import time
from functools import partial
from typing import Any

import pytest
from chromium import Watched, browser, open_tab, pytestmark, url
from playwright.sync_api import Browser, expect
from stand_ins import Gate, finished, picture

from vqa_state.errors import NothingToSearchError
from vqa_state.project.split import Split
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.job_watcher import Watch
from vqa_state.web.jobs import JobState
from vqa_state.web.session import Desk
from vqa_state.web.tabs.images import suggestions
from vqa_state.web.tabs.images import tab as images

__all__ = ["browser", "pytestmark", "url"]  # fixtures and filters of the other walk

WATCH = Watch(suggestions.KIND, suggestions.view)


@pytest.fixture
def open_images(desk: Desk, optimized: str) -> dict[str, int]:
    """Six more pictures without a label, and what they show."""
    truth = {}
    with desk.changing(optimized) as project:
        for number in range(20, 23):
            for dark in (True, False):
                added = project.add(picture(number, dark=dark), f"{number}-{dark}.png")
                truth[added.image.id] = 1 if dark else -1
    return truth


ended = partial(finished, kind=suggestions.KIND)


def test_the_recognizer_suggests_what_it_sees(
    desk: Desk, optimized: str, open_images: dict[str, int]
) -> None:
    suggestions.start(desk, optimized)
    said, start, stop, grid = suggestions.view(desk, optimized, ended(desk, optimized))
    assert "6 labels are suggested" in said["text"]
    assert (start.interactive, stop.interactive) == (True, False)
    assert {one: hint["label"] for one, hint in grid["suggested"].items()} == open_images
    assert all(0 < hint["sureness"] <= 1 for hint in grid["suggested"].values())
    assert images.show(desk, optimized)[0] == grid  # a page that comes later shows them, too
    first, *rest = open_images
    for labelled, words in (
        ([first], "5 of 6 suggested labels are"),
        (rest[1:], "1 of 6 suggested labels is"),
    ):
        with desk.changing(optimized) as project:
            project.set_labels(labelled, 1)
        assert f"{words} still open" in suggestions.tell(desk, optimized)["text"]
    with desk.changing(optimized) as project:
        project.remove([rest[0]])
    assert suggestions.tell(desk, optimized)["text"] == "Every suggested label is settled."


def test_a_label_by_hand_ends_its_suggestion(
    desk: Desk, optimized: str, open_images: dict[str, int]
) -> None:
    suggestions.start(desk, optimized)
    ended(desk, optimized)
    first, *rest = open_images
    with desk.changing(optimized) as project:
        project.set_labels([first], -open_images[first])
        project.remove([rest[0]])
    assert set(suggestions.grid_value(desk, optimized)["suggested"]) == set(rest[1:])


def test_there_must_be_something_to_suggest(desk: Desk, optimized: str, asked: str) -> None:
    with pytest.raises(NothingToSearchError, match="every image has a label"):
        suggestions.start(desk, optimized)


def test_without_a_recognizer_the_next_step_is_said(desk: Desk, asked: str) -> None:
    with desk.changing(asked) as project:
        project.add(picture(30, dark=True), "new.png")
    with pytest.raises(NothingToSearchError, match="optimize first"):
        suggestions.start(desk, asked)


def test_answers_of_another_model_do_not_vote(
    desk: Desk, optimized: str, open_images: dict[str, int], scripted: ScriptedModel
) -> None:
    scripted.fingerprint = "another/1"
    suggestions.start(desk, optimized)
    snapshot = ended(desk, optimized)
    assert snapshot.state is JobState.FAILED
    assert "ask and optimize again" in suggestions.view(desk, optimized, snapshot)[0]["text"]
    assert scripted.asked == []


def test_a_stop_keeps_what_was_answered(
    desk: Desk, optimized: str, open_images: dict[str, int], scripted: ScriptedModel, gate: Gate
) -> None:
    with desk.changing(optimized) as project:  # so many that the gate is reached
        for number in range(40, 80):
            project.add(picture(number, dark=True), f"{number}.png")
    gate.opened.clear()
    suggestions.start(desk, optimized)
    assert gate.reached.wait(60)
    WATCH.stop(desk, optimized)
    job = desk.jobs.get(optimized, suggestions.KIND)
    assert job is not None
    assert job.snapshot.state is JobState.STOPPING
    gate.opened.set()
    snapshot = ended(desk, optimized)
    assert snapshot.state is JobState.STOPPED
    assert "suggest again to go on" in suggestions.view(desk, optimized, snapshot)[0]["text"]
    n_first = len(scripted.asked)
    suggestions.start(desk, optimized)
    report = ended(desk, optimized).report
    assert len(report.found) > 6
    assert report.asking.n_calls == len(scripted.asked) > n_first  # nothing was paid for twice


def test_a_stop_is_seen_while_the_model_loads(
    desk: Desk, optimized: str, open_images: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    loading, load = Gate(), desk.model

    def slowly(name: str) -> Any:
        loading.pass_through()
        return load(name)

    monkeypatch.setattr(desk, "model", slowly)
    suggestions.start(desk, optimized)
    assert loading.reached.wait(20)
    assert "Loading the model" in suggestions.tell(desk, optimized)["text"]
    WATCH.stop(desk, optimized)
    assert suggestions.tell(desk, optimized)["text"] == "Stopping…"
    loading.opened.set()
    ended(desk, optimized)
    assert "Stopped" in suggestions.tell(desk, optimized)["text"]


def test_one_key_accepts_and_another_takes_it_back(
    desk: Desk, url: str, browser: Browser, optimized: str, open_images: dict[str, int]
) -> None:
    watched = Watched(browser, url)
    page = watched.page
    open_tab(page, f"{url}/?p={optimized}&tab=images", "#suggest-start")
    page.locator("#suggest-start").click()
    guessed = page.locator(".lg-cell[data-suggested='true']")
    expect(guessed).to_have_count(6)
    expect(page.locator(".lg-counts")).to_contain_text("6 suggested")
    expect(guessed.first.locator(".lg-label")).to_have_text(re.compile(r"(open|closed)\? \d+ %$"))
    guessed.first.click()
    page.keyboard.press("y")
    expect(guessed).to_have_count(5)
    expect(page.locator("#suggest-progress")).to_contain_text("5 of 6 suggested labels are")
    page.keyboard.press("Control+a")
    page.keyboard.press("y")
    expect(guessed).to_have_count(0)
    until(lambda: accepted(desk, optimized, open_images) == 6)
    page.keyboard.press("Control+z")
    expect(guessed).to_have_count(5)
    until(lambda: accepted(desk, optimized, open_images) == 1)
    page.reload()
    expect(guessed).to_have_count(5)
    watched.forget_broken_streams()
    assert watched.faults == []
    page.close()


def accepted(desk: Desk, pid: str, truth: dict[str, int]) -> int:
    """Images that got their suggested label; each of them must be a training image."""
    found = [desk.snapshot(pid).images[image_id] for image_id in truth]
    labelled = [image for image in found if image.label is not None]
    assert all(image.label == truth[image.id] for image in labelled)
    assert all(image.split is Split.TRAIN and image.accepted for image in labelled)
    assert not any(image.accepted for image in found if image.label is None)
    assert all(image.split is None for image in found if image.label is None)
    return len(labelled)


def until(holds: Any) -> None:
    end = time.monotonic() + 20
    while not holds():
        assert time.monotonic() < end, "it was not saved"
        time.sleep(0.05)
