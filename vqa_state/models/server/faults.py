"""What can go wrong with one call to a server: a plain sentence, and whether to try again."""

import ssl
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from enum import StrEnum
from socket import gaierror
from typing import TYPE_CHECKING, Any

from vqa_state.models.api_keys import ApiKey, without_keys
from vqa_state.models.server.url import ServerURL

if TYPE_CHECKING:
    from openai import APIConnectionError, APIStatusError

__all__ = [
    "Fault",
    "Reach",
    "body_fault",
    "connection_fault",
    "not_understood",
    "retry_after",
    "status_fault",
    "unforeseen",
]


class Reach(StrEnum):
    """What a fault is good for."""

    PASSING = "passing"
    """The same call may work in a moment."""
    GONE = "gone"
    """So may this; but if it stays, no other call will work either."""
    ANSWER = "answer"
    """This call will not work, others may."""
    ALL = "all"
    """No call will work before somebody changes something; `Doubt` says when to believe it."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Why a call gave no answer.

    Attributes:
        sentence: for the user; without keys.
        reach: what else it touches.
        wait: seconds that the server asks to wait before the next call, or None.
        status: of HTTP, or 0 where none came.
        said: what the server said, cleaned.
    """

    sentence: str
    reach: Reach
    wait: float | None = None
    status: int = 0
    said: str = ""


def connection_fault(error: "APIConnectionError", url: ServerURL) -> Fault:
    """Nobody there, cut off in the middle, no such host, a certificate that is not trusted."""
    import httpx2

    causes = list(_causes(error))
    if any(isinstance(cause, ssl.SSLError) for cause in causes):
        sentence = f"{url} has no certificate that this machine trusts, or speaks http only"
        return Fault(sentence, Reach.ALL)
    if any(isinstance(cause, gaierror) for cause in causes):
        sentence = f"there is no host named {url.host}, or no network; check the address"
        return Fault(sentence, Reach.GONE)
    if any(isinstance(cause, httpx2.ConnectError | httpx2.ConnectTimeout) for cause in causes):
        sentence = f"nothing answers at {url}; start the server or check its address, and ask again"
        return Fault(sentence, Reach.GONE)
    return Fault(f"{url} broke the connection off before its answer was whole", Reach.PASSING)


def status_fault(error: "APIStatusError", url: ServerURL, model: str, key: ApiKey | None) -> Fault:
    """A status that is not success, with what the server says of it.

    Args:
        error: of the openai client; it may hold keys, so it is never shown itself.
        url: where the call went.
        model: that was asked, or "" for a call that needs none.
        key: that the server was sent.
    """
    wait = retry_after(error.response.headers.get("retry-after"))
    return _status_fault(
        error.status_code, without_keys(_message(error.body), key), url, model, key, wait
    )


def body_fault(body: dict[str, Any], url: ServerURL, model: str, key: ApiKey | None) -> Fault:
    """Success by its status, and an error by its words; a code among them counts as the status."""
    said = without_keys(_message(body), key)
    status = _code(body)
    if status:
        return _status_fault(status, said, url, model, key)
    if not said:
        return Fault(f"{url} sent no answer (no choices)", Reach.PASSING)
    sentence = f"{url} sent an error instead of an answer ({said}){_v1_hint(url)}"
    return Fault(sentence, Reach.ANSWER, said=said)


def _status_fault(
    status: int,
    said: str,
    url: ServerURL,
    model: str,
    key: ApiKey | None,
    wait: float | None = None,
) -> Fault:
    quoted = f"{status}: {said}" if said else f"{status}"
    reach, sentence = Reach.ANSWER, f"{url} did not accept the question ({quoted})"
    if status == 401:  # what it says here and below often repeats a part of the key
        reach, sentence = Reach.ALL, _about_keys(url, status, key)
    elif status == 403:  # for these words or this image, or for all
        sentence = _about_rules(url, status, key)
    elif status in (404, 405):
        reach, sentence = Reach.ALL, _about_places(url, model, quoted)
    elif 300 <= status < 400:
        reach, sentence = Reach.ALL, _about_redirects(url, status)
    elif status == 429:
        sentence = f"{url} has too many requests now ({quoted}); ask again later"
        reach = Reach.PASSING
    elif status in (408, 409, 425) or (status >= 500 and status != 501):
        served = f", and check that it serves a model named {model}" if model else ""
        reach, sentence = Reach.PASSING, f"{url} failed ({quoted}); see its own log{served}"
    return Fault(sentence, reach, wait if reach is Reach.PASSING else None, status, said)


