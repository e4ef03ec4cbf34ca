"""app: opens the web app."""

import os
from pathlib import Path
from typing import Annotated

import typer

from vqa_state.cli.options import app
from vqa_state.cli.picking import given_path
from vqa_state.errors import require_package
from vqa_state.models.approval import data_folder

__all__ = ["app_command"]


@app.command("app")
def app_command(
    projects: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            parser=given_path,
            help="Where your projects are; else your own data folder, which is printed.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65_535, help="0 takes any free one.")] = 7860,
    host: Annotated[
        str,
        typer.Option(
            help="Address to listen on; another than this machine's own opens the app to all who "
            "can reach it."
        ),
    ] = "127.0.0.1",
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Do not open a browser.")
    ] = False,
) -> None:
    """Open the web app in a browser; it stays on this machine until Ctrl-C stops it."""
    for package in ("gradio", "fastapi", "uvicorn"):
        require_package(package, "the app")
    os.environ["GRADIO_ANALYTICS_ENABLED"] = "False"  # read when gradio is imported: nothing leaves
    from vqa_state.web.server import serve

    folder = data_folder() / "projects" if projects is None else projects
    raise typer.Exit(serve(folder, host=host, port=port, browser=not no_browser))
