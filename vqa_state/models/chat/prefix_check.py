"""Whether a chat model may read an image once for all questions: tried on a small picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from PIL import Image

from vqa_state.models.address import Device, Precision
from vqa_state.models.chat.prefix_cache import (
    generate_plain,
    generate_suffixes,
    join_inputs,
    on_device,
    read_prefix,
)
from vqa_state.models.chat.prompt import ChatPrompt
from vqa_state.models.local.runtime import Runtime

__all__ = ["Check", "check_prefix"]

_QUESTIONS = ("Is the door open?", "Is there any water in the white sink of this kitchen?")

#: First-step logits of both ways may differ by so much in float32.
_TOLERANCE = 1e-3

#: In half precision the best token must be the same, or as good within so many of the steps that
#: such numbers have there.
_TIE_STEPS = 4

#: In these every token before the answer sees the question, so nothing can be read before it.
_READ_BOTH_WAYS = frozenset({"paligemma"})

#: What models and processors raise where they are not made for one of the steps.
_UNFIT = (ValueError, RuntimeError, TypeError, AttributeError, LookupError, NotImplementedError)


@dataclass(frozen=True, slots=True)
class Check:
    """What came of it.

    Attributes:
        slow_because: "" where a prefix can be read once, else why not.
        cuts: whether an image can be prepared once for all questions.
        n_behind: ids from the last image token on that every question shares.
        joins: whether several images can be read in one go.
    """

    slow_because: str
    cuts: bool = False
    n_behind: int = 0
    joins: bool = False


def check_prefix(model: Any, prompt: ChatPrompt, runtime: Runtime) -> Check:
    """Ask two questions about a small picture in both ways."""
    first, second = _pictures()
    try:
        cuts = prompt.splices(first, _QUESTIONS)
        if model.config.model_type in _READ_BOTH_WAYS or model.config.is_encoder_decoder:
            return Check("it looks at the question while it looks at the image", cuts)
        if not cuts:
            return Check("its text cannot be cut behind the image")
        seen = prompt.see(first)
        n_behind = prompt.n_shared(seen) - len(seen.head)
        problem = _compare(model, prompt, runtime, [first], n_behind)
    except _UNFIT as error:
        return Check(f"what it read cannot be used again ({type(error).__name__})")
    if problem or runtime.device is Device.CPU:  # a processor reads one image at a time
        return Check(problem, cuts, n_behind)
    try:
        joins = not _compare(model, prompt, runtime, [first, second], n_behind)
    except _UNFIT:
        joins = False
    return Check("", cuts, n_behind, joins)


def _compare(
    model: Any, prompt: ChatPrompt, runtime: Runtime, pictures: Sequence[Image.Image], n_behind: int
) -> str:
    """What is wrong with the answers about the last picture; "" if nothing is."""
    seen = [prompt.see(picture) for picture in pictures]
    rows = [prompt.ids(seen[-1], question) for question in _QUESTIONS]
    length = len(seen[-1].head) + n_behind
    inputs = join_inputs([prompt.inputs(one, rows[0][:length]) for one in seen])
    prefix = read_prefix(model, on_device(model, inputs), prompt.image_token)
    if not prefix.is_usable:
        return "what it read cannot be copied"
    for chunk in prefix.chunks(rows):
        places = [len(seen) - 1] * len(chunk)
        suffixes = [rows[n][length:] for n in chunk]
        fast = generate_suffixes(model, prefix, places, suffixes, n_tokens=1)
        for n, said in zip(chunk, fast, strict=True):
            whole = on_device(model, prompt.inputs(seen[-1], rows[n]))
            if not _agree(said.logits, generate_plain(model, whole, 1).logits, runtime):
                return "reading it once gave other answers on a test picture"
    return ""


def _agree(fast: Any, slow: Any, runtime: Runtime) -> bool:
    import torch

    if runtime.precision is Precision.FLOAT32:
        return bool(torch.allclose(fast, slow, rtol=0.0, atol=_TOLERANCE))
    step = float(torch.finfo(runtime.dtype).eps) * float(slow.abs().max())
    return float(fast.max() - fast[slow.argmax()]) <= _TIE_STEPS * step


def _pictures() -> tuple[Image.Image, Image.Image]:
    """Of one size, in steps of grey: no part of them looks like another."""
    grey = Image.linear_gradient("L").convert("RGB")
    return grey, grey.transpose(Image.Transpose.ROTATE_90)
