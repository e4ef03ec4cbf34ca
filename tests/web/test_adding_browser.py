"""Adding pictures on the page: what moves, what stops, and what a drop of folders means."""

import io
import time
import zipfile
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


def test_what_got_no_label_is_told_calmly_or_with_its_folder(
    desk: Desk, url: str, browser: Browser, tmp_path: Path
) -> None:
    for number in range(2):
        (tmp_path / f"{number}.png").write_bytes(picture(number, dark=True))
    states = "geöffnet", "geschlossen"
    (tmp_path / "named.zip").write_bytes(old_zip(*states, first=10))
    (tmp_path / "strange.zip").write_bytes(old_zip("auf", "zu", "zu", first=20))
    pid = desk.create("door", *states)
    watched = Watched(browser, url)
    page = watched.page
    open_tab(page, f"{url}/?p={pid}&tab=images", "#labels .lg-drop")
    news, unnamed = page.locator(".lg-news"), page.locator(".lg-unnamed")
    files = [tmp_path / "0.png", tmp_path / "1.png"]
    page.locator("#labels input[type=file]").set_input_files(files)
    expect(news).to_have_text("2 added · 2 without a label yet: label them below with keys 1 and 2")
    expect(unnamed).to_be_hidden()
    page.locator("#labels input[type=file]").set_input_files(tmp_path / "named.zip")
    expect(news).to_have_text("2 added")
    expect(unnamed).to_be_hidden()
    assert [one.label for one in images(desk, pid)] == [None, None, 1, -1]
    assert images(desk, pid)[2].name == "geöffnet/10.png"
    page.locator("#labels input[type=file]").set_input_files(tmp_path / "strange.zip")
    expect(news).to_have_text("3 added · 3 without a label yet: label them below with keys 1 and 2")
    expect(unnamed.locator("li")).to_have_text(
        [
            "1 without a label – folder 'auf' is none of geöffnet, geschlossen",
            "2 without a label – folder 'zu' is none of geöffnet, geschlossen",
        ]
    )
    assert watched.faults == []
    page.close()


def old_zip(*folders: str, first: int) -> bytes:
    """A ZIP of pictures in these folders, with names in the code page of DOS and no flag."""
    packed, names = io.BytesIO(), [f"{name}/{first + n}.png" for n, name in enumerate(folders)]
    stand_ins = [name.encode("ascii", "replace").decode() for name in names]
    with zipfile.ZipFile(packed, "w") as archive:
        for n, stand_in in enumerate(stand_ins):
            archive.writestr(stand_in, picture(first + n, dark=True))
    data = packed.getvalue()
    for stand_in, name in zip(stand_ins, names, strict=True):
        data = data.replace(stand_in.encode(), name.encode("cp850"))
    return data


def fall(page: Page, selector: str, path: Path) -> None:
    """Drop a file or folder, as the system would."""
    box = page.locator(selector).first.bounding_box()
    assert box
    place = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    data = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
    session = page.context.new_cdp_session(page)
    for kind in ("dragEnter", "dragOver", "drop"):
        session.send("Input.dispatchDragEvent", {"type": kind, **place, "data": data})
