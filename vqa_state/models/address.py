"""Where a model comes from, in one line of text that a project and a recognizer can keep.

    hub:Salesforce/blip-vqa-base              downloaded once; @REVISION after it fixes a version
    folder:/models/blip                       a folder on this machine
    server:http://127.0.0.1:8000/v1#NAME      an OpenAI-compatible server and a model that it serves

After a "?" come settings that change answers, as in a web address: `?precision=bfloat16`,
`?device=cpu`, `?prompt=Look%20closely.%20%7Bquestion%7D`, `?max_tokens=64`.
What is not set is chosen by the machine that runs it.
"""

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar
from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

from vqa_state.errors import ModelError

__all__ = [
    "DEFAULT_MAX_TOKENS",
    "MAX_ADDRESS",
    "MOST_MAX_TOKENS",
    "Device",
    "ModelAddress",
    "Precision",
    "Source",
]

#: Characters of an address.
MAX_ADDRESS = 4000

#: Most tokens of an answer, unless the address says another number: "Yes, the door is open." has
#: seven. And the largest such number.
DEFAULT_MAX_TOKENS = 8
MOST_MAX_TOKENS = 4096

#: As the hub has it: no "." or "-" at an end, none of the two twice, and no name of a git folder.
_HUB_NAME = re.compile(
    r"(?!.*(--|\.\.))(?!.*\.git$)[A-Za-z0-9]([\w.-]{0,94}\w)?/[A-Za-z0-9]([\w.-]{0,94}\w)?",
    re.ASCII,
)
_REVISION = re.compile(r"\w[\w.-]{0,99}")
_SETTINGS = ("device", "precision", "prompt", "max_tokens")


class Source(StrEnum):
    """Where a model's weights are."""

    HUB = "hub"
    FOLDER = "folder"
    SERVER = "server"


class Device(StrEnum):
    """What a local model runs on."""

    AUTO = "auto"
    CPU = "cpu"
    CUDA = "cuda"
    MPS = "mps"


class Precision(StrEnum):
    """The numbers that a local model calculates with."""

    AUTO = "auto"
    FLOAT32 = "float32"
    BFLOAT16 = "bfloat16"
    FLOAT16 = "float16"


