"""BLIP for question answering: its image is encoded once for all questions about it."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL.Image import Image

from vqa_state.answers.answer import Answer
from vqa_state.models.address import Device
from vqa_state.models.local.classic import Said, TorchImageModel, fingerprint_of
from vqa_state.models.local.loading import Parts, load_parts
from vqa_state.models.local.runtime import Runtime
from vqa_state.models.local.yes_no_tokens import yes_no_tokens

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["MAX_ANSWER_TOKENS", "BlipModel"]

#: Tokens of an answer, its end included.
MAX_ANSWER_TOKENS = 10

#: Changes whenever code changes an answer that nothing else in the fingerprint tells.
_VERSION = 1

#: Keys and values of one cross-attention, each (1, n_heads, n_patches, head_width).
_KeysValues = tuple["Tensor", "Tensor"]


class BlipModel(TorchImageModel):
    """Answers as `generate` of transformers does without sampling. May be shared by threads.

    Source: J. Li et al., "BLIP: Bootstrapping Language-Image Pre-training for Unified
    Vision-Language Understanding and Generation", ICML 2022, arXiv 2201.12086.
    """

    def __init__(self, folder: Path, name: str, runtime: Runtime, prompt: str = "") -> None:
        """Load a model.

        Args:
            folder: that holds config.json, the weights and the processor's files.
            name: the model's address.
            runtime: what it runs on, in what numbers.
            prompt: a template with "{question}" once, or "" for the bare question.

        Raises:
            ModelError: if the folder is damaged.
        """
        template = prompt or "{question}"
        network = _Blip(load_parts(folder, "BlipForQuestionAnswering", runtime), runtime, template)
        fingerprint = fingerprint_of(
            f"blip {_VERSION}", folder, runtime, template, f"greedy, {MAX_ANSWER_TOKENS} tokens"
        )
        super().__init__(network, name, runtime, fingerprint)


class _Blip:
    """The network, cut where the image and the questions meet.

    The image's keys and values in the question encoder depend on the image alone, and that
    attention lets no two tokens meet: the tokens of all questions attend to the image as if they
    were those of one.

    Why questions are never padded: in transformers the cross-attentions of BLIP drop the mask of
    the question, so padding would change answers.
    """

    def __init__(self, parts: Parts, runtime: Runtime, template: str) -> None:
        text = parts.model.config.text_config
        self.n_rows = 8 if runtime.device is Device.CPU else 32
        self.max_tokens: int = text.max_position_embeddings
        self.steps = [parts.model.text_decoder]
        self._parts = parts
        self._runtime = runtime
        self._template = template
        self._yes_no = yes_no_tokens(parts.tokenizer)
        self._start: int = text.bos_token_id
        self._end: int = text.sep_token_id
        self._n_heads: int = text.num_attention_heads
        self._layers = parts.model.text_encoder.encoder.layer

    def read(self, question: str) -> list[int]:
        text = self._template.replace("{question}", question)
        return list(self._parts.tokenizer(text, verbose=False).input_ids)

    def see(self, images: Sequence[Image]) -> list[list[_KeysValues]]:
        """For each image, of each layer of the question encoder the image's keys and values."""
        import torch

        with torch.inference_mode():
            pixels = self._parts.images(images=list(images), return_tensors="pt").pixel_values
            pixels = pixels.to(str(self._runtime.device), self._runtime.dtype)
            patches = self._parts.model.vision_model(pixel_values=pixels).last_hidden_state
            attentions = [layer.crossattention.self for layer in self._layers]
            projected = [
                (self._by_head(one.key(patches)), self._by_head(one.value(patches)))
                for one in attentions
            ]
            return [
                [(keys[i : i + 1], values[i : i + 1]) for keys, values in projected]
                for i in range(len(images))
            ]

    def say(self, seen: Sequence[_KeysValues], tokens: "Tensor") -> list[Said]:
        import torch

        with torch.inference_mode():
            states = self._read_with_image(tokens.to(str(self._runtime.device)), seen)
            written, logits = self._written(states)
        return [Said(self._ended(row), one) for row, one in zip(written, logits, strict=True)]

    def answer(self, said: Said) -> Answer:
        text = self._parts.tokenizer.decode(said.tokens, skip_special_tokens=True)
        return Answer(text, self._yes_no.p_yes(said.logits[None])[0])

    def _read_with_image(self, tokens: "Tensor", seen: Sequence[_KeysValues]) -> "Tensor":
        """(n_rows, length) tokens → (n_rows, length, width) states of the question encoder."""
        states: Tensor = self._parts.model.text_encoder.embeddings(input_ids=tokens)
        for layer, (keys, values) in zip(self._layers, seen, strict=True):
            states = layer.attention(states)[0]
            states = self._look(layer.crossattention, states, keys, values)
            states = layer.feed_forward_chunk(states)
        return states

    def _look(self, cross: Any, states: "Tensor", keys: "Tensor", values: "Tensor") -> "Tensor":
        from torch.nn.functional import scaled_dot_product_attention

        queries = self._by_head(cross.self.query(states.flatten(0, 1))[None])
        found = scaled_dot_product_attention(queries, keys, values)
        found = found.transpose(1, 2).reshape(states.shape)  # (n_rows, length, width)
        looked: Tensor = cross.output(found, states)
        return looked

    def _by_head(self, states: "Tensor") -> "Tensor":
        """(n, length, width) → (n, n_heads, length, head_width)."""
        split: Tensor = states.unflatten(-1, (self._n_heads, -1))  # type: ignore[no-untyped-call]
        return split.transpose(1, 2)

    def _written(self, states: "Tensor") -> tuple[list[list[int]], "Tensor"]:
        """Greedy answers with their ends, and the first step's logits (n_rows, n_tokens)."""
        import torch

        decoder, cache = self._parts.model.text_decoder, None
        written = torch.full((len(states), 1), self._start, device=states.device)
        steps: list[Tensor] = []
        while len(steps) < MAX_ANSWER_TOKENS and not self._all_ended(written):
            step = decoder(
                input_ids=written[:, -1:],
                encoder_hidden_states=states,
                past_key_values=cache,
                use_cache=True,
            )
            cache = step.past_key_values
            steps.append(step.logits[:, -1])
            written = torch.cat([written, steps[-1].argmax(dim=-1, keepdim=True)], dim=1)
        return written[:, 1:].tolist(), steps[0].float().cpu()

    def _all_ended(self, written: "Tensor") -> bool:
        return bool((written[:, 1:] == self._end).any(dim=1).all())

    def _ended(self, row: Sequence[int]) -> tuple[int, ...]:
        return tuple(row[: row.index(self._end)] if self._end in row else row)
