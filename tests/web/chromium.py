"""The app in Chromium, for the tests of its page.

They fail without Chromium: CHROMIUM names another path than /usr/bin/chromium.
"""

import os
import socket
import threading
from collections.abc import Iterator
from typing import Any

import pytest
import uvicorn
from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

from vqa_state.testing.fake_model import ScriptedModel
from vqa_state.web.server import build_app
from vqa_state.web.session import Desk

CHROMIUM = os.environ.get("CHROMIUM", "/usr/bin/chromium")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
BROKEN_STREAM = (
    "console: AbortError: signal is aborted",
    "console: Unexpected error Connection errored out",
    "console: Connection errored out",
)
WAIT = 60_000
expect.set_options(timeout=WAIT)

pytestmark = [
    # gradio's own: it leaves an event loop to the garbage collector, and calls pandas the old way
    pytest.mark.filterwarnings(
        "ignore:.*unclosed event loop:pytest.PytestUnraisableExceptionWarning"
    ),
    pytest.mark.filterwarnings("ignore:.*no_silent_downcasting"),
    pytest.mark.filterwarnings("ignore:The copy keyword is deprecated"),
]


@pytest.fixture
def url(desk: Desk, scripted: ScriptedModel) -> Iterator[str]:
    """The app, served in a thread."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        config = uvicorn.Config(build_app(desk), log_level="error", timeout_graceful_shutdown=1)
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        server.should_exit = True
        thread.join(20)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield running
        running.close()


class Watched:
    """A page that remembers what it must never do."""

    def __init__(self, browser: Browser, url: str) -> None:
        self.page = browser.new_page(accept_downloads=True)
        self.page.set_default_timeout(WAIT)
        self.faults: list[str] = []
        self.page.on("pageerror", lambda error: self.faults.append(f"script: {error}"))
        self.page.on("console", self._console)
        self.page.on("request", lambda request: self._request(request.url, url))

    def forget_broken_streams(self) -> None:
        """A page that goes away complains of its streams; that is no fault of the next one."""
        self.faults = [fault for fault in self.faults if not fault.startswith(BROKEN_STREAM)]

    def _console(self, message: Any) -> None:
        if message.type == "error":
            self.faults.append(f"console: {message.text}")

    def _request(self, asked: str, url: str) -> None:
        if not asked.startswith((url, "data:", "blob:")):
            self.faults.append(f"request to another host: {asked}")


def open_tab(page: Page, address: str, selector: str) -> None:
    page.goto(address)
    expect(page.locator(selector).first).to_be_visible(timeout=WAIT)
    expect(page.locator("#road")).to_contain_text("Next:")


def type_into(field: Locator, text: str) -> None:
    """Type into a field that has only just come to be seen.

    Gradio gives such a field its value a second time when the page has settled, in place of what
    a script typed meanwhile (a person is not that fast). So wait for that, and look.
    """
    for _ in range(20):
        field.fill(text)
        field.page.evaluate("new Promise(settled => requestIdleCallback(settled))")
        field.page.wait_for_timeout(500)
        if field.input_value() == text:
            return
    raise AssertionError(f"the field does not keep {text!r}")
