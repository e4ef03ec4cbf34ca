"""One question put to a server: tried again within a budget, ending in an answer or a fault.

Waits double from one try to the next and are drawn from zero up to that ("full jitter"), so that
calls which failed together do not come back together.

Source: https://aws.amazon.com/blogs/architecture/exponential-backoff-and-jitter/
"""

import asyncio
import random
from dataclasses import dataclass, fields, replace
from time import monotonic
from typing import TYPE_CHECKING, Any

from vqa_state.answers.answer import Answer
from vqa_state.models.address import DEFAULT_MAX_TOKENS
from vqa_state.models.api_keys import ApiKey
from vqa_state.models.server.circuit_breaker import Doubt
from vqa_state.models.server.concurrency import Pace
from vqa_state.models.server.faults import (
    Fault,
    Reach,
    connection_fault,
    status_fault,
    unforeseen,
)
from vqa_state.models.server.response import read_reply
from vqa_state.models.server.url import ServerURL

if TYPE_CHECKING:
    from openai import AsyncOpenAI

__all__ = ["CallBudget", "Caller"]

#: Seconds for which a server can ask not to be asked, at most; one may err, or mock.
_LONGEST_CLOSED = 86_400.0


@dataclass(frozen=True, slots=True)
class CallBudget:
    """What asking a server may cost in tries and time.

    Attributes:
        retries: of one answer, after its first try.
        run_retries: of all answers together; every answer that comes gives one back, so a server
            that fails now and then is forgiven, and one that fails always is not asked for ever.
        deadline_seconds: for one try, from the first byte sent to the last one read. A server may
            load its model during the first.
        answer_seconds: for one answer with all its tries and waits.
        first_wait_seconds: at most, before the first retry.
        longest_wait_seconds: before any. A server that names a time itself is not asked before it
            is over; if that is longer than an answer may take, you ask again.
        max_parallel: calls open at once, at most; how many is found by timing.
    """

    retries: int = 4
    run_retries: int = 60
    deadline_seconds: float = 120.0
    answer_seconds: float = 300.0
    first_wait_seconds: float = 0.5
    longest_wait_seconds: float = 30.0
    max_parallel: int = 16

    def __post_init__(self) -> None:
        for field in fields(self):
            least = 1 if field.name == "max_parallel" else 0
            value = getattr(self, field.name)
            if not value >= least or ("deadline" in field.name and value == 0):
                raise ValueError(f"{field.name} must be at least {least}, got {value}")


@dataclass(frozen=True, slots=True)
class _Dialect:
    """What this server understands; it begins with all, and what it refuses is left out.

    None of it changes the text of an answer.
    """

    limit: str = "max_tokens"
    logprobs: bool = True

    def parameters(self, max_tokens: int) -> dict[str, Any]:
        extra = {"logprobs": True, "top_logprobs": 20} if self.logprobs else {}
        return {self.limit: max_tokens, **extra}

    def other(self, fault: Fault, known: bool) -> "_Dialect | None":
        """What to try instead after the server did not accept a question."""
        if fault.reach is not Reach.ANSWER or fault.status not in (400, 422, 501):
            return None
        if self.limit == "max_tokens" and "max_completion_tokens" in fault.said:
            return replace(self, limit="max_completion_tokens")
        return replace(self, logprobs=False) if self.logprobs and not known else None


