"""Greedy generation for many questions about one image, whose part of the work is done once.

The keys and values of everything before the question (system prompt, image, words of the template)
are calculated once; each question goes on from a copy of them, many questions at a time.

Source: github.com/huggingface/transformers, docs/source/en/kv_cache.md, "Prefill a cache".
"""

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

__all__ = [
    "N_TOKENS",
    "Prefix",
    "Said",
    "generate_plain",
    "generate_suffixes",
    "join_inputs",
    "on_device",
    "read_prefix",
]

#: Most tokens of an answer: "Yes, the door is open." has seven.
N_TOKENS = 8

#: Most questions that go through the model together, and most bytes of their copied prefixes.
_MAX_ROWS = 32
_MAX_COPIED = 2**30


@dataclass(frozen=True, eq=False)
class Said:
    """One answer: its tokens without the end's, and the logits of its first step, (n_tokens,)."""

    tokens: tuple[int, ...]
    logits: Any


@dataclass(frozen=True, eq=False)
class Prefix:
    """Some images, read: what a question about any of them goes on from. It is never changed.

    Attributes:
        ids: (n_images, length) ids that were read.
        cache: keys and values, by layer; None if they cannot be used again.
        deltas: (n_images, 1) by how much positions run behind ids where an image's count is less
            than its tokens (the Qwen families), else None.
        filler: an id that stands in every prefix and is no image token.
    """

    ids: Any
    cache: Any
    deltas: Any
    filler: int

    @property
    def is_usable(self) -> bool:
        """Whether the cache holds plain keys and values, which rows can be copied from."""
        from transformers.cache_utils import DynamicCache, DynamicLayer, DynamicSlidingWindowLayer

        usual = (DynamicLayer, DynamicSlidingWindowLayer)
        return type(self.cache) is DynamicCache and all(
            type(layer) in usual for layer in self.cache.layers
        )

    @property
    def slides(self) -> bool:
        """Whether layers forget by distance: filling between ids would be counted as distance."""
        return any(self.cache.is_sliding)

    @property
    def n_rows(self) -> int:
        """How many questions may go on from it at a time: the same for the same image."""
        held = sum(int(layer.keys.nbytes + layer.values.nbytes) for layer in self.cache.layers)
        return max(1, min(_MAX_ROWS, _MAX_COPIED * len(self.ids) // max(1, held)))

    def chunks(self, rows: Sequence[Sequence[int]]) -> Iterator[list[int]]:
        """Positions of rows of ids that go together, of like lengths; of equal ones if it must."""
        order = sorted(range(len(rows)), key=lambda n: len(rows[n]))
        chunk: list[int] = []
        for n in order:
            differs = bool(chunk) and len(rows[n]) != len(rows[chunk[0]])
            if len(chunk) == self.n_rows or (self.slides and differs):
                yield chunk
                chunk = []
            chunk.append(n)
        if chunk:
            yield chunk


def join_inputs(inputs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Inputs of several images as those of one batch: their tensors along the first axis."""
    import torch

    if len(inputs) == 1:
        return inputs[0]
    return {key: torch.cat([one[key] for one in inputs]) for key in inputs[0]}


def on_device(model: Any, inputs: dict[str, Any]) -> dict[str, Any]:
    """The inputs where the model is; what is no count or id in the model's own numbers."""
    return {
        key: value.to(model.device, model.dtype if value.is_floating_point() else None)
        if hasattr(value, "to")
        else value
        for key, value in inputs.items()
    }


def read_prefix(model: Any, inputs: dict[str, Any], image_token: int | None) -> Prefix:
    """Read what stands before the questions.

    Args:
        model: of transformers, with `generate`.
        inputs: tensors on its device; input_ids is (n_images, length).
        image_token: id of an image's tokens.
    """
    made = model.generate(**inputs, max_new_tokens=1, return_dict_in_generate=True, **_GREEDY)
    ids = inputs["input_ids"]
    first = ids[0].tolist()
    filler = next((one for one in first if one != image_token), first[0])
    deltas = _counting(model).rope_deltas if _counting(model) is not None else None
    return Prefix(ids, made.past_key_values, deltas, filler)


def generate_suffixes(
    model: Any,
    prefix: Prefix,
    images: Sequence[int],
    suffixes: Sequence[Sequence[int]],
    n_tokens: int = N_TOKENS,
) -> list[Said]:
    """Answer some questions, each about one image of the prefix.

    Args:
        model: that read the prefix.
        prefix: stays as it is.
        images: which image each question is about, a position in the prefix.
        suffixes: ids of each question behind the prefix, at least one.
        n_tokens: most tokens of an answer.
    """
    import torch

    chosen = torch.tensor(list(images), device=prefix.ids.device)
    width = max(map(len, suffixes))
    # Short rows are filled on the left, between prefix and question, where the mask hides it.
    filled = [[prefix.filler] * (width - len(one)) + list(one) for one in suffixes]
    shown = [[0] * (width - len(one)) + [1] * len(one) for one in suffixes]
    start = prefix.ids[chosen]  # (n_rows, length)
    if (counting := _counting(model)) is not None:
        counting.rope_deltas = None if prefix.deltas is None else prefix.deltas[chosen]
    made = model.generate(
        input_ids=torch.cat([start, start.new_tensor(filled)], 1),
        attention_mask=torch.cat([torch.ones_like(start), start.new_tensor(shown)], 1),
        past_key_values=_rows_of(prefix.cache, chosen),
        **_answering(n_tokens),
    )
    return _said(model, made)


def generate_plain(model: Any, inputs: dict[str, Any], n_tokens: int = N_TOKENS) -> Said:
    """Answer one question the slow way, from the model's whole inputs."""
    return _said(model, model.generate(**inputs, **_answering(n_tokens)))[0]


#: The folder's own settings stay, for example a penalty on repetition, but chance and beams do not.
_GREEDY: dict[str, Any] = {"do_sample": False, "num_beams": 1, "use_cache": True}


def _answering(n_tokens: int) -> dict[str, Any]:
    return {
        "max_new_tokens": n_tokens,
        "return_dict_in_generate": True,
        "output_logits": True,
        **_GREEDY,
    }


def _said(model: Any, made: Any) -> list[Said]:
    ends = model.generation_config.eos_token_id
    ends = set(ends if isinstance(ends, list) else [ends])
    rows = made.sequences[:, -len(made.logits) :].tolist()
    first = made.logits[0].float().cpu()  # (n_rows, n_tokens)
    return [Said(_until_end(row, ends), logits) for row, logits in zip(rows, first, strict=True)]


def _until_end(row: list[int], ends: set[int | None]) -> tuple[int, ...]:
    end = next((n for n, token in enumerate(row) if token in ends), len(row))
    return tuple(row[:end])


def _rows_of(cache: Any, chosen: Any) -> Any:
    """A cache with one row a question. Layers replace their tensors and never write into them."""
    rows = copy.copy(cache)
    rows.layers = [copy.copy(layer) for layer in cache.layers]
    rows.batch_select_indices(chosen)
    return rows


def _counting(model: Any) -> Any:
    """The part of a model that remembers `rope_deltas` from call to call, or None."""
    inner = getattr(model, "model", None)
    return inner if hasattr(inner, "rope_deltas") else None
