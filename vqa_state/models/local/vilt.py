"""ViLT for question answering: a classifier of answers, its image embedded once."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL.Image import Image

from vqa_state.answers.answer import Answer
from vqa_state.models.address import Device
from vqa_state.models.local.classic import Said, TorchImageModel, fingerprint_of
from vqa_state.models.local.loading import Parts, load_parts
from vqa_state.models.local.runtime import Runtime
from vqa_state.models.local.yes_no_tokens import YesNoTokens

if TYPE_CHECKING:
    from torch import Tensor
    from torch.nn import Module

__all__ = ["ViltModel"]

#: Changes whenever code changes an answer that nothing else in the fingerprint tells.
_VERSION = 1

#: An image, embedded, (1, 1 + n_patches, width), and its queries, keys, values in the first layer.
_Seen = tuple["Tensor", tuple["Tensor", "Tensor", "Tensor"]]

#: The longer side of a resized image is at most this many times the shorter one's target.
#: Source: transformers, `image_processing_pil_vilt.py`, MAX_LONGER_EDGE / MAX_SHORTER_EDGE.
_LONGER = 1333 / 800


class ViltModel(TorchImageModel):
    """Answers with the likeliest of its labels. May be shared by threads.

    Source: W. Kim, B. Son, I. Kim, "ViLT: Vision-and-Language Transformer Without Convolution or
    Region Supervision", ICML 2021, arXiv 2102.03334.
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
        network = _Vilt(load_parts(folder, "ViltForQuestionAnswering", runtime), runtime, template)
        fingerprint = fingerprint_of(
            f"vilt {_VERSION}", folder, runtime, template, "likeliest label"
        )
        super().__init__(network, name, runtime, fingerprint)


