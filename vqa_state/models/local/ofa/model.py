"""OFA as a VQA model: one look at an image, then its questions, those of one length together."""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from pathlib import Path
from typing import TYPE_CHECKING

from PIL.Image import Image

from vqa_state.answers.answer import Answer
from vqa_state.errors import ModelError
from vqa_state.models._base import Failure, Reply
from vqa_state.models.local.exclusive_access import Turns, till_stopped
from vqa_state.models.local.loading import failure_of
from vqa_state.models.local.ofa.config import DecoderPrompt, read_folder
from vqa_state.models.local.ofa.loading import content_digest, load_network
from vqa_state.models.local.ofa.preprocessing import clean_question, to_pixels
from vqa_state.models.local.ofa.tokenizer import BOS, EOS, OfaTokenizer
from vqa_state.models.local.runtime import Runtime
from vqa_state.models.local.yes_no_tokens import YesNoTokens

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["OfaModel"]

#: Changes whenever code changes an answer that the weights' hash does not.
_VERSION = 1

_Tokens = tuple[int, ...]
_Batch = Sequence[_Tokens]
_Outcome = Answer | Failure

#: Questions that go through together; more take memory and save nothing.
_MAX_QUESTIONS = 8


class OfaModel:
    """Answers in the words of OFA; see docs/models/ofa.md for the checkpoints that it can load.

    Instances may be shared by threads.
    """

    def __init__(self, folder: Path, name: str, runtime: Runtime, prompt: str = "") -> None:
        """Load a folder with `config.json`, `vocab.json`, `merges.txt` and safetensors.

        Args:
            folder: of the model.
            name: that the registry knows it by.
            runtime: device and precision.
            prompt: a text with "{question}" where the question goes; "" for the question alone.

        Raises:
            ModuleNotFoundError: if torch, safetensors or tokenizers is not installed.
            ModelError: if the model is incomplete, damaged, not converted or of another kind.
        """
        # Torch is imported here, so that naming this class loads nothing heavy.
        import torch

        from vqa_state.models.local.ofa.decoding import BeamSearch

        self.name = name
        config, self._style = read_folder(folder)
        self._tokenizer = OfaTokenizer(folder)
        if self._tokenizer.size > config.vocab_size:
            raise ModelError(
                f"vocab.json in {folder} has {self._tokenizer.size} words, its config.json only "
                f"{config.vocab_size}; download or copy the model again"
            )
        self._search = BeamSearch()
        self._max_tokens = min(
            self._style.max_src_length + 2, config.max_tokens - self._search.max_length
        )
        self._prompt = prompt or "{question}"
        self._answers = [self._tokenizer.encode(clean_answer) for clean_answer in self._spoken()]
        self._yes_no = YesNoTokens(self._tokenizer.single(" yes"), self._tokenizer.single(" no"))
        self._network = load_network(folder, config, runtime.dtype).to(str(runtime.device))
        self._network.encoder.embed_images.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._runtime = runtime
        self._fingerprint = self._describe(content_digest(folder))
        self._turns = Turns([self._network.encoder, self._network.decoder])

    @property
    def fingerprint(self) -> str:
        """Version, hash of the folder's content, device, precision, prompts and decoding."""
        return self._fingerprint

    @property
    def notes(self) -> Sequence[str]:
        """Where it runs, and what its decoder reads first."""
        reads = {
            DecoderPrompt.NONE: "nothing, as a pretrained checkpoint wants it; one that was tuned "
            'for VQA wants "prompt_type": "prev_output" in its config.json',
            DecoderPrompt.SRC: "the question and its end",
            DecoderPrompt.PREV_OUTPUT: "the question",
        }[self._style.prompt_type]
        return (
            f"It runs on {self._runtime.device} in {self._runtime.precision}.",
            f"Before it answers, its decoder reads {reads}.",
            "It mixes image and question in every layer, so that only its first look at an image "
            "serves all questions.",
        )

    def answer(self, images: Sequence[Image], questions: Sequence[str]) -> Iterator[Reply]:
        """Ask every question about every image; see `VQAModel.answer`."""
        if not questions:
            return
        read = [self._read(question) for question in questions]
        batches = _batches([tokens for tokens in read if not isinstance(tokens, Failure)])
        for image_number, image in enumerate(images):
            for number, tokens in enumerate(read):
                if isinstance(tokens, Failure):
                    yield Reply(image_number, number, tokens)
            if not batches:
                continue
            for found in self._about(image, batches):
                for number, tokens in enumerate(read):
                    if not isinstance(tokens, Failure) and tokens in found:
                        yield Reply(image_number, number, found[tokens])

    def answer_until(
        self, images: Sequence[Image], questions: Sequence[str], stop: Callable[[], bool]
    ) -> Iterator[Reply]:
        """As `answer`; `stop` is asked before every forward pass."""
        own = copy(self)
        own._turns = self._turns.until(stop)
        return till_stopped(own.answer(images, questions))

    def _read(self, question: str) -> tuple[int, ...] | Failure:
        """Tokens with their marks, or why there are none."""
        text = clean_question(self._prompt.replace("{question}", question))
        tokens = (BOS, *self._tokenizer.encode(text), EOS)
        if len(tokens) > self._max_tokens:
            return Failure(
                f"the question has {len(tokens)} tokens; this OFA reads at most {self._max_tokens}"
            )
        return tokens

    def _about(self, image: Image, batches: Sequence[_Batch]) -> Iterator[dict[_Tokens, _Outcome]]:
        """What each batch of questions gets; an image that the network cannot take fails alone."""
        n_asked = 0
        try:
            seen = self._see(image)
            for batch in batches:
                yield dict(zip(batch, self._ask(seen, batch), strict=True))
                n_asked += 1
        except RuntimeError as error:
            for batch in batches[n_asked:]:
                yield dict.fromkeys(batch, failure_of(error))

    def _see(self, image: Image) -> "Tensor":
        """What the questions about an image share."""
        import torch

        pixels = to_pixels(image, self._style)
        with self._turns.take(), torch.inference_mode():
            weight = self._network.encoder.image_proj.weight
            pixels = pixels.to(weight.device, weight.dtype, memory_format=torch.channels_last)
            return self._network.encoder.see(pixels)

    def _ask(self, seen: "Tensor", questions: _Batch) -> list[_Outcome]:
        """Answer questions of one length."""
        import torch

        from vqa_state.models.local.ofa.decoding import beam_search, best_answer, start

        decoder = self._network.decoder
        with self._turns.take(), torch.inference_mode():
            tokens = torch.tensor(questions, device=seen.device)
            prompts = {
                DecoderPrompt.NONE: tokens[:, :1],
                DecoderPrompt.SRC: tokens,
                DecoderPrompt.PREV_OUTPUT: tokens[:, :-1],
            }[self._style.prompt_type]
            said, logits = start(decoder, self._network.encoder(seen, tokens), prompts)
            p_yes = self._yes_no.p_yes(logits)
            usable = logits.isfinite().all(dim=1)
            if self._answers:
                scores = best_answer(decoder, said, logits, self._answers)
                texts = [self._style.answers[number] for number in scores.argmax(dim=1).tolist()]
                usable &= scores.isfinite().all(dim=1)
            else:
                found = beam_search(decoder, said, logits, prompts, self._search)
                # A search whose numbers overflow on the way finds nothing.
                texts = [self._text(answers[0].tokens) if answers else None for answers in found]
        overflow = Failure(
            f"the model's numbers overflow in {self._runtime.precision}; use float32"
        )
        return [
            overflow if text is None or not is_usable else Answer(text, yes)
            for text, yes, is_usable in zip(texts, p_yes, usable.tolist(), strict=True)
        ]

    def _text(self, tokens: _Tokens) -> str:
        return self._tokenizer.decode(tokens).strip()

    def _spoken(self) -> list[str]:
        """The given answers as the decoder says them: after a space."""
        return [f" {answer.strip()}" for answer in self._style.answers]

    def _describe(self, digest: str) -> str:
        answers = list(self._style.answers)
        decoding = f"best of {answers}" if answers else f"{self._search}"
        return (
            f"ofa {_VERSION}; content {digest}; {self._runtime}; "
            f"{self._style.patch_image_size} px; decoder reads {self._style.prompt_type}; "
            f"prompt {self._prompt!r}; {decoding}"
        )


def _batches(questions: Sequence[tuple[int, ...]]) -> list[list[tuple[int, ...]]]:
    """Different questions, those of one length together, some at a time."""
    by_length: dict[int, list[tuple[int, ...]]] = {}
    for tokens in dict.fromkeys(questions):
        by_length.setdefault(len(tokens), []).append(tokens)
    return [
        group[start : start + _MAX_QUESTIONS]
        for _, group in sorted(by_length.items())
        for start in range(0, len(group), _MAX_QUESTIONS)
    ]
