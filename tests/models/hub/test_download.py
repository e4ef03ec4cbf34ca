"""A download lives no longer than the program that began it, however that ends."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

#: Begins a download and says the process id of its child.
PARENT = textwrap.dedent("""
    import subprocess
    from vqa_state.models.hub import snapshots as hub
    from vqa_state.models.address import ModelAddress

    class Said(subprocess.Popen):
        def __init__(self, *arguments, **more):
            super().__init__(*arguments, **more)
            print(self.pid, flush=True)

    hub.subprocess.Popen = Said
    for _ in hub.download(ModelAddress.parse("hub:us/silent")):
        pass
""")


class Silent(BaseHTTPRequestHandler):
    """Takes a request and never answers it."""

    def do_GET(self):
        self.server.asked.set()
        self.server.over.wait(60)

    def log_message(self, *arguments):
        pass


@pytest.fixture
def hub():
    """A hub that says nothing."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Silent)
    server.asked, server.over = threading.Event(), threading.Event()
    server.daemon_threads, server.block_on_close = True, False
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    yield server
    server.over.set()
    server.shutdown()
    server.server_close()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")
@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_a_download_ends_with_its_program(hub, tmp_path, end):
    place = {"HF_HUB_CACHE": str(tmp_path), "HF_HUB_DISABLE_XET": "1"}
    place["HF_ENDPOINT"] = f"http://127.0.0.1:{hub.server_address[1]}"
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True, env=os.environ | place
    )
    with parent:
        child = int(parent.stdout.readline())
        try:
            assert hub.asked.wait(60)
            parent.send_signal(end)
            parent.wait(10)
            until = time.monotonic() + 5
            while lives(child) and time.monotonic() < until:
                time.sleep(0.05)
            assert not lives(child)
        finally:
            if lives(child):
                os.kill(child, signal.SIGKILL)


def lives(pid):
    """Whether it runs; one that ended and that nobody waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
