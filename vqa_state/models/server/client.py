"""The openai client, held to what we promise of it.

By itself it adds headers from the environment, says what machine it runs on, follows redirects with
all its headers, and tries again on its own. Here one hook decides what a request carries, so a key
goes to its host and nowhere else.
"""

import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import lru_cache
from http.cookiejar import CookieJar, DefaultCookiePolicy
from typing import TYPE_CHECKING, cast

from vqa_state.models.api_keys import ApiKey
from vqa_state.models.server.url import ServerURL

if TYPE_CHECKING:
    import httpx2
    from openai import AsyncOpenAI

__all__ = ["open_client"]

#: Headers that a request may carry besides its key.
_HEADERS = {"accept", "connection", "content-length", "content-type", "host"}

#: Of a reply; an answer has some hundred bytes, a list of models some thousand.
_MAX_BYTES = 8_000_000


@asynccontextmanager
async def open_client(
    url: ServerURL, key: ApiKey | None, seconds: float
) -> AsyncIterator["AsyncOpenAI"]:
    """A client for one server, for as long as the block lasts.

    Args:
        url: where it answers.
        key: what it wants to see, if anything.
        seconds: that connecting, or a silence, may take.
    """
    import httpx2
    import openai

    transport = httpx2.AsyncClient(
        timeout=httpx2.Timeout(seconds, connect=min(seconds, 10.0)),
        follow_redirects=False,
        # None is kept: it is of no use here, and a damaged one would break every call after it.
        cookies=CookieJar(DefaultCookiePolicy(allowed_domains=[])),
        # A proxy of the environment is for other machines; this one needs none.
        trust_env=not url.is_loopback,
        verify=_trust(url.scheme),
        limits=httpx2.Limits(max_connections=None),
        event_hooks={"request": [_dresser(url, key)], "response": [_plain, _bounded]},
    )
    async with openai.AsyncOpenAI(
        api_key="none",  # the hook below holds the real one, and replaces this
        admin_api_key="",
        base_url=str(url),
        max_retries=0,
        http_client=transport,
    ) as client:
        yield client


@lru_cache(maxsize=2)  # reading all certificates takes a tenth of a second
def _trust(scheme: str) -> ssl.SSLContext:
    import httpx2

    # Over http nobody is asked for a certificate: an empty list of whom to trust does.
    plain = scheme == "http"
    return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT) if plain else httpx2.create_ssl_context()


def _dresser(url: ServerURL, key: ApiKey | None) -> Callable[["httpx2.Request"], Awaitable[None]]:
    async def dress(request: "httpx2.Request") -> None:
        for name in set(request.headers) - _HEADERS:
            del request.headers[name]
        request.headers["user-agent"] = "vqa-state"
        request.headers["accept-encoding"] = "identity"  # nothing small unpacks into much
        port = request.url.port or {"http": 80, "https": 443}.get(request.url.scheme)
        there = (request.url.scheme, request.url.host.strip("[]"), port)
        if key is not None and there == (url.scheme, url.host, url.port):
            request.headers["authorization"] = f"Bearer {key.reveal()}"

    return dress


async def _plain(response: "httpx2.Response") -> None:
    """Read it as UTF-8, whatever character set it claims: some are none, some break the reading."""
    response.encoding = "utf-8"


async def _bounded(response: "httpx2.Response") -> None:
    """Let no reply fill the memory."""
    import httpx2

    stream = cast("httpx2.AsyncByteStream", response.stream)
    request = response.request

    class Bounded(httpx2.AsyncByteStream):
        async def __aiter__(self) -> AsyncIterator[bytes]:
            size = 0
            async for part in stream:
                size += len(part)
                if size > _MAX_BYTES:
                    raise httpx2.ReadError("the reply is too long", request=request)
                yield part

        async def aclose(self) -> None:
            await stream.aclose()

    if response.headers.get("content-encoding", "identity") != "identity":
        raise httpx2.ReadError("packed, though we asked for plain", request=request)
    response.stream = Bounded()
