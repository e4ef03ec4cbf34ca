"""From the body of a successful call to an answer; servers differ, so nothing is taken on trust."""

import json
import math
from typing import Any

from vqa_state.answers.answer import Answer
from vqa_state.models.address import DEFAULT_MAX_TOKENS
from vqa_state.models.api_keys import ApiKey, without_keys
from vqa_state.models.server.faults import Fault, Reach, body_fault, not_understood
from vqa_state.models.server.url import ServerURL

__all__ = ["model_names", "p_yes", "read_reply"]

#: Characters of an answer that are kept, from a server that ignores how many were asked for: at
#: least so many, and so many for every token that was asked for.
_LONGEST = 2000
_LONGEST_TOKEN = 32

#: Why an answer ended, where the length limit ended it; servers have several words for it.
_AT_LIMIT = frozenset({"length", "max_tokens", "max_output_tokens", "max_completion_tokens"})

#: Marks of a space before a word, in tokens that a server did not turn into text.
_SPACES = " \t\n▁Ġ"

#: Of the yes/no share that a token outside the list could still hold.
_UNSEEN = 0.02


def read_reply(
    body: str,
    url: ServerURL,
    key: ApiKey | None = None,
    model: str = "",
    max_tokens: int = DEFAULT_MAX_TOKENS,
) -> Answer | Fault:
    """The answer in a body of chat completions, or what is wrong with it.

    An empty text that the length limit ended is an answer, of a model that thinks first: asking
    again would bring the same.

    Args:
        body: as it came.
        url: for the sentences.
        key: that the server was sent; should it say it, the answer that is stored does not.
        model: that was asked, for the sentences.
        max_tokens: that were asked for.
    """
    content = _object(body)
    if content is None:
        page = body.lstrip()[:1] == "<"
        return not_understood(url, "a web page") if page else not_understood(url)
    choice = _first(content.get("choices"))
    if choice is None or choice.get("error"):
        return body_fault(choice or content, url, model, key)
    message = choice.get("message")
    text = _text(message.get("content")) if isinstance(message, dict) else ""
    at_limit = str(choice.get("finish_reason")).lower() in _AT_LIMIT
    if not text.strip() and not (at_limit and _refusal(choice) is None):
        return Fault(_about_nothing(url, choice, key), Reach.ANSWER)
    said = text if key is None else text.replace(key.reveal(), "[key]")
    longest = max(_LONGEST, _LONGEST_TOKEN * max_tokens)
    return Answer(said[:longest], p_yes(choice.get("logprobs"), text), at_limit)


def p_yes(logprobs: Any, text: str) -> float | None:
    """P(yes) / (P(yes) + P(no)) at the answer's first token, all spellings together.

    Args:
        logprobs: of the choice: {"content": [{"token", "logprob", "top_logprobs": […]}, …]}.
        text: the answer; probabilities of other tokens, such as a hidden thought's, are not used.

    Returns:
        In [0, 1] in six digits; None where the server gives none, or where the list is so short
        that the side missing in it could matter.
    """
    tokens = logprobs.get("content") if isinstance(logprobs, dict) else None
    first = _first(tokens)
    token = first.get("token") if first else None
    if first is None or not isinstance(token, str) or not _begins(text, token):
        return None
    top = first.get("top_logprobs")
    listed = [pair for pair in map(_pair, top if isinstance(top, list) else []) if pair]
    yes = sum(p for word, p in listed if word == "yes")
    no = sum(p for word, p in listed if word == "no")
    if yes + no <= 0.0:
        return None
    if not yes or not no:  # the other side has at most what is left for tokens outside the list
        left = min(min(p for _, p in listed), max(0.0, 1.0 - sum(p for _, p in listed)))
        if left > _UNSEEN * (yes + no):
            return None
    return round(yes / (yes + no), 6)


def model_names(body: str) -> tuple[str, ...] | None:
    """The names in a body of `GET /models`, in the server's order; None if it is none."""
    content = _object(body)
    rows = content.get("data", content.get("models")) if content else None
    if not isinstance(rows, list):
        return None
    names = (row.get("id", row.get("name")) for row in rows if isinstance(row, dict))
    return tuple(dict.fromkeys(name for name in names if isinstance(name, str) and name))


def _object(body: str) -> dict[str, Any] | None:
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def _first(rows: Any) -> dict[str, Any] | None:
    return rows[0] if isinstance(rows, list) and rows and isinstance(rows[0], dict) else None


def _text(content: Any) -> str:
    """Of a message: one text, or parts of which some are texts of the answer."""
    if isinstance(content, str):
        return content
    parts = (
        [part for part in content if isinstance(part, dict)] if isinstance(content, list) else []
    )
    spoken = [part for part in parts if part.get("type", "text") in ("text", "output_text")]
    texts = [part.get("text") for part in spoken]
    return "".join(text for text in texts if isinstance(text, str))


def _about_nothing(url: ServerURL, choice: dict[str, Any], key: ApiKey | None) -> str:
    refusal = _refusal(choice)
    if refusal is not None:
        return f"the model refused to answer ({without_keys(refusal, key)}; {url})"
    if choice.get("finish_reason") == "content_filter":
        return f"the server's filter held the answer back ({url})"
    return f"the server gave an empty answer ({url})"


def _refusal(choice: dict[str, Any]) -> str | None:
    message = choice.get("message")
    refusal = message.get("refusal") if isinstance(message, dict) else None
    return refusal if isinstance(refusal, str) and refusal.strip() else None


def _begins(text: str, token: str) -> bool:
    word = token.strip(_SPACES)
    return bool(word) and text.lstrip().startswith(word)


def _pair(entry: Any) -> tuple[str, float] | None:
    """(word in lower case, probability) of one entry of `top_logprobs`."""
    if not isinstance(entry, dict):
        return None
    token, value = entry.get("token"), entry.get("logprob")
    if not isinstance(token, str) or isinstance(value, bool):
        return None
    if not isinstance(value, int | float) or not value <= 1e-3:  # NaN, too
        return None
    return token.strip(_SPACES).lower(), math.exp(max(value, -1e4))
