"""The page in Chromium: assess, read the table, choose on the frontier, take the advice along."""

import re
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect
from test_web_browser import Watched, browser, open_tab, pytestmark, url
from test_web_trust import Colours

from vqa_state.assessing import assess as assess_project
from vqa_state.recognizer import read_recognizer
from vqa_state.web.desk import Desk
from vqa_state.web.tabs import assess

__all__ = ["browser", "pytestmark", "url"]  # fixtures and filters of the other walk


def test_assess_choose_and_take_along(
    desk: Desk, url: str, browser: Browser, optimized: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    quickly = partial(assess_project, features=Colours, n_resamples=6)
    monkeypatch.setattr(assess, "assess", quickly)
    watched = Watched(browser, url)
    page = watched.page
    open_tab(page, f"{url}/?p={optimized}&tab=results", "#assess-start")
    expect(page.locator("#recommendation")).to_contain_text("Not assessed yet")
    page.locator("#assess-start").click()
    expect(page.locator("#recommendation")).to_contain_text("Recommended: the vote by")
    expect(page.locator("#standings")).to_contain_text("trained image classifier")
    expect(page.locator("#standings")).to_contain_text("★")
    walk_the_frontier(page)
    expect(page.locator("#coverage-curve circle").first).to_be_visible()

    page.reload()
    expect(page.locator("#frontier circle").first).to_be_visible()
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
