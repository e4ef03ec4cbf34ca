"""The door of the local app: who may talk to it, and what its pages may load.

Any web site that the user visits can send requests to 127.0.0.1. So a request must name this
machine as its Host (against DNS rebinding), and one that changes something, or wants a file of a
project, must come from our own page (against cross-site requests). Headers keep the page from
loading anything from elsewhere.
"""

from collections.abc import Iterable
from ipaddress import ip_address
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["LOCAL_HOSTS", "WILDCARDS", "LocalGuard"]

LOCAL_HOSTS = ("127.0.0.1", "localhost", "[::1]")
WILDCARDS = ("0.0.0.0", "[::]")  # noqa: S104 - what the user asked for with --host
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")

# Gradio's page evaluates templates and writes style attributes: it needs the two unsafe words.
CONTENT_SECURITY_POLICY = "; ".join(
    (
        "default-src 'self'",
        "script-src 'self' 'unsafe-inline' 'unsafe-eval'",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "media-src 'self' blob:",
        "font-src 'self' data:",
        "connect-src 'self'",
        "worker-src 'self' blob:",
        "object-src 'none'",
        "form-action 'self'",
        "frame-ancestors 'self'",
        "base-uri 'self'",
    )
)
HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "x-frame-options": "SAMEORIGIN",
    "content-security-policy": CONTENT_SECURITY_POLICY,
}


class LocalGuard:
    """ASGI middleware that refuses foreign hosts and cross-site writes, and adds headers."""

    def __init__(self, app: ASGIApp, hosts: Iterable[str] = ()) -> None:
        self.app = app
        self.hosts = frozenset({*LOCAL_HOSTS, *hosts})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the request pass, or answer 403."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
        elif scope["type"] == "http":
            refusal = self.refusal(scope["method"], scope["path"], Headers(scope=scope))
            app = PlainTextResponse(refusal, status_code=403) if refusal else self.app
            await app(scope, receive, _with_headers(send))
        # The app has no web sockets: whatever else comes is left unanswered.

    def refusal(self, method: str, path: str, headers: Headers) -> str:
        """Why this request may not pass, or an empty string."""
        host = headers.get("host", "")
        if not self._is_ours(_without_port(host)):
            return "refused: this app answers only to the address it was opened with"
        if method in SAFE_METHODS:
            foreign = headers.get("sec-fetch-site") == "cross-site"
            reads_files = foreign and path.startswith("/projects/")
            return "refused: another web site asks for a project's file" if reads_files else ""
        origin = headers.get("origin")
        foreign = origin is not None and urlsplit(origin).netloc != host
        if foreign or headers.get("sec-fetch-site") in ("cross-site", "same-site"):
            return "refused: another web site sent this request"
        return ""

    def _is_ours(self, host: str) -> bool:
        """A page can rebind a name to this machine, but not a number."""
        open_to_all = not self.hosts.isdisjoint(WILDCARDS)
        return host in self.hosts or (open_to_all and _is_number(host))


def _is_number(host: str) -> bool:
    try:
        ip_address(host.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return True


def _without_port(host: str) -> str:
    return host if host.endswith("]") else host.rsplit(":", 1)[0]


def _with_headers(send: Send) -> Send:
    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            ours = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
            kept = [pair for pair in message["headers"] if pair[0].lower().decode() not in HEADERS]
            message["headers"] = [*kept, *ours]
        await send(message)

    return guarded
