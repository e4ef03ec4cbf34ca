"""Which models can be picked: those that are usable, presets, and what a server has."""

from typing import Any

import gradio as gr

from vqa_state import models
from vqa_state.errors import ModelError
from vqa_state.models.address import Source
from vqa_state.models.approval import approved
from vqa_state.models.presets import PRESETS
from vqa_state.models.server.served_models import offered
from vqa_state.models.server.url import ServerURL
from vqa_state.web import arguments
from vqa_state.web.session import Desk
from vqa_state.web.view_data import note

__all__ = ["list_offers", "listed", "server_alone", "which_model"]


def listed(current: str) -> list[tuple[str, str]]:
    """Titles and names: what is usable, the project's own, then the presets."""
    own = [(name, name) for name in (*models.names(), *approved())]
    known = {name for _, name in own}
    if current and current not in known:
        own.append((current, current))
    presets = [
        (f"{one.title} ({one.address})", one.address)
        for one in PRESETS
        if one.address not in known and one.address != current
    ]
    return own + presets


def server_alone(name: str) -> str | None:
    """The URL of a server's address that does not say which model; None for all others."""
    kind, _, rest = name.strip().partition(":")
    return rest if kind == Source.SERVER and "#" not in rest else None


def which_model(url: str) -> tuple[Any, bool]:
    """What to say of a server whose model is not named yet, and whether it can be asked."""
    try:
        server = ServerURL.parse(url)
    except ModelError as error:
        return note(f"{error}.", "warn"), False
    words = (
        f"Which model of {server}? Type #MODEL behind it, or ask it for its list with the button: "
        "no picture is sent for that."
    )
    return note(words, "warn"), True


def list_offers(_desk: Desk, _pid: str, model: Any) -> Any:
    """Ask a server for its models, which the click allows, and offer them for choice."""
    name = arguments.text(model, "the model")
    url = server_alone(name)
    if url is None:
        raise ModelError("only a server has a list of models: server:http://host:port/v1")
    found = offered(url)
    if not found:
        return note(f"{url} offers no model.", "warn"), gr.Dropdown()
    names = ", ".join(one.partition("#")[2] for one in found)
    choices = [(one, one) for one in found]
    others = [(title, one) for title, one in listed(name) if one not in (*found, name)]
    return (
        note(f"It offers {names}. Pick one in the list above, then allow it."),
        gr.Dropdown([*choices, *others]),
    )
