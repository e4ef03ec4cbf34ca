"""Keys of servers: from the environment alone, and each only to the host that it was set for.

    VQA_STATE_KEYS="api.example.com=KEY1;localhost:8000=KEY2"    host=key or host:port=key
    OPENAI_API_KEY=KEY3                                          for api.openai.com alone

A key is never written anywhere, and no error shows one.
"""

import os
import re
import unicodedata
from collections.abc import Mapping

from vqa_state.errors import ModelError
from vqa_state.models.server.url import ServerURL

__all__ = ["ApiKey", "key_for", "plain_text", "without_keys"]

_VARIABLE = "VQA_STATE_KEYS"
_OPENAI_HOST = "api.openai.com"

#: What a header can carry; a line break in a key would add a header of its own.
_USABLE = re.compile(r"[\x21-\x7e]+")

#: What looks like a key, whoever it belongs to; servers like to repeat parts of one.
_LOOKS_LIKE_A_KEY = re.compile(r"(?i)\bbearer\s+\S+|\b(?:(?:sk|gsk|xai|key|pk)[-_]|hf_)[\w.*-]{4,}")


class ApiKey:
    """A key that does not show itself when it is printed, logged or pickled."""

    __slots__ = ("__value",)

    def __init__(self, value: str) -> None:
        self.__value = value

    def reveal(self) -> str:
        """The key itself; for the header of a request only."""
        return self.__value

    def __repr__(self) -> str:
        return "ApiKey(…)"

    def __reduce__(self) -> str:
        raise TypeError("a key is not written anywhere")


def key_for(url: ServerURL, environment: Mapping[str, str] = os.environ) -> ApiKey | None:
    """The key that was set for this server, or None.

    An entry with the port goes before one without; one without is for every port of its host.

    Raises:
        ModelError: if `VQA_STATE_KEYS` cannot be read, or the key would go unencrypted over a
            network.
    """
    keys = _keys(environment)
    value = keys.get((url.host, url.port)) or keys.get((url.host, None))
    if value is None:
        return None
    if url.scheme != "https" and not url.is_loopback:
        raise ModelError(
            f"the key set for {url.host} would go there unencrypted; use "
            f"https://{url.shown_host}, or take the host out of {_VARIABLE} if it needs no key"
        )
    return ApiKey(value)


def without_keys(text: str, key: ApiKey | None = None, longest: int = 200) -> str:
    """A foreign text made fit to show: one short line without control characters or keys.

    Args:
        text: what a server said.
        key: the one that it was sent.
        longest: characters that are left, at most.
    """
    shown = plain_text(text, key)  # before anything is cut: half a key is still a secret
    shown = " ".join(_LOOKS_LIKE_A_KEY.sub("[key]", shown).split())
    return shown if len(shown) <= longest else shown[: longest - 1] + "…"


def plain_text(text: str, key: ApiKey | None = None) -> str:
    """A foreign text in one line, without control characters and without the key."""
    shown = "".join(
        " " if character.isspace() else character
        for character in text
        if character.isspace() or not unicodedata.category(character).startswith("C")
    )
    if key is None:
        return shown
    return re.sub(re.escape(key.reveal()), "[key]", shown, flags=re.IGNORECASE)


def _keys(environment: Mapping[str, str]) -> dict[tuple[str, int | None], str]:
    """(host, port or None) -> key."""
    keys: dict[tuple[str, int | None], str] = {}
    openai = environment.get("OPENAI_API_KEY", "").strip()
    if openai:
        keys[_OPENAI_HOST, None] = _checked(openai, "OPENAI_API_KEY")
    for number, entry in enumerate(environment.get(_VARIABLE, "").split(";"), 1):
        if not entry.strip():
            continue
        place, equals, value = entry.partition("=")
        try:
            url = ServerURL.parse(f"https://{place.strip()}")
        except ModelError:
            url = None
        if not equals or url is None or url.path or not value.strip():
            raise ModelError(
                f"entry {number} of {_VARIABLE} is not host=key or host:port=key; "
                "entries are parted by semicolons"
            )
        has_port = place.strip().lower().removeprefix(url.shown_host).startswith(":")
        key = _checked(value.strip(), f"entry {number} of {_VARIABLE}")
        keys[url.host, url.port if has_port else None] = key
    return keys


def _checked(value: str, where: str) -> str:
    if not _USABLE.fullmatch(value):
        raise ModelError(f"the key in {where} holds characters that no key has; copy it again")
    return value