@dataclass(frozen=True, slots=True)
class ModelAddress:
    """A parsed address; `str(address)` is its text, always the same for the same content.

    Attributes:
        source: hub, folder or server.
        where: OWNER/NAME, a path, or the server's URL.
        model: the served model's name, for a server only.
        revision: of a hub model, "" for the one on this disk or the newest.
        device, precision: of a local model.
        prompt: a template with "{question}" instead of the family's own, or "".
        max_tokens: most tokens of an answer, of a chat model or a served one.

    Raises:
        ModelError: if a part cannot be used.
    """

    source: Source
    where: str
    model: str = ""
    revision: str = ""
    device: Device = Device.AUTO
    precision: Precision = Precision.AUTO
    prompt: str = ""
    max_tokens: int = DEFAULT_MAX_TOKENS

    def __post_init__(self) -> None:
        if self.source is Source.HUB and not _HUB_NAME.fullmatch(self.where):
            raise ModelError(
                f"{_shown(self.where, ':@')} is no name of a hub model; it looks like OWNER/NAME, "
                "for example Salesforce/blip-vqa-base"
            )
        if self.revision and not (self.source is Source.HUB and _REVISION.fullmatch(self.revision)):
            raise ModelError(f"{_shown(self.revision, '@')} is no revision of a hub model")
        if self.source is Source.FOLDER and (not self.where or "://" in self.where):
            raise ModelError("name the model's folder: folder:/path/to/model")
        if self.source is Source.SERVER:
            _check_server(self.where, self.model)
        if self.prompt and self.prompt.count("{question}") != 1:
            raise ModelError(
                f"the prompt {self.prompt!r} must hold {{question}} once, where the question goes"
            )
        if not 1 <= self.max_tokens <= MOST_MAX_TOKENS:
            raise ModelError(_not_a_limit(self.max_tokens))
        try:
            length = len(str(self))
        except UnicodeEncodeError as error:
            raise ModelError(
                f"{self.where!r} has a character that cannot be written; give it another name"
            ) from error
        if length > MAX_ADDRESS:
            raise ModelError(f"a model's address has at most {MAX_ADDRESS} characters")

    def __str__(self) -> str:
        text = f"{self.source}:{quote(self.where, safe='/:[]~ ')}"
        text += f"@{self.revision}" if self.revision else ""
        values = {"device": self.device, "precision": self.precision, "prompt": self.prompt}
        chosen = {name: str(value) for name, value in values.items() if value not in ("", "auto")}
        if self.max_tokens != DEFAULT_MAX_TOKENS:
            chosen["max_tokens"] = str(self.max_tokens)
        text += f"?{urlencode(chosen, quote_via=quote)}" if chosen else ""
        return text + (f"#{quote(self.model, safe='/:')}" if self.model else "")

    @classmethod
    def parse(cls, text: str) -> "ModelAddress":
        """Read an address as a person types it or as `str` wrote it.

        Raises:
            ModelError: if it has another form; the message shows the forms.
        """
        kind, colon, rest = text.strip().partition(":")
        if not colon or kind not in {source.value for source in Source}:
            raise ModelError(
                f"{_shown(text, '@?=')} is no address of a model; write hub:OWNER/NAME, "
                "folder:/path/to/model or server:http://host:port/v1#MODEL"
            )
        source = Source(kind)
        if source is Source.FOLDER:
            model, (rest, query) = "", _folder_and_settings(rest)
        else:
            rest, _, model = rest.partition("#")
            rest, _, query = rest.partition("?")
        revision = ""
        if source is Source.HUB:
            rest, _, revision = rest.partition("@")
        settings = dict(parse_qsl(query, keep_blank_values=True))
        strange = set(settings) - set(_SETTINGS)
        if strange:
            raise ModelError(
                f"{_shown(sorted(strange)[0], '@', text)} is no setting of a model; allowed: "
                f"{', '.join(_SETTINGS)}"
            )
        return cls(
            source,
            unquote(rest),
            unquote(model),
            revision,
            _choice(Device, settings.get("device", "auto")),
            _choice(Precision, settings.get("precision", "auto")),
            settings.get("prompt", ""),
            _limit(settings.get("max_tokens", str(DEFAULT_MAX_TOKENS))),
        )


def _folder_and_settings(text: str) -> tuple[str, str]:
    """Cut where settings begin. The name of a folder may hold "#" and "?", too."""
    mark = re.search(r"\?(?=\w+=)", text)
    return (text[: mark.start()], text[mark.end() :]) if mark else (text, "")


_Kind = TypeVar("_Kind", Device, Precision)


def _choice(kind: type[_Kind], text: str) -> _Kind:
    try:
        return kind(text)
    except ValueError as error:
        allowed = ", ".join(kind)
        raise ModelError(f"{text!r} is no {kind.__name__.lower()}; allowed: {allowed}") from error


def _limit(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text):
        raise ModelError(_not_a_limit(text))
    return int(text)


def _not_a_limit(given: int | str) -> str:
    return (
        f"the most tokens of an answer, max_tokens, must be a whole number from 1 to "
        f"{MOST_MAX_TOKENS}, got {given!r}; {DEFAULT_MAX_TOKENS} is the default"
    )


def _shown(part: str, marks: str, whole: str = "") -> str:
    """A part of an address as an error may repeat it: not where a mark tells of a password."""
    if set(marks) & set(unquote(whole or part)):
        return "this (not repeated, for it may hold a password)"
    return repr(part)


def _check_server(url: str, model: str) -> None:
    """The URL is never repeated: half a password may stand in what was taken for one."""
    try:
        parts = urlsplit(url)
        usable = parts.scheme in ("http", "https") and bool(parts.hostname)
        _ = parts.port  # raises for a port that is none
    except ValueError:
        usable = False
    if not usable or "@" in url:
        raise ModelError(
            "this is no address of a server; it looks like http://127.0.0.1:8000/v1, without a "
            "user or a key in it"
        )
    if not model:
        raise ModelError(
            "say which model the server shall use, as in server:http://127.0.0.1:8000/v1#MODEL"
        )
