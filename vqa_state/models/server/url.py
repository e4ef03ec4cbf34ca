"""A server's address, taken apart once, so that every part of the program sees the same host."""

import ipaddress
import re
from dataclasses import dataclass
from urllib.parse import urlsplit

from vqa_state.errors import ModelError

__all__ = ["ServerURL"]

_HOST = re.compile(r"[a-z0-9]([a-z0-9._-]*[a-z0-9])?")
_PATH = re.compile(r"(/[A-Za-z0-9._~:+=-]+)*")
_PORTS = {"http": 80, "https": 443}


@dataclass(frozen=True, slots=True)
class ServerURL:
    """Where a server answers; `str(url)` is the same for every spelling of the same place.

    Attributes:
        scheme: http or https.
        host: a name in lower case, or an address without brackets.
        port: always a number.
        path: without a slash at its end, such as "/v1".
    """

    scheme: str
    host: str
    port: int
    path: str

    def __str__(self) -> str:
        port = "" if self.port == _PORTS[self.scheme] else f":{self.port}"
        return f"{self.scheme}://{self.shown_host}{port}{self.path}"

    @property
    def shown_host(self) -> str:
        """The host as it stands in an address: IPv6 in brackets."""
        return f"[{self.host}]" if ":" in self.host else self.host

    @property
    def is_loopback(self) -> bool:
        """Whether the server is on this machine, so that nothing crosses a network."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @classmethod
    def parse(cls, text: str) -> "ServerURL":
        """Read a URL; anything that two programs could read differently is refused.

        Raises:
            ModelError: if it is no plain http or https address; it is not repeated in full, for
                it may hold a password.
        """
        try:
            parts = urlsplit(text)
            scheme, host, port = parts.scheme, parts.hostname or "", parts.port
        except ValueError:
            scheme, host, port = "", "", None
        if scheme not in _PORTS:
            raise ModelError(
                "a server's address begins with http:// or https:// and looks like "
                "http://127.0.0.1:8000/v1"
            )
        path = parts.path.rstrip("/")
        plain_host = _is_address(host) if ":" in host else bool(_HOST.fullmatch(host))
        plain = plain_host and _PATH.fullmatch(path) and not set("@?#\\") & set(parts.netloc)
        if not plain or parts.query or parts.fragment or port == 0:
            raise ModelError(
                f"cannot use this {scheme} address of a server; write its host, port and path "
                "alone, as in http://127.0.0.1:8000/v1, without a user, a key or a query"
            )
        return cls(scheme, host, port or _PORTS[scheme], path)


def _is_address(host: str) -> bool:
    try:
        ipaddress.IPv6Address(host)
    except ValueError:
        return False
    return "%" not in host
