"""Random weights under which questions and images change the answers, and answers differ."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor, nn

__all__ = ["even", "favour", "lengthen", "shorten", "spread"]


def spread(model: "nn.Module", seed: int) -> None:
    """New weights from the seed, so large that what goes in shows in what comes out."""
    import torch
    from torch import nn

    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        norms = [module for module in model.modules() if "Norm" in type(module).__name__]
        kept = {weight for norm in norms for weight in norm.parameters()}
        for name, weight in model.named_parameters():
            if weight in kept:
                continue
            if weight.ndim < 2:
                nn.init.normal_(weight, std=0.1, generator=generator)
                continue
            std = _gain(name) / math.sqrt(weight[0].numel())
            nn.init.normal_(weight, std=std, generator=generator)


def _gain(name: str) -> float:
    if "text_model.layers" in name and ("q_proj" in name or "k_proj" in name):
        return 1.5  # thirty layers of sharper attention blow the last digits up
    # Sharp attention: an average over everything forgets what was asked.
    if any(part in name for part in ("query", "key", "q_proj", "k_proj")):
        return 2.5
    if name.startswith("text_") and "output.dense" in name:
        return 0.3  # each of the many layers covers a bit of what went in; a trace shall stay
    if name.startswith("text_") and "embeddings" in name:
        return 4.0  # the last matrix of BLIP is its first: far apart words answer far apart
    is_vilt = name.startswith(("vilt.", "classifier."))
    return 2.0 if "embedding" in name or (is_vilt and "attention" in name) else 1.0


#: Asked about noise, to find what a generator would say to everything.
_PROBES = (
    *("is this door open?", "does that image look like the window is closed?", "is it on?"),
    *("is there water in the sink?", "is that a kitchen cabinet?", "is the light off?"),
)


def even(model: Any, processor: Any, bias: "Tensor", seed: int) -> None:
    """Take from the bias what the first token has for every question."""
    import torch

    generator = torch.Generator().manual_seed(seed)
    side = model.config.vision_config.image_size
    found = []
    for probe in _PROBES:
        pixels = torch.randn(1, 3, side, side, generator=generator)
        said = model.generate(
            input_ids=processor.tokenizer(probe, return_tensors="pt").input_ids,
            pixel_values=pixels,
            max_new_tokens=1,
            do_sample=False,
            output_logits=True,
            return_dict_in_generate=True,
        )
        found.append(said.logits[0][0])
    with torch.no_grad():
        bias -= torch.stack(found).mean(dim=0)


def favour(bias: "Tensor", answers: Sequence[int], end: int) -> None:
    """Make a generator speak in these tokens, more often in the first two, seldom in none."""
    import torch

    with torch.no_grad():
        allowed = torch.zeros_like(bias, dtype=torch.bool)
        allowed[[*answers, end]] = True
        bias[~allowed] = -30.0
        bias[list(answers[:2])] += 1.0
        bias[end] -= 8.0


def shorten(embeddings: Any, last: Any, end: int) -> None:
    """Let the later places of an answer ask for its end, as in short answers.

    What a place brings in comes through to the last matrix, which is that of the words, if the
    layer before it turns nothing.
    """
    import torch

    with torch.no_grad():
        torch.nn.init.eye_(last.weight)
        embeddings.position_embeddings.weight[1:] += 3.0 * embeddings.word_embeddings.weight[end]


def lengthen(head: "Tensor", answers: Sequence[int]) -> None:
    """Make a generator speak mostly in these tokens, by longer rows of its last matrix."""
    import torch

    with torch.no_grad():
        head[list(answers)] *= 4.0
