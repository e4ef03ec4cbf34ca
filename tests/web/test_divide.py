"""Dividing with another seed: what that costs is said before it happens."""

from pathlib import Path

import pytest
from chromium import Watched, browser, open_tab, pytestmark, type_into, url
from playwright.sync_api import Browser, expect

from vqa_state.errors import VQAStateError
from vqa_state.project.project import Project
from vqa_state.study.collect import plan
from vqa_state.web.session import Desk
from vqa_state.web.tabs.images import tab as images

__all__ = ["browser", "pytestmark", "url"]  # fixtures and filters of the walk


def stored(project: Project) -> int:
    return plan(project, project.fingerprint or "").n_stored


def content(desk: Desk, pid: str) -> bytes:
    return Path(desk.root / pid / "project.json").read_bytes()


def test_a_new_seed_says_first_how_many_answers_it_costs(desk: Desk, asked: str) -> None:
    before, n_stored = content(desk, asked), stored(desk.snapshot(asked))
    assert n_stored == 1536
    _, said, sure = images.divide_if_sure(desk, asked, 0.5, 7, True, False)
    assert content(desk, asked) == before
    assert "Nothing is divided yet" in said["text"]
    assert "1,536 stored answers would no longer count" in said["text"]
    assert "set the seed back to 0" in said["text"]
    assert sure.visible
    _, said, sure = images.divide_if_sure(desk, asked, 0.5, 7, True, True)
    assert said["text"].startswith("Train: ")
    assert (sure.visible, sure.value) == (False, False)
    assert desk.snapshot(asked).seed == 7
    assert stored(desk.snapshot(asked)) == 0  # as it was said
    images.divide_if_sure(desk, asked, 0.5, 0, False, False)  # back without a question
    assert stored(desk.snapshot(asked)) == n_stored


def test_where_nothing_is_lost_nothing_is_asked(desk: Desk, asked: str) -> None:
    _, said, sure = images.divide_if_sure(desk, asked, 0.25, 0, True, False)
    assert said["text"].startswith("Train: 2 open")
    assert not sure.visible
    empty = desk.create("door", "open", "closed")
    images.divide_if_sure(desk, empty, 0.5, 3, False, False)
    assert desk.snapshot(empty).seed == 3


@pytest.mark.parametrize("seed", [None, "7", -1, 2**32, 1e300, 0.5])
def test_a_strange_seed_is_refused_as_ever(desk: Desk, asked: str, seed: object) -> None:
    before = content(desk, asked)
    with pytest.raises(VQAStateError):
        images.divide_if_sure(desk, asked, 0.5, seed, True, False)
    assert content(desk, asked) == before


def test_the_page_asks_with_a_box(desk: Desk, url: str, browser: Browser, asked: str) -> None:
    watched = Watched(browser, url)
    page = watched.page
    open_tab(page, f"{url}/?p={asked}&tab=images", "#split")
    box = page.locator("#new-seed input")
    expect(page.locator("#split-note")).to_contain_text("Train: 4 open")
    expect(box).to_have_count(0)
    type_into(page.get_by_label("Seed of the split and of the copies"), "7")
    page.locator("#split").click()
    expect(page.locator("#split-note")).to_contain_text("1,536 stored answers")
    assert desk.snapshot(asked).seed == 0
    box.check()
    page.locator("#split").click()
    expect(page.locator("#split-note")).to_contain_text("Train: 4 open")
    assert desk.snapshot(asked).seed == 7
    watched.forget_broken_streams()
    assert watched.faults == []
    page.close()
