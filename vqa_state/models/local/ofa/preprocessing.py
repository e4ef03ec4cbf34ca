"""Images and questions as OFA was trained to see and read them."""

import re
from typing import TYPE_CHECKING

import numpy as np
from PIL.Image import Image, Resampling

from vqa_state.models.local.ofa.config import AskingStyle

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["clean_question", "to_pixels"]

_LEADING = ",.!?*#:;~"

_IMAGENET = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
_CENTRED = (0.5, 0.5, 0.5), (0.5, 0.5, 0.5)


def to_pixels(image: Image, style: AskingStyle) -> "Tensor":
    """Squeeze an image into a square: (1, 3, side, side) of float32, -1 to 1 in the usual style."""
    import torch

    side = style.patch_image_size
    small = image.convert("RGB").resize((side, side), Resampling.BICUBIC)
    mean, deviation = _IMAGENET if style.imagenet_default_mean_and_std else _CENTRED
    pixels = np.asarray(small, np.float32) / np.float32(255)
    values = (pixels - np.array(mean, np.float32)) / np.array(deviation, np.float32)
    return torch.from_numpy(values).permute(2, 0, 1)[None].contiguous()


def clean_question(question: str) -> str:
    """The question as the training data had it: lower case, one leading space, a "?" at its end."""
    text = question.lower().lstrip(_LEADING).replace("-", " ").replace("/", " ")
    text = re.sub(r"\s{2,}", " ", text).rstrip("\n").strip(" ")
    return f" {text}" if text.endswith("?") else f" {text}?"
