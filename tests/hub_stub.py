"""A hub on this machine: two small models, one of them behind a licence; slow if told so."""

import hashlib
import json
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

COMMIT = "c" * 40


class Handler(BaseHTTPRequestHandler):
    def log_message(self, *args):
        pass

    def do_HEAD(self):
        self._serve(with_body=False)

    def do_GET(self):
        self._serve(with_body=True)

    def _serve(self, *, with_body):
        hub = self.server.hub
        path = self.path.partition("?")[0]
        if path.startswith("/api/models/"):
            self._info(path.removeprefix("/api/models/").partition("/revision/")[0])
            return
        name, _, rest = path.strip("/").partition("/resolve/")
        data = hub.models.get(name, {}).get(rest.partition("/")[2])
        if data is None:
            self._send(404, b"", {"X-Error-Code": "EntryNotFound"})
            return
        hub.downloads += [rest.partition("/")[2]] if with_body else []
        headers = {
            "ETag": f'"{hashlib.sha256(data).hexdigest()}"',
            "X-Repo-Commit": COMMIT,
            "Accept-Ranges": "bytes",
        }
        start = int((self.headers.get("Range") or "bytes=0-")[6:].partition("-")[0])
        body = data[start:]
        if start:
            headers["Content-Range"] = f"bytes {start}-{len(data) - 1}/{len(data)}"
        self._send(206 if start else 200, body, headers, with_body, hub.pause)

    def _info(self, name):
        hub = self.server.hub
        refused = (403, "GatedRepo") if name in hub.gated else (404, "RepoNotFound")
        if name in hub.gated or name not in hub.models:
            self._send(refused[0], b"{}", {"X-Error-Code": refused[1]})
            return
        files = [{"rfilename": f, "size": len(d)} for f, d in hub.models[name].items()]
        info = {"id": name, "modelId": name, "sha": COMMIT, "siblings": files, "tags": []}
        self._send(200, json.dumps(info).encode(), {"Content-Type": "application/json"})

    def _send(self, status, body, headers, with_body=True, pause=0.0):
        self.send_response(status)
        for key, value in headers.items():
            self.send_header(key, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        try:
            for start in range(0, len(body) if with_body else 0, 65536):
                self.wfile.write(body[start : start + 65536])
                time.sleep(pause)
        except OSError:
            pass  # the one who downloads was stopped


class Hub:
    """Use it with `with`; `models` maps a name to its files."""

    def __init__(self, models, gated=()):
        self.models, self.gated = models, set(gated)
        self.downloads = []
        self.pause = 0.0

    def __enter__(self):
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._server.block_on_close = False
        self._server.hub = self
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}"
        threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True).start()
        return self

    def __exit__(self, *_):
        self._server.shutdown()
        self._server.server_close()
