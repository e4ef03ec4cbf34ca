"""A model behind an OpenAI-compatible server: vLLM, SGLang, Ollama, llama.cpp, a hosted one.

docs/models/servers.md has a command for each. The server answers; waiting, trying again and
counting what failed are ours.
"""

import asyncio
import queue
from collections.abc import Callable, Iterator, Sequence

from PIL import Image

from vqa_state.errors import ModelError
from vqa_state.models._base import Reply
from vqa_state.models.api_keys import ApiKey, key_for, plain_text
from vqa_state.models.server.asking import MAX_SIDE, MIN_SIDE, Asking
from vqa_state.models.server.call import MAX_TOKENS, CallBudget, Caller
from vqa_state.models.server.client import open_client
from vqa_state.models.server.event_loop import LoopThread
from vqa_state.models.server.faults import (
    Fault,
    Reach,
    connection_fault,
    not_understood,
    status_fault,
    unforeseen,
)
from vqa_state.models.server.response import model_names
from vqa_state.models.server.url import ServerURL

__all__ = ["DEFAULT_PROMPT", "CallBudget", "ServerModel", "list_models"]

#: Changes whenever code changes what a server is sent.
_VERSION = 1

DEFAULT_PROMPT = "{question} Answer with yes or no."

#: How often a caller that waits for a reply looks whether it should stop, in seconds.
_LOOK = 0.1

#: Seconds that `list_models` takes at most.
_LIST_SECONDS = 15.0

#: Characters of a model's name.
_LONGEST_NAME = 1000


class ServerModel:
    """Asks one model of one server; see `VQAModel`.

    Instances may be shared by threads. What is learnt of a server (how many calls at once, whether
    it gives probabilities, that it is gone) is kept from one `answer` to the next.
    """

    def __init__(
        self,
        url: str,
        model: str,
        name: str,
        prompt: str = "",
        *,
        budget: CallBudget = CallBudget(),  # noqa: B008 - frozen
    ) -> None:
        """Check all that can be checked without asking the server.

        Args:
            url: where it answers, such as http://127.0.0.1:8000/v1.
            model: the name under which it serves the model.
            name: the address that makes this model again.
            prompt: a text with "{question}" once, or "" for `DEFAULT_PROMPT`.
            budget: what asking may cost in tries and time.

        Raises:
            ModuleNotFoundError: if the openai package is not installed.
            ModelError: if the URL, the prompt or the key set for the server cannot be used.
        """
        import openai  # noqa: F401 - a missing package shows now, not in the middle of a run

        self.name = name
        self._url = ServerURL.parse(url)
        if not model:
            raise ModelError(f"say which model {self._url} shall use: server:{self._url}#MODEL")
        self._prompt = prompt or DEFAULT_PROMPT
        if self._prompt.count("{question}") != 1:
            raise ModelError(
                f"the prompt {prompt!r} must hold {{question}} once, where the question goes"
            )
        self._model, self._budget = model, budget
        self._key = key_for(self._url)
        self._caller = Caller(self._url, model, self._key, budget)

    @property
    def fingerprint(self) -> str:
        """Our version, the server, the model's name, the prompt, decoding, how images are sent."""
        return (
            f"server {_VERSION}; {self._url}; {self._model}; prompt {self._prompt!r}; "
            f"temperature 0, {MAX_TOKENS} tokens; PNG, sides {MIN_SIDE} to {MAX_SIDE} px"
        )

    @property
    def notes(self) -> Sequence[str]:
        """Where images go, and what nobody here can know."""
        there = (
            "on this machine" if self._url.is_loopback else "on another machine: images go there"
        )
        return (
            f"It runs {there} ({self._url}).",
            "A server may change its model under the same name; answers already stored stay those "
            "of the old one.",
        )

    def answer(self, images: Sequence[Image.Image], questions: Sequence[str]) -> Iterator[Reply]:
        """Ask every question about every image; replies come as the server gives them.

        Closing the iterator cancels the calls in flight.
        """
        return self.answer_until(images, questions, lambda: False)

    def answer_until(
        self,
        images: Sequence[Image.Image],
        questions: Sequence[str],
        stop: Callable[[], bool],
    ) -> Iterator[Reply]:
        """As `answer`, but ends soon after `stop` says so, also while nothing comes.

        Args:
            images: RGB, any size.
            questions: texts, any number.
            stop: asked some times a second; pairs without a reply are left out then.
        """
        if not images or not questions:
            return
        replies: queue.SimpleQueue[Reply | None] = queue.SimpleQueue()
        asking = Asking(self._caller, self._prompt, images, questions, replies)
        thread = LoopThread(lambda: self._run(asking, replies))
        thread.start()
        try:
            while not stop():
                try:
                    reply = replies.get(timeout=_LOOK)
                except queue.Empty:
                    continue
                if reply is None:
                    thread.result()  # raises what ended it too early
                    return
                yield reply
        finally:
            thread.cancel()
            thread.join(1.0)

    async def _run(self, asking: Asking, replies: "queue.SimpleQueue[Reply | None]") -> None:
        try:
            seconds = self._budget.deadline_seconds
            async with open_client(self._url, self._key, seconds) as client:
                await asking.run(client)
        finally:
            replies.put(None)


def list_models(url: str) -> tuple[str, ...]:
    """The names of the models that a server offers, in its order, each as it is asked for.

    A name that no address could hold or that shows the key is left out.

    Args:
        url: where it answers, such as http://127.0.0.1:8000/v1.

    Raises:
        ModelError: if the URL or the key set for it cannot be used, or the server does not give
            its list; the message says why.
        ModuleNotFoundError: if the openai package is not installed.
    """
    server = ServerURL.parse(url)
    key = key_for(server)
    thread = LoopThread(lambda: _list(server, key))
    thread.start()
    listed = thread.result()
    if isinstance(listed, Fault):
        raise ModelError(listed.sentence)
    return tuple(
        name
        for name in listed
        if name.strip() and len(name) <= _LONGEST_NAME and plain_text(name, key) == name
    )


async def _list(url: ServerURL, key: ApiKey | None) -> tuple[str, ...] | Fault:
    try:
        return await _listed(url, key)
    except Exception as error:  # noqa: BLE001 - a stranger's bytes went through it
        return unforeseen(error, url)


async def _listed(url: ServerURL, key: ApiKey | None) -> tuple[str, ...] | Fault:
    import httpx2
    import openai

    try:
        async with asyncio.timeout(_LIST_SECONDS), open_client(url, key, _LIST_SECONDS) as client:
            response = await client.get("/models", cast_to=httpx2.Response)
    except (TimeoutError, openai.APITimeoutError):
        sentence = f"{url} did not list its models within {_LIST_SECONDS:g} seconds"
        return Fault(sentence, Reach.GONE)
    except openai.APIStatusError as error:
        return status_fault(error, url, "", key)
    except openai.APIConnectionError as error:
        return connection_fault(error, url)
    names = model_names(response.content.decode("utf-8", "replace"))
    return not_understood(url) if names is None else names
