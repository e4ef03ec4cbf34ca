"""The page in Chromium: one walk along the whole road, and what hostile names cannot do."""

import re
import shutil
from collections import deque
from dataclasses import replace
from pathlib import Path

import httpx
from chromium import WAIT, Watched, browser, open_tab, pytestmark, type_into, url
from playwright.sync_api import Browser, Page, expect
from stand_ins import Gate, picture, says

from vqa_state.project.project import Project
from vqa_state.questions.grid import Wording
from vqa_state.search.objectives import Objective
from vqa_state.study.collect import ask
from vqa_state.study.optimize import optimize, recognizer_path
from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.session import Desk

__all__ = ["browser", "pytestmark", "url"]  # fixtures and filters

SAMPLE = Path(__file__).parents[2] / "projects" / "refrigerator"


def test_the_whole_road(
    desk: Desk, url: str, browser: Browser, scripted: ScriptedModel, gate: Gate, tmp_path: Path
) -> None:
    watched = Watched(browser, url)
    page = watched.page
    files, labels = sample(tmp_path / "pictures")

    pid = create_a_project(page, url)
    watched.forget_broken_streams()
    upload_and_label(page, files, labels)
    divide(page)
    write_questions(page)
    twin = tmp_path / "twin"
    shutil.copytree(desk.root / pid, twin)
    ask_and_reload_meanwhile(watched, gate)
    optimize_it(page)
    look_at_results(page)
    downloaded = download(page)
    try_a_picture(page, files[0])
    assert watched.faults == []
    page.close()

    headless = walk_alone(twin)
    assert downloaded == headless[Objective.S_PLUS]
    for objective, content in headless.items():
        address = f"{url}/projects/{pid}/recognizers/{objective.value}.json"
        assert httpx.get(address).content == content


def test_a_stop_in_one_tab_is_seen_in_another(
    url: str, browser: Browser, pid: str, scripted: ScriptedModel, gate: Gate
) -> None:
    first, second = Watched(browser, url), Watched(browser, url)
    for watched in (first, second):
        open_tab(watched.page, f"{url}/?p={pid}&tab=ask", "#ask-start")
    gate.opened.clear()
    choose_model(first.page)
    first.page.locator("#ask-start").click()
    assert gate.reached.wait(20)
    expect(second.page.locator("#ask-progress")).to_contain_text("Asking")
    second.page.locator("#ask-stop").click()
    expect(first.page.locator("#ask-progress")).to_contain_text("Stopping")
    gate.opened.set()
    for watched in (first, second):
        progress = watched.page.locator("#ask-progress")
        expect(progress).to_contain_text("Stopped")
        assert watched.faults == []
        watched.page.close()