class _Vilt:
    """The network, with the patches of an image embedded once.

    It mixes image and question from the first layer on, so nothing later than what the image
    brings to that can be kept. The last layer is needed for the one token that is classified, and
    is calculated for it alone.
    """

    def __init__(self, parts: Parts, runtime: Runtime, template: str) -> None:
        # A processor gains nothing from more rows, and each costs as much as a question.
        self.n_rows = 1 if runtime.device is Device.CPU else 32
        self.max_tokens: int = parts.model.config.max_position_embeddings
        self.steps: Sequence[Module] = ()  # it says all in one pass
        self._parts = parts
        self._runtime = runtime
        self._template = template
        self._embeddings = parts.model.vilt.embeddings
        self._layers = parts.model.vilt.encoder.layer
        self._last = len(self._layers) - 1
        self._labels: dict[int, str] = dict(parts.model.config.id2label)
        self._yes_no = YesNoTokens(_named(self._labels, "yes"), _named(self._labels, "no"))

    def read(self, question: str) -> list[int]:
        text = self._template.replace("{question}", question)
        return list(self._parts.tokenizer(text, verbose=False).input_ids)

    def see(self, images: Sequence[Image]) -> list[_Seen]:
        import torch

        with torch.inference_mode():
            embedded = [self._embedded(self._pixels(image)) for image in images]
            return [(states, _projected(self._layers[0], states)) for states in embedded]

    def say(self, seen: _Seen, tokens: "Tensor") -> list[Said]:
        import torch

        with torch.inference_mode():
            first = self._mixed(seen, tokens.to(str(self._runtime.device)))
            vilt = self._parts.model.vilt
            pooled = vilt.pooler(vilt.layernorm(first))
            logits = self._parts.model.classifier(pooled).float().cpu()  # (n_rows, n_labels)
        best = logits.argmax(dim=-1).tolist()
        return [Said((number,), row) for number, row in zip(best, logits, strict=True)]

    def _mixed(self, seen: _Seen, tokens: "Tensor") -> "Tensor":
        """(n_rows, length) tokens → (n_rows, 1, width) the classified token after all layers."""
        import torch

        image, of_image = seen
        text = self._embeddings.text_embeddings(input_ids=tokens) + self._kind(0)
        both = [text, *_projected(self._layers[0], text)], [image, *of_image]
        states, *projected = (
            torch.cat([own, other.expand(len(tokens), -1, -1)], dim=1)
            for own, other in zip(*both, strict=True)
        )
        for number, layer in enumerate(self._layers):
            if number > 0:
                projected = list(_projected(layer, states, number == self._last))
            if number == self._last:
                states, projected[0] = states[:, :1], projected[0][:, :1]
            states = _after(layer, states, *projected)
        return states

    def answer(self, said: Said) -> Answer:
        return Answer(self._labels[said.tokens[0]], self._yes_no.p_yes(said.logits[None])[0])

    def _pixels(self, image: Image) -> "Tensor":
        prepared = self._parts.images(images=self._not_too_thin(image), return_tensors="pt")
        pixels: Tensor = prepared.pixel_values
        return pixels.to(str(self._runtime.device), self._runtime.dtype)

    def _not_too_thin(self, image: Image) -> Image:
        """The processor keeps proportions and would leave a strip without a single patch."""
        images = self._parts.images
        most = int(_LONGER * images.size["shortest_edge"]) / images.size_divisor
        at_least = ceil(max(image.size) / most)
        width, height = (max(side, at_least) for side in image.size)
        return image if (width, height) == image.size else image.resize((width, height))

    def _embedded(self, pixels: "Tensor") -> "Tensor":
        """(1, 3, height, width) → (1, 1 + n_patches, width), the patches row by row.

        The library's own way shuffles them by torch's global random numbers. Their order changes
        nothing, but the global state would.
        """
        import torch
        from torch.nn.functional import interpolate

        own = self._embeddings
        patches = own.patch_embeddings(pixels)  # (1, width, n_down, n_across)
        trained = own.position_embeddings[:, 1:].transpose(1, 2)
        side = own.config.image_size // own.config.patch_size
        places = interpolate(
            trained.unflatten(-1, (side, side)),
            size=patches.shape[2:],
            mode="bilinear",
            align_corners=True,
        )
        tokens = (patches + places).flatten(2).transpose(1, 2)
        tokens = self._few_enough(tokens)
        whole = own.cls_token + own.position_embeddings[:, :1]
        return torch.cat([whole, tokens], dim=1) + self._kind(1)

    def _few_enough(self, tokens: "Tensor") -> "Tensor":
        """A checkpoint may limit the patches; the library picks at random, we pick evenly."""
        import torch

        most = self._embeddings.config.max_image_length
        n = tokens.shape[1]
        if not isinstance(most, int) or most < 0 or n <= most:
            return tokens
        return tokens[:, torch.arange(most, device=tokens.device) * n // most]

    def _kind(self, number: int) -> "Tensor":
        """What marks text (0) and image (1)."""
        kind: Tensor = self._embeddings.token_type_embeddings.weight[number]
        return kind


def _named(labels: dict[int, str], word: str) -> tuple[int, ...]:
    return tuple(number for number, label in labels.items() if label.strip().lower() == word)


def _projected(
    layer: Any, states: "Tensor", only_first: bool = False
) -> tuple["Tensor", "Tensor", "Tensor"]:
    """Queries (of the first token only, if so), keys and values, each (n, length, width)."""
    attention, normed = layer.attention.attention, layer.layernorm_before(states)
    asking = normed[:, :1] if only_first else normed
    return attention.query(asking), attention.key(normed), attention.value(normed)


def _after(
    layer: Any, states: "Tensor", queries: "Tensor", keys: "Tensor", values: "Tensor"
) -> "Tensor":
    """States after a layer; there are as many queries as states."""
    from torch.nn.functional import scaled_dot_product_attention

    n_heads = layer.attention.attention.num_attention_heads
    parts: tuple[Any, ...] = (queries, keys, values)
    split = [one.unflatten(-1, (n_heads, -1)).transpose(1, 2) for one in parts]
    found = scaled_dot_product_attention(*split).transpose(1, 2).flatten(2)
    states = states + layer.attention.output(found, states)
    inside = layer.intermediate(layer.layernorm_after(states))
    after: Tensor = layer.output(inside, states)
    return after