class Caller:
    """Asks one model of one server, and remembers for all calls what it learnt of it.

    Attributes:
        pace: how many calls to keep open at once.
        doubt: whether it answers at all.
    """

    def __init__(
        self,
        url: ServerURL,
        model: str,
        key: ApiKey | None,
        budget: CallBudget,
        max_tokens: int = DEFAULT_MAX_TOKENS,
    ) -> None:
        self.pace = Pace(budget.max_parallel)
        self.doubt = Doubt()
        self._url, self._model, self._key, self._budget = url, model, key, budget
        self._max_tokens = max_tokens
        self._retries_left = budget.run_retries
        self._dialect, self._is_dialect_known = _Dialect(), False
        self._closed_until, self._closing = float("-inf"), self._silence()
        self._jitter = random.Random()

    async def ask(self, client: "AsyncOpenAI", content: list[dict[str, Any]]) -> Answer | Fault:
        """Put one question; the fault of the last try if none brought an answer.

        Args:
            client: of `open_client`, for this server.
            content: of the user's message, as the protocol has it.
        """
        if self._is_closed_for_long():
            return self._closed()
        began = monotonic()
        fault = self._closing if self._closed_until > began else self._silence()
        try:
            async with asyncio.timeout(self._budget.answer_seconds):
                for n_tries in range(1, self._budget.retries + 2):
                    outcome = await self._try(client, content)
                    if isinstance(outcome, Answer):
                        return outcome
                    # A server that failed may break off the next try on the same connection: what
                    # it said before tells more.
                    broke_off = outcome.reach is Reach.PASSING and not outcome.status
                    fault = fault if broke_off and fault.status else outcome
                    wait = self._wait(outcome, n_tries)
                    if wait is None:
                        break
                    await asyncio.sleep(wait)
        except TimeoutError:
            pass  # the last fault says why it took so long
        if self._is_closed_for_long():
            return self._closed()
        return self.doubt.weigh(fault, began, monotonic())

    async def _try(self, client: "AsyncOpenAI", content: list[dict[str, Any]]) -> Answer | Fault:
        """One try; the same again in other terms where the server does not know the first."""
        while (closed := self._closed_until - monotonic()) > 0:
            await asyncio.sleep(closed + self._jitter.uniform(0, self._budget.first_wait_seconds))
        dialect = self._dialect
        while True:
            began = monotonic()
            outcome = await self._call(client, content, dialect)
            if isinstance(outcome, Answer):
                self._learn(dialect)
                return outcome
            other = dialect.other(outcome, self._is_dialect_known)
            if other is None:
                return self._heeded(outcome, began)
            dialect = other

    async def _call(
        self, client: "AsyncOpenAI", content: list[dict[str, Any]], dialect: _Dialect
    ) -> Answer | Fault:
        try:
            return await self._exchange(client, content, dialect)
        except Exception as error:  # noqa: BLE001 - a stranger's bytes: none may end the run
            return unforeseen(error, self._url)

    async def _exchange(
        self, client: "AsyncOpenAI", content: list[dict[str, Any]], dialect: _Dialect
    ) -> Answer | Fault:
        import httpx2
        import openai

        body = {
            "model": self._model,
            "messages": [{"role": "user", "content": content}],
            "temperature": 0,
            **dialect.parameters(self._max_tokens),
        }
        try:
            async with asyncio.timeout(self._budget.deadline_seconds):
                # Not `chat.completions.create`: it takes a web page for an answer.
                response = await client.post(
                    "/chat/completions", body=body, cast_to=httpx2.Response
                )
        except (TimeoutError, openai.APITimeoutError):
            return self._silence()
        except openai.APIStatusError as error:
            return status_fault(error, self._url, self._model, self._key)
        except openai.APIConnectionError as error:
            return connection_fault(error, self._url)
        reply = response.content.decode("utf-8", "replace")
        return read_reply(reply, self._url, self._key, self._model, self._max_tokens)

    def _learn(self, dialect: _Dialect) -> None:
        self._dialect, self._is_dialect_known = dialect, True
        self._retries_left = min(self._retries_left + 1, self._budget.run_retries)
        self.doubt.answered(monotonic())

    def _heeded(self, fault: Fault, began: float) -> Fault:
        """Do what the server asks all callers to do: fewer at once, and not before a time."""
        if fault.status == 429:
            self.pace.refused(began, monotonic())
        until = monotonic() + min(fault.wait or 0.0, _LONGEST_CLOSED)
        if fault.wait is not None and until > self._closed_until:
            self._closed_until, self._closing = until, fault
        return fault

    def _is_closed_for_long(self) -> bool:
        return self._closed_until - monotonic() > self._budget.answer_seconds

    def _closed(self) -> Fault:
        seconds = max(0.0, self._closed_until - monotonic())
        sentence = f"{self._closing.sentence}: it asks to wait {seconds:.0f} seconds"
        return replace(self._closing, sentence=sentence, reach=Reach.ALL)

    def _wait(self, fault: Fault, n_tries: int) -> float | None:
        """Seconds before the next try; None if there is to be none."""
        known_gone = self.doubt.is_gone and fault.reach is Reach.GONE
        if fault.reach in (Reach.ANSWER, Reach.ALL) or known_gone or self._is_closed_for_long():
            return None
        if n_tries > self._budget.retries or self._retries_left <= 0:
            return None
        self._retries_left -= 1
        longest = self._budget.first_wait_seconds * 2.0 ** (n_tries - 1)
        return self._jitter.uniform(0, min(longest, self._budget.longest_wait_seconds))

    def _silence(self) -> Fault:
        seconds = f"{self._budget.deadline_seconds:g}"
        sentence = f"{self._url} gave no whole answer within {seconds} seconds; see its own log"
        return Fault(sentence, Reach.GONE)