def test_names_are_never_read_as_html(
    desk: Desk, url: str, browser: Browser, scripted: ScriptedModel
) -> None:
    evil = '<img src=x onerror="window.hacked=1">{{value}}${window.hacked=1}'
    pid = desk.create(f"{evil} door", f"{evil} open", f"{evil} closed")
    with desk.changing(pid) as project:
        for number in range(4):
            project.add(
                picture(number, dark=number < 2), f"{evil}{number}.png", 1 - 2 * (number // 2)
            )
        project.assign_splits()
        project.search = type(project.search)(population=20, generations=2)
        project.model, project.fingerprint = scripted.name, scripted.fingerprint
    deque(ask(desk.snapshot(pid), scripted), maxlen=0)
    deque(optimize(desk.snapshot(pid)), maxlen=0)
    watched = Watched(browser, url)
    page = watched.page
    open_tab(page, f"{url}/?p={pid}", "#labels .lg-cell")
    for name in ("Questions", "Ask", "Optimize", "Results", "Recognizer"):
        page.get_by_role("tab", name=name).click()
        if name == "Results":
            page.get_by_role("button", name="Which questions are good").click()
            page.locator("#heatmap button").first.click()
            expect(page.locator("#question-answers article").first).to_be_visible()
    expect(page.locator("#about")).to_contain_text("question")
    assert page.evaluate("window.hacked") is None
    assert watched.faults == []
    page.close()


def test_opening_the_page_changes_nothing(desk: Desk, url: str, browser: Browser, pid: str) -> None:
    file = desk.root / pid / "project.json"
    before = file.read_bytes()
    watched = Watched(browser, url)
    open_tab(watched.page, f"{url}/?p={pid}&tab=questions", "#wordings textarea")
    expect(watched.page.locator("#wordings textarea")).to_have_value("door")
    for name in ("Images", "Ask", "Optimize", "Results", "Recognizer", "Questions"):
        watched.page.get_by_role("tab", name=name).click()
    expect(watched.page.locator("#questions .qg-counts")).to_have_text("16 questions will be asked")
    assert watched.faults == []
    assert file.read_bytes() == before
    pass_through_fields(watched.page, desk, pid)
    watched.page.close()


def test_the_app_has_its_guard(url: str) -> None:
    assert httpx.get(url, headers={"Host": "evil.example"}).status_code == 403
    upload = f"{url}/gradio_api/upload"
    evil = {"Origin": "http://evil.example"}
    assert httpx.post(upload, files={"files": b"x"}, headers=evil).status_code == 403
    page = httpx.get(url)
    assert page.status_code == 200
    assert "default-src 'self'" in page.headers["content-security-policy"]


# ---- the stretches of the walk -------------------------------------------------------------


def sample(folder: Path) -> tuple[list[Path], list[int]]:
    """Twenty pictures of the sample project as loose files, states mixed, and their labels."""
    folder.mkdir()
    project = Project.open(SAMPLE)
    by_label = {
        label: [image for image in project.images.values() if image.label == label][:10]
        for label in (1, -1)
    }
    files, labels = [], []
    for pair in zip(by_label[1], by_label[-1], strict=True):
        for image in pair:
            path = folder / f"{len(files):02d}.{image.suffix}"
            path.write_bytes(project.read(image))
            files.append(path)
            labels.append(image.label or 0)
    return files, labels


def pass_through_fields(page: Page, desk: Desk, pid: str) -> None:
    """The key Tab leads through fields; it neither loads the page anew nor takes anything back."""
    page.evaluate("window.kept = true")
    page.locator("#project input").focus()
    page.keyboard.press("Tab")
    with desk.changing(pid) as project:  # another window
        project.grid = replace(project.grid, wordings=(*project.grid.wordings, Wording("gate")))
    page.locator("#wordings textarea").focus()
    page.keyboard.press("Tab")
    page.locator("#wordings textarea").fill("porch")  # typed without a look at the other window
    page.keyboard.press("Tab")
    expect(page.locator("#questions-note")).to_contain_text("another window")
    assert page.evaluate("window.kept") is True
    assert list(map(str, desk.snapshot(pid).grid.wordings)) == ["door", "gate"]


def create_a_project(page: Page, url: str) -> str:
    page.goto(url)
    expect(page.locator("#road")).to_contain_text("Make your first project")
    page.locator("#new-name textarea, #new-name input").fill("refrigerator")
    page.locator("#new-positive textarea, #new-positive input").fill("open")
    page.locator("#new-negative textarea, #new-negative input").fill("closed")
    page.locator("#create").click()
    page.wait_for_url("**/?p=*")
    expect(page.locator("#labels .lg-drop")).to_be_visible(timeout=WAIT)
    found = re.search(r"p=(\w+)", page.url)
    assert found
    return found[1]


def upload_and_label(page: Page, files: list[Path], labels: list[int]) -> None:
    text = files[0].with_name("99.jpg")
    text.write_text("no picture")
    page.locator("#labels input[type=file]").set_input_files([*files, text])
    expect(page.locator("#labels .lg-news")).to_contain_text("20 added · 1 refused")
    expect(page.locator("#labels .lg-refused")).to_contain_text("99.jpg")
    names = page.locator("#labels .lg-cell img").evaluate_all("all => all.map(one => one.title)")
    assert names == [file.name for file in files]  # in the order in which they were given
    page.locator("#labels .lg-cell").first.click()
    keys = {1: "1", -1: "2"}
    for label in labels[:2]:
        page.keyboard.press(keys[label])
    page.keyboard.press("Control+z")
    expect(page.locator("#labels .lg-counts")).to_contain_text("19 to label")
    page.locator("#labels .lg-cell").nth(1).click()
    for label in labels[1:]:
        page.keyboard.press(keys[label])
    expect(page.locator("#labels .lg-counts")).to_contain_text("10 open · 10 closed · 0 to label")
    expect(page.locator("#road")).to_contain_text("20 images labelled")


def divide(page: Page) -> None:
    page.locator("#split").click()
    expect(page.locator("#split-note")).to_contain_text("Train: 5 open, 5 closed")
    expect(page.locator("#labels .lg-counts")).to_contain_text("10 train · 10 test")


def write_questions(page: Page) -> None:
    page.get_by_role("tab", name="Questions").click()
    type_into(page.locator("#wordings textarea"), "refrigerator\nrefrigerator door")
    expect(page.locator("#questions .qg-counts")).to_have_text("32 questions will be asked")
    page.get_by_role("button", name="Is that refrigerator door closed?").click()
    expect(page.locator("#questions .qg-counts")).to_contain_text("31 questions")
    expect(page.locator("#road")).to_contain_text("31 questions")


def choose_model(page: Page) -> None:
    page.locator("#model input").click()
    page.get_by_role("option", name="scripted").click()


def ask_and_reload_meanwhile(watched: Watched, gate: Gate) -> None:
    page = watched.page
    page.get_by_role("tab", name="Ask").click()
    expect(page.locator("#cost")).to_contain_text("20 images × 6 copies × 31 questions")
    page.get_by_role("button", name="Advanced: copies of each image").click()
    page.get_by_role("slider", name="Copies of each image").focus()
    for key, n in (("ArrowRight", 8), ("ArrowLeft", 6)):
        page.keyboard.press(key)
        page.keyboard.press(key)
        expect(page.locator("#cost")).to_contain_text(f"20 images × {n} copies × 31 questions")
    choose_model(page)
    gate.opened.clear()
    page.locator("#ask-start").click()
    assert gate.reached.wait(20)
    page.reload()
    expect(page.locator("#ask-progress")).to_contain_text("of 3,720 answered")
    expect(page.locator("#ask-start")).to_be_disabled()
    watched.forget_broken_streams()
    gate.opened.set()
    expect(page.locator("#ask-progress")).to_contain_text("Done")
    expect(page.locator("#road")).to_contain_text("3,720 of 3,720 answers")


def optimize_it(page: Page) -> None:
    page.get_by_role("tab", name="Optimize").click()
    page.get_by_role("button", name="Advanced: settings of the search").click()
    expect(page.get_by_label("α, weight")).to_have_value("100")  # the settings have arrived
    type_into(page.locator("#generations input"), "15")
    page.keyboard.press("Tab")
    page.locator("#optimize-start").click()
    expect(page.locator("#optimize-note")).to_contain_text("Done")
    # 15 generations, and a hundred steps of climbing after them
    expect(page.locator("#chart figure").first).to_have_attribute("data-generation", "115")


def look_at_results(page: Page) -> None:
    page.get_by_role("tab", name="Results").click()
    row = page.locator("#standings [data-testid^=cell]").get_by_text("s_all").first
    row.click()
    expect(page.locator("#train-missed .ev-title")).to_contain_text("s_all")
    expect(page.locator("#standings")).not_to_contain_text("test, positive")
    expect(page.locator("#test-missed .ev-title")).to_be_hidden()
    page.locator("#look").click()
    expect(page.locator("#look")).to_contain_text("looked at once")
    expect(page.locator("#standings")).to_contain_text("test, positive")
    expect(page.locator("#sentences")).to_contain_text("of 10 test images")
    row.click()
    expect(page.locator("#test-missed .ev-title")).to_contain_text("s_all")
    pick_questions(page)


def pick_questions(page: Page) -> None:
    """With the mouse, and with the keyboard."""
    page.get_by_role("button", name="Which questions are good").click()
    cell = page.locator("#heatmap button").first
    cell.click()
    expect(page.locator("#question-answers article")).to_have_count(10)
    cell.press("ArrowRight")
    expect(page.locator("#heatmap button").nth(1)).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.locator("#question-answers .ev-title")).to_contain_text("refrigerator")


def download(page: Page) -> bytes:
    page.get_by_role("tab", name="Recognizer").click()
    with page.expect_download() as incoming:
        page.get_by_role("link", name="Download the recognizer").click()
    assert incoming.value.suggested_filename == "refrigerator s_plus.json"
    return Path(incoming.value.path()).read_bytes()


def try_a_picture(page: Page, file: Path) -> None:
    page.locator("#verdict input[type=file]").set_input_files(file)
    expect(page.locator("#verdict .vd-state")).to_have_text(re.compile("open|closed|unknown"))


def walk_alone(folder: Path) -> dict[Objective, bytes]:
    """The same road without the app."""
    project, model = Project.open(folder), ScriptedModel(says)
    project.model, project.fingerprint = model.name, model.fingerprint
    project.search = type(project.search)(generations=15)
    deque(ask(project, model), maxlen=0)
    deque(optimize(project), maxlen=0)
    return {one: recognizer_path(project, one).read_bytes() for one in Objective}
