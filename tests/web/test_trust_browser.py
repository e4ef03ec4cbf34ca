"""The page in Chromium: assess, read the table, choose on the frontier, take the advice along."""

import re
from collections import deque
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from chromium import Watched, browser, open_tab, pytestmark, url
from playwright.sync_api import Browser, Page, expect
from web.test_trust import Colours

from vqa_state.project.split import Split
from vqa_state.questions.grid import Question
from vqa_state.recognizer.recognizer import read_recognizer
from vqa_state.study.assess import assess as assess_project
from vqa_state.study.collect import ask
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.session import Desk
from vqa_state.web.tabs.results import leaderboard

__all__ = ["browser", "pytestmark", "url"]  # fixtures and filters of the other walk


def test_assess_choose_and_take_along(
    desk: Desk, url: str, browser: Browser, optimized: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    quickly = partial(assess_project, features=Colours, n_resamples=6)
    monkeypatch.setattr(leaderboard, "assess", quickly)
    watched = Watched(browser, url)
    page = watched.page
    open_tab(page, f"{url}/?p={optimized}&tab=results", "#assess-start")
    expect(page.locator("#recommendation")).to_contain_text("Not assessed yet")
    page.locator("#assess-start").click()
    expect(page.locator("#recommendation")).to_contain_text("Recommended: the vote by")
    expect(page.locator("#standings")).to_contain_text("trained image classifier")
    expect(page.locator("#standings")).to_contain_text("★")
    page.get_by_role("button", name="What questions and abstaining buy").click()
    walk_the_frontier(page)
    expect(page.locator("#coverage-curve circle").first).to_be_visible()

    page.reload()
    expect(page.locator("#recommendation")).to_contain_text("Recommended: the vote by")
    watched.forget_broken_streams()
    page.locator("#look").click()
    expect(page.locator("#standings")).to_contain_text("test, positive")
    page.locator("#use-it").click()
    expect(page.locator("#used")).to_contain_text("Taken")
    kind = desk.taken(optimized).vote
    with page.expect_download() as incoming:
        page.get_by_role("link", name="Keep a report").click()
    assert b"<svg" in Path(incoming.value.path()).read_bytes()

    page.get_by_role("tab", name="Recognizer").click()
    expect(page.locator(f"#vote input[value='{kind.value}']")).to_be_checked()
    page.locator("#vote input[value='weighted answers']").click()
    expect(page.locator("#about")).to_contain_text("weighted answers")
    with page.expect_download() as incoming:
        page.get_by_role("link", name="Download the recognizer").click()
    data = Path(incoming.value.path()).read_bytes()
    assert read_recognizer(data, "it").vote.value == "weighted answers"
    page.locator("#coverage input[type=range]").focus()
    for _ in range(4):  # faster than each is answered
        page.keyboard.press("ArrowLeft")
    expect(page.locator("#about")).to_contain_text("about 80% of new images")
    assert desk.taken(optimized).coverage == 0.8

    page.locator("#objective input[value='all']").click()
    expect(page.locator("#about")).to_contain_text("none of which chose its questions")
    expect(page.locator("#vote input[value='weighted answers']")).to_be_disabled()
    with page.expect_download() as incoming:
        page.get_by_role("link", name="Download the recognizer").click()
    assert read_recognizer(Path(incoming.value.path()).read_bytes(), "it").origin is None
    page.locator("#objective input[value='s+']").click()
    expect(page.locator("#vote input[value='weighted answers']")).to_be_enabled()
    expect(page.locator("#about")).to_contain_text("weighted answers")
    assert watched.faults == []
    page.close()


def test_old_evidence_leaves_the_page(
    desk: Desk, url: str, browser: Browser, optimized: str
) -> None:
    """Of the test with its columns; all of it when a label changes, and the whole tab with it."""
    watched = Watched(browser, url)
    page = watched.page
    open_tab(page, f"{url}/?p={optimized}&tab=results", "#standings")
    page.locator("#look").click()
    expect(page.locator("#standings")).to_contain_text("test, positive")
    page.locator("#standings [data-testid^=cell]").get_by_text("best question").click()
    for side in ("#train-missed", "#test-missed"):
        expect(page.locator(f"{side} .ev-title")).to_contain_text("best question")
    page.get_by_role("button", name="Which questions are good").click()
    page.locator("#heatmap button").first.click()
    expect(page.locator("#question-answers .ev-title")).to_contain_text("door")

    page.get_by_role("tab", name="Images").click()
    page.get_by_role("tab", name="Results").click()
    expect(page.locator("#test-missed .ev-title")).to_be_hidden()
    expect(page.locator("#standings")).not_to_contain_text("test, positive")
    for still in ("#train-missed .ev-title", "#question-answers .ev-title"):
        expect(page.locator(still)).to_be_visible()

    page.get_by_role("tab", name="Images").click()
    with desk.changing(optimized) as project:
        project.set_labels([project.labelled(Split.TRAIN)[0].id], None)
    page.get_by_role("tab", name="Results").click()
    expect(page.locator("#results-note")).to_contain_text("optimize again")
    for gone in ("#standings", "#assess-start", "#look", ".ev-title"):
        expect(page.locator(gone).locator("visible=true")).to_have_count(0)
    assert watched.faults == []
    page.close()


def test_a_narrow_page_shows_numbers_beside_long_questions(
    desk: Desk, url: str, browser: Browser, asked: str, scripted: ScriptedModel
) -> None:
    text = "Is the door of this rather old and heavy safe in the corner at least slightly open?"
    with desk.changing(asked) as project:
        project.grid = replace(project.grid, custom=(Question(text, 1), Question("Shut?", -1)))
    deque(ask(desk.snapshot(asked), scripted), maxlen=0)
    watched = Watched(browser, url)
    page = watched.page
    page.set_viewport_size({"width": 420, "height": 900})
    open_tab(page, f"{url}/?p={asked}&tab=results", "#good-questions")
    page.get_by_role("button", name="Which questions are good").click()
    view = page.locator("#heatmap .hm").bounding_box()
    own = page.get_by_role("button", name=text).bounding_box()
    first = page.locator("#heatmap button").first.bounding_box()
    assert view
    for cell in (own, first):
        assert cell
        assert view["x"] <= cell["x"] < cell["x"] + cell["width"] <= view["x"] + view["width"]
    row = page.locator("#heatmap tr", has_text="Shut?")
    expect(row.locator("td").first).to_have_text("closed")
    page.get_by_role("button", name=text).focus()
    page.keyboard.press("ArrowUp")  # back into the grid
    expect(page.locator("#heatmap table").first.locator("button:focus")).to_have_count(1)
    assert watched.faults == []
    page.close()


def walk_the_frontier(page: Page) -> None:
    points = page.locator("#frontier circle:not(.tr-marked)")
    expect(page.locator("#frontier circle.tr-marked").first).to_be_visible()
    expect(points.first).to_be_visible()
    points.first.click()
    expect(page.locator("#frontier .tr-says")).to_contain_text("at best")
    expect(page.locator("#frontier li")).to_have_count(1)
    page.keyboard.press("ArrowLeft")  # to the ring around it
    focused = page.locator("#frontier circle:focus")
    expect(focused).to_have_class("tr-marked")
    page.keyboard.press("Enter")
    expect(focused).to_have_attribute("aria-pressed", "true")
    said = page.locator("#frontier .tr-says")
    expect(said).to_contain_text(re.compile("^(s-|best question).*: 1 question"))
