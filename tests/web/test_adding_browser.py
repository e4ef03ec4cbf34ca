"""Adding pictures on the page: what moves, what stops, and what a drop of folders means."""

import time
from collections.abc import Callable
from pathlib import Path

import pytest
from chromium import Watched, browser, open_tab, pytestmark, url
from playwright.sync_api import Browser, Page, expect
from stand_ins import picture
from web.test_adding import slowed, zipped

from vqa_state.project.project import LabelledImage
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.session import Desk

__all__ = ["browser", "pytestmark", "url"]  # fixtures and filters of the walk

LEAVING = """() => {
  const leaving = new Event('beforeunload', {cancelable: true});
  window.dispatchEvent(leaving);
  return leaving.defaultPrevented;
}"""

SECONDS_TO_STOP = """async () => {
  const began = performance.now(), going = document.querySelector('.lg-going');
  document.querySelector('.lg-stop').click();
  while (!going.hidden) await new Promise((done) => setTimeout(done, 10));
  return (performance.now() - began) / 1000;
}"""


def opened(desk: Desk, url: str, browser: Browser) -> tuple[Watched, str]:
    pid = desk.create("door", "open", "closed")
    watched = Watched(browser, url)
    open_tab(watched.page, f"{url}/?p={pid}&tab=images", "#labels .lg-drop")
    return watched, pid


def images(desk: Desk, pid: str) -> list[LabelledImage]:
    return list(desk.snapshot(pid).images.values())


def until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_zip_comes_in_bit_by_bit_and_stops_when_asked(
    desk: Desk, url: str, browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slowed(monkeypatch, 0.2)  # half a minute in all, so that it never ends by itself
    file = tmp_path / "all.zip"
    file.write_bytes(zipped(120))
    watched, pid = opened(desk, url, browser)
    page = watched.page
    news, cells = page.locator(".lg-news"), page.locator(".lg-cell")
    page.locator("#labels input[type=file]").set_input_files(file)
    expect(cells.first).to_be_visible()
    cells.first.click()
    page.keyboard.press("2")
    until(lambda: images(desk, pid)[0].label == -1)  # saved while the ZIP comes in
    expect(news).to_contain_text("s left")
    expect(news).to_contain_text("of 120")
    assert 0 < float(page.locator(".lg-progress").get_attribute("value") or 0) < 1
    assert page.evaluate(SECONDS_TO_STOP) < 1
    expect(news).to_contain_text("added; drop the same files again to go on")
    expect(page.locator(".lg-going")).to_be_hidden()
    page.wait_for_timeout(1500)
    n_kept = len(images(desk, pid))
    assert 2 <= n_kept < 120
    expect(cells).to_have_count(n_kept)  # those of the last few, too, of which no line came
    expect(news).to_contain_text(f"Stopped: {n_kept} added;")
    assert images(desk, pid)[0].label == -1
    monkeypatch.undo()
    page.locator("#labels input[type=file]").set_input_files(file)
    expect(news).to_have_text(f"{120 - n_kept} added · {n_kept - 1} already there · 1 refused:")
    expect(cells).to_have_count(120)
    assert watched.faults == []
    slowed(monkeypatch, 0.2)
    page.locator("#labels input[type=file]").set_input_files(file)
    expect(page.locator(".lg-going")).to_be_visible()
    assert page.evaluate(LEAVING)  # last, since gradio then takes the page for left
    page.close()


def test_folders_label_wherever_they_fall_and_what_is_there_is_named(
    desk: Desk, url: str, browser: Browser, scripted: ScriptedModel, tmp_path: Path
) -> None:
    for number, name in enumerate(("open/a.png", "closed/test/b.png", "closed/c.png")):
        path = tmp_path / "photos" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(picture(number, dark=True))
    (tmp_path / "photos" / ".DS_Store").write_bytes(b"junk")
    (tmp_path / "copy.png").write_bytes(picture(0, dark=True))
    watched, pid = opened(desk, url, browser)
    page = watched.page
    fall(page, "#labels .lg-keys", tmp_path / "photos")  # beside the dashed box
    expect(page.locator(".lg-news")).to_have_text("3 added")
    found = {one.name: (one.label, one.split) for one in images(desk, pid)}
    assert found == {
        "photos/open/a.png": (1, None),
        "photos/closed/test/b.png": (-1, "test"),
        "photos/closed/c.png": (-1, None),
    }
    fall(page, "#labels .lg-cell", tmp_path / "copy.png")
    expect(page.locator(".lg-news")).to_have_text("0 added · 1 already there")
    page.locator(".lg-known summary").click()
    expect(page.locator(".lg-known li")).to_have_text("copy.png – it is photos/open/a.png")
    address = page.url
    fall(page, "#title", tmp_path / "copy.png")  # would open the picture in the place of the page
    page.wait_for_timeout(500)
    assert page.url == address
    assert watched.faults == []
    page.close()


def fall(page: Page, selector: str, path: Path) -> None:
    """Drop a file or folder, as the system would."""
    box = page.locator(selector).first.bounding_box()
    assert box
    place = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    data = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
    session = page.context.new_cdp_session(page)
    for kind in ("dragEnter", "dragOver", "drop"):
        session.send("Input.dispatchDragEvent", {"type": kind, **place, "data": data})
