"""Which models outside this package the user has said yes to, on this machine.

A project or a recognizer that somebody sends may name any model, server or download. It is used
only after the user said so: by typing it, by choosing it in the app, or by `models approve`.
"""

import json
import os
from dataclasses import replace
from pathlib import Path

from platformdirs import user_data_path

from vqa_state.errors import ModelError, NotApprovedError
from vqa_state.models.address import ModelAddress, Source
from vqa_state.storage.atomic_write import write_atomically

__all__ = [
    "approve",
    "approved",
    "check_approved",
    "data_folder",
    "from_anywhere",
    "is_approved",
    "withdraw",
]


def data_folder() -> Path:
    """Where this program keeps what belongs to no project; VQA_STATE_HOME names another place."""
    own = os.environ.get("VQA_STATE_HOME")
    return Path(own) if own else user_data_path("vqa-state")


def approved() -> list[str]:
    """What was said yes to, sorted: addresses without settings."""
    try:
        content = json.loads(_file().read_bytes())
    except (OSError, ValueError, RecursionError):
        return []  # a lost or damaged list costs the user one more yes
    return sorted({one for one in content if isinstance(one, str)}) if _is_list(content) else []


def is_approved(address: ModelAddress) -> bool:
    """Whether the user said yes to this model; settings such as the prompt do not matter."""
    return _plain(address) in approved()


def approve(address: ModelAddress) -> None:
    """Remember the user's yes.

    Raises:
        ProjectError: if it cannot be written.
    """
    _write({*approved(), _plain(address)})


def withdraw(address: ModelAddress) -> None:
    """Forget the user's yes.

    Raises:
        ModelError: if there was none.
        ProjectError: if it cannot be written.
    """
    if not is_approved(address):
        raise ModelError(f"{_plain(address)} was not approved; `models list` shows what is")
    _write({*approved()} - {_plain(address)})


def check_approved(address: ModelAddress) -> None:
    """Do nothing for a model that the user said yes to.

    Raises:
        NotApprovedError: for all others; the message says how to say yes.
    """
    if not is_approved(address):
        raise NotApprovedError(str(address), _plain(address))


def from_anywhere(address: ModelAddress) -> ModelAddress:
    """The same model, named so that it is the same one in whatever folder the program starts."""
    if address.source is not Source.FOLDER or address.where.startswith("~"):
        return address
    return replace(address, where=str(Path(address.where).absolute()))


def _plain(address: ModelAddress) -> str:
    return str(from_anywhere(ModelAddress(address.source, address.where, address.model)))


def _file() -> Path:
    return data_folder() / "approved_models.json"


def _write(names: set[str]) -> None:
    write_atomically(_file(), (json.dumps(sorted(names), indent=1) + "\n").encode())


def _is_list(content: object) -> bool:
    return isinstance(content, list)