def not_understood(url: ServerURL, what: str = "something that is no JSON") -> Fault:
    """Success by its status, and yet nothing that could be read."""
    sentence = f"{url} sent {what} instead of an answer; check the address{_v1_hint(url)}"
    return Fault(sentence, Reach.PASSING)


def unforeseen(error: Exception, url: ServerURL) -> Fault:
    """What broke while a reply was read; its words may be the server's, so they are not shown."""
    return Fault(f"the reply of {url} cannot be read ({type(error).__name__})", Reach.PASSING)


def retry_after(header: str | None, now: datetime | None = None) -> float | None:
    """Seconds to wait, at least 0, from seconds or an HTTP date; None where it says nothing.

    Source: RFC 9110, section 10.2.3.
    """
    if header is None:
        return None
    text = header.strip()
    if text.replace(".", "", 1).isascii() and text.replace(".", "", 1).isdigit():
        return float(text)
    try:
        when = parsedate_to_datetime(text)
    except (ValueError, OverflowError):
        return None
    when = when if when.tzinfo else when.replace(tzinfo=UTC)
    return max(0.0, (when - (now or datetime.now(UTC))).total_seconds())


def _about_keys(url: ServerURL, status: int, key: ApiKey | None) -> str:
    place = f"{url.shown_host}:{url.port}"
    if key is None:
        return (
            f"{url} wants a key ({status}); set it in the environment before starting this "
            f'program: VQA_STATE_KEYS="{place}=KEY"'
        )
    return (
        f"{url} does not accept the key that is set for it ({status}); set another one, or one "
        f'that may use this model: VQA_STATE_KEYS="{place}=KEY"'
    )


def _about_rules(url: ServerURL, status: int, key: ApiKey | None) -> str:
    place = f"{url.shown_host}:{url.port}"
    other = "it may want a key" if key is None else "the key set for it may not use this model"
    return (
        f"{url} refused this call ({status}): its rules may forbid the question or the image; or, "
        f'if it refuses all, {other}, set in the environment: VQA_STATE_KEYS="{place}=KEY"'
    )


def _about_places(url: ServerURL, model: str, quoted: str) -> str:
    what = f"model named {model}, or no chat completions" if model else "list of models"
    return f"{url} has no {what} under this address ({quoted}){_v1_hint(url)}"


def _about_redirects(url: ServerURL, status: int) -> str:
    return (
        f"{url} sends its callers to another address ({status}), which is not followed, so that "
        "nothing goes to a host that you did not name; give the final address"
    )


def _v1_hint(url: ServerURL) -> str:
    return "" if "/v1" in url.path else f"; most servers answer under {url}/v1, with /v1 at the end"


def _message(body: Any) -> str:
    """The human part of an error's body, in the shapes that servers give it."""
    for _ in range(3):
        if not isinstance(body, dict):
            break
        body = next((body[name] for name in ("error", "message", "detail") if body.get(name)), "")
    text = body if isinstance(body, str) else "" if body is None else repr(body)
    return "a web page instead of an answer" if text.lstrip()[:1] == "<" else text[:20_000]


def _code(body: dict[str, Any]) -> int:
    """An HTTP status that stands in an error's body; 0 if none does."""
    inner = body.get("error")
    places = (inner if isinstance(inner, dict) else {}, body)
    for value in (place.get(name) for place in places for name in ("code", "status")):
        digits = str(value) if isinstance(value, int | str) else ""
        if len(digits) == 3 and digits.isascii() and digits.isdigit() and digits[0] in "45":
            return int(digits)
    return 0


def _causes(error: BaseException) -> Iterator[BaseException]:
    """The error and all that it came from."""
    seen: set[int] = set()
    left: list[BaseException | None] = [error]
    while left:
        one = left.pop()
        if one is None or id(one) in seen:
            continue
        seen.add(id(one))
        yield one
        left += [one.__cause__, one.__context__]
        left += one.exceptions if isinstance(one, BaseExceptionGroup) else ()
