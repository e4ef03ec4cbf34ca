"""A server on this machine that answers like a chat server, or misbehaves as its test says."""

import json
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class Call:
    """One request as it came."""

    path: str
    headers: dict[str, str]
    body: dict
    began: float
    number: int
    ended: float = 0.0

    @property
    def question(self) -> str:
        return self.body["messages"][0]["content"][-1]["text"]


@dataclass
class Result:
    """What is sent back: a status, headers and a body (text, bytes, or what becomes JSON)."""

    body: object
    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)


Script = Callable[[Call, "Handler"], Result | None]


def completion(text: object, **choice) -> dict:
    """The body of a good answer."""
    message = {"role": "assistant", "content": text}
    return {"choices": [{"index": 0, "finish_reason": "stop", "message": message, **choice}]}


def good(call: Call, handler: "Handler") -> Result:
    """Yes to all."""
    return Result(completion("Yes."))


class Handler(BaseHTTPRequestHandler):
    """Hands every request to the server's script; None means that the script sent all itself."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True  # or each answer waits 40 ms for the system

    def log_message(self, *args):
        pass

    def do_GET(self):
        self._serve()

    def do_POST(self):
        self._serve()

    def _serve(self):
        stub = self.server.stub
        raw = self.rfile.read(int(self.headers.get("content-length", 0)))
        headers = {name.lower(): value for name, value in self.headers.items()}
        call = stub.began(self.path, headers, json.loads(raw) if raw else {})
        try:
            result = stub.script(call, self)
            if result is not None:
                self.send(result)
        except OSError:  # the caller went away
            self.close_connection = True
        finally:
            stub.ended(call)

    def send(self, result: Result):
        body = result.body
        if not isinstance(body, bytes):
            body = (body if isinstance(body, str) else json.dumps(body)).encode()
        self.head(result.status, len(body), **result.headers)
        self.wfile.write(body)

    def head(self, status: int, length: int, **headers: str):
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), value)
        self.send_header("content-length", str(length))
        self.end_headers()

    def reset(self):
        """Break the connection off, so that the caller's system sees a reset."""
        linger = struct.pack("ii", 1, 0)
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self.connection.close()
        self.close_connection = True


class Stub:
    """The server; use it with `with`. `script` may be changed while it runs.

    Attributes:
        calls: all requests, in order.
        most_at_once: requests that were open together, at most.
    """

    def __init__(self, script: Script = good, port: int = 0) -> None:
        self.script = script
        self.port = port
        self.calls: list[Call] = []
        self.most_at_once = 0
        self._open = 0
        self._lock = threading.Lock()

    def __enter__(self) -> "Stub":
        self._server = ThreadingHTTPServer(("127.0.0.1", self.port), Handler)
        self._server.daemon_threads = True
        self._server.block_on_close = False
        self._server.handle_error = lambda *args: None
        self._server.stub = self
        self.port = self._server.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/v1"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.02,), daemon=True
        )
        self._thread.start()
        return self

    def __exit__(self, *args: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def began(self, path: str, headers: dict[str, str], body: dict) -> Call:
        with self._lock:
            self._open += 1
            self.most_at_once = max(self.most_at_once, self._open)
            self.calls.append(Call(path, headers, body, time.monotonic(), len(self.calls)))
            return self.calls[-1]

    def ended(self, call: Call) -> None:
        with self._lock:
            self._open -= 1
            call.ended = time.monotonic()


def free_port() -> int:
    """A port where nothing listens now."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
