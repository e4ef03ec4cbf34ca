"""The server behind the app: one FastAPI app with our routes and gradio's page, under the guard."""

import argparse
import errno
import socket
import sys
import threading
import webbrowser
from collections.abc import Sequence
from pathlib import Path

import gradio as gr
import uvicorn
from fastapi import FastAPI
from starlette.types import ASGIApp

from vqa_state.errors import VQAStateError
from vqa_state.images import MAX_BYTES
from vqa_state.web import layout
from vqa_state.web.routes import explain, routes
from vqa_state.web.security import LocalGuard
from vqa_state.web.session import Desk

__all__ = ["build_api", "build_app", "main", "serve"]


def build_api(desk: Desk) -> FastAPI:
    """Our own routes alone, without the page and without the guard."""
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    app.add_exception_handler(VQAStateError, explain)
    app.include_router(routes(desk))
    return app


def build_app(desk: Desk, hosts: Sequence[str] = ()) -> ASGIApp:
    """The whole app, for the projects on this desk; `hosts` are further names of this machine."""
    app = build_api(desk)
    gr.mount_gradio_app(
        app, layout.build(desk), path="/",
        theme=layout.theme(), css_paths=[layout.STYLE],
        js=layout.SCRIPT.read_text(encoding="utf-8"),
        max_file_size=MAX_BYTES,
        footer_links=[], run_history=False, show_error=False, enable_monitoring=False,
    )  # fmt: skip
    return LocalGuard(app, hosts)


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until interrupted, as a command line says; the exit status."""
    options = _options(arguments)
    return serve(
        options.projects, host=options.host, port=options.port, browser=not options.no_browser
    )


def serve(projects: Path, *, host: str = "127.0.0.1", port: int = 7860, browser: bool) -> int:
    """Serve until interrupted; the exit status.

    Args:
        projects: folder of the projects; it is made if it does not exist.
        host: address to listen on.
        port: 0 takes any free one.
        browser: whether to open one.
    """
    try:
        projects.mkdir(parents=True, exist_ok=True)
        listener = _listen(host, port)
    except OSError as error:
        print(f"The app cannot start: {_reason(projects, host, port, error)}", file=sys.stderr)
        return 1
    shown = f"[{host}]" if ":" in host else host
    address = f"http://{shown}:{listener.getsockname()[1]}/"
    app = build_app(Desk(projects), [shown])
    print(f"The app is open at {address} (stop it with Ctrl+C).", flush=True)
    print(f"Your projects are in {projects.resolve()}.", flush=True)
    if browser:
        threading.Thread(target=webbrowser.open, args=[address], daemon=True).start()
    uvicorn.Server(uvicorn.Config(app, log_level="warning")).run(sockets=[listener])
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Open the web app.")
    parser.add_argument("--port", type=_port, default=7860, help="0 takes any free one")
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen on; another than this machine's "
        "own opens the app to all who can reach it",
    )  # fmt: skip
    parser.add_argument("--projects", type=Path, default=Path("projects"), metavar="DIR")
    parser.add_argument("--no-browser", action="store_true", help="do not open a browser")
    return parser.parse_args(arguments)


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65_535:
        raise argparse.ArgumentTypeError(f"the port must be a number from 0 to 65535, got {text!r}")
    return int(text)


def _listen(host: str, port: int) -> socket.socket:
    """Take the port before anything slow, so that a taken one is said at once."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen()
    except OSError:
        listener.close()
        raise
    return listener


def _reason(projects: Path, host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return (
            f"port {port} is taken, perhaps by this app in another window; stop that one, or "
            f"choose another port with --port {port + 1}"
        )
    if isinstance(error, FileExistsError | NotADirectoryError):
        return f"{projects} is a file, or lies in one; name a folder with --projects DIR"
    return f"{error.strerror or error} (host {host}, port {port}, {projects})"
