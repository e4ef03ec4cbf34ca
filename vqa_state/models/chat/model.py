"""Chat models with images (SmolVLM, Qwen-VL, Gemma 3, InternVL, …) through transformers.

Everything before the question is read once an image; see `chat_prefix` for how and `chat_prompt`
for the ids. A model that this does not suit is asked one question at a time, and says so.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from importlib.metadata import version
from pathlib import Path

from PIL.Image import Image

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models._base import Failure, Reply
from vqa_state.models.address import DEFAULT_MAX_TOKENS
from vqa_state.models.chat.asking import ChatAsker, Outcome
from vqa_state.models.chat.loading import load_chat
from vqa_state.models.chat.prefix_cache import Said
from vqa_state.models.chat.prefix_check import check_prefix
from vqa_state.models.chat.prompt import ChatPrompt
from vqa_state.models.chat.prompt_templates import prompt_for
from vqa_state.models.local.exclusive_access import till_stopped
from vqa_state.models.local.runtime import Runtime, folder_digest
from vqa_state.models.local.yes_no_tokens import yes_no_tokens

__all__ = ["ChatModel"]

#: Changes whenever code changes an answer that nothing else in the fingerprint tells.
_VERSION = 1

_DEVICES = {"cpu": "processor", "cuda": "graphics card"}


class ChatModel:
    """Answers as `generate(do_sample=False)` of transformers would; may be shared by threads."""

    def __init__(
        self,
        folder: Path,
        name: str,
        runtime: Runtime,
        prompt: str = "",
        max_tokens: int = DEFAULT_MAX_TOKENS,
    ) -> None:
        """Load a model and try whether its fast way gives what the slow one gives.

        Args:
            folder: that holds config.json, the weights and the processor's files.
            name: the model's address.
            runtime: what it runs on, in what numbers.
            prompt: a template with "{question}" once, or "" for the family's own.
            max_tokens: most tokens of an answer.

        Raises:
            MissingPackageError: if a package that it needs is not installed.
            ModelError: if the folder is damaged or the prompt unusable.
        """
        digest = folder_digest(folder)
        model, processor = load_chat(folder, name, runtime)
        try:
            template = prompt_for(model.config.model_type, prompt)
        except ValueError as error:
            raise ModelError(str(error)) from error
        writer = ChatPrompt(processor, model.config, template)
        check = check_prefix(model, writer, runtime)
        release = ".".join(version("transformers").split(".")[:2])
        self.name = name
        self._fingerprint = (
            f"chat {_VERSION}; files {digest}; {runtime}; prompt {template!r}; "
            f"greedy, {max_tokens} tokens; transformers {release}"
        )
        self._notes = tuple(_notes(runtime, check.slow_because))
        self._precision = runtime.precision
        self._tokenizer = processor.tokenizer
        self._yes_no = yes_no_tokens(processor.tokenizer)
        self._asker = ChatAsker(model, writer, runtime, check, max_tokens)

    @property
    def fingerprint(self) -> str:
        """Version, files, device and precision, prompt, decoding, release of transformers."""
        return self._fingerprint

    @property
    def notes(self) -> tuple[str, ...]:
        """Device and precision; why an image is read again for every question, where it is."""
        return self._notes

    def answer(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Reply]:
        """Ask every question about every image; what the model cannot take fails alone."""
        for image, question, said in self.generations(images, questions):
            outcome = said if isinstance(said, Failure) else self._read(said)
            yield Reply(image, question, outcome)

    def answer_until(
        self, images: Sequence[Image], questions: Sequence[str], stop: Callable[[], bool]
    ) -> Iterator[Reply]:
        """As `answer`; `stop` is asked before every forward pass."""
        own = copy(self)
        own._asker = self._asker.until(stop)
        return till_stopped(own.answer(images, questions))

    def generations(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Outcome]:
        """The tokens and first-step logits behind `answer`, to compare ways and models by.

        Yields:
            (number of the image, number of the question, `Said` or a `Failure`), every pair once.
        """
        return self._asker.said(images, questions)

    def _read(self, said: Said) -> Answer | Failure:
        text = self._tokenizer.decode(
            said.tokens, skip_special_tokens=True, clean_up_tokenization_spaces=False
        )
        p_yes = self._yes_no.p_yes(said.logits[None])[0]
        if p_yes is not None and p_yes != p_yes:
            return Failure(f"the model's numbers overflow in {self._precision}; use float32")
        return Answer(text, p_yes, said.at_limit)


def _notes(runtime: Runtime, slow_because: str) -> Iterator[str]:
    yield f"It runs on the {_DEVICES.get(runtime.device, 'GPU')} in {runtime.precision}."
    if slow_because:
        yield f"It reads an image again for every question, which takes long: {slow_because}."
