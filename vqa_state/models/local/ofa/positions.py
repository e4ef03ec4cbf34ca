"""How far apart two places are, as numbers of rows in the tables of learned attention biases."""

import math

import torch
from torch import Tensor

from vqa_state.models.local.ofa.config import MAX_POSITIONS, OfaConfig

__all__ = ["code_positions", "image_buckets", "n_image_buckets", "patch_positions", "word_buckets"]


def word_buckets(size: int) -> Tensor:
    """Row of the table for each pair of words; near pairs one by one, far ones in log steps.

    Returns:
        (MAX_POSITIONS, MAX_POSITIONS) of int64 in 0 to 2 * size - 2.

    Source: T5's relative positions (arXiv 1910.10683, section 2.1) with two-sided buckets.
    """
    place = torch.arange(MAX_POSITIONS)
    apart = place[:, None] - place[None, :]
    middle = size // 2
    near = apart.abs() < middle
    distance = torch.where(near, middle - 1, apart.abs())
    scale = math.log((MAX_POSITIONS - 1) / middle)
    steps = torch.ceil(torch.log(distance / middle) / scale * (middle - 1)).int() + middle
    bucket = torch.where(distance <= middle, apart, steps * torch.sign(apart))
    return bucket.long() + size - 1


def n_image_buckets(size: int) -> int:
    """Rows of the table for size x size places: one an offset, and three for place 0."""
    return (2 * size - 1) ** 2 + 3


def image_buckets(size: int) -> Tensor:
    """Row of the table for each pair of places of an image; place 0 stands for none.

    Returns:
        (size * size + 1, size * size + 1) of int64.

    Source: Swin's relative position bias (arXiv 2103.14030, section 3.2).
    """
    place = torch.arange(size * size)
    row, column = place // size, place % size
    down = row[:, None] - row[None, :] + size - 1
    right = column[:, None] - column[None, :] + size - 1
    inner = down * (2 * size - 1) + right
    last = n_image_buckets(size) - 1
    top = torch.full((1, size * size), last - 2)
    left = torch.full((size * size + 1, 1), last - 1)
    left[0] = last
    return torch.cat([left, torch.cat([top, inner])], dim=1)


def patch_positions(side: int, size: int) -> Tensor:
    """Places of side x side patches in the upper left of a grid of size x size: (side * side,)."""
    step = torch.arange(side)
    return (step[:, None] * size + step[None, :] + 1).flatten()


def code_positions(config: OfaConfig) -> Tensor:
    """Places of the codes of a drawn picture; kept because checkpoints hold it, never used here."""
    side = config.code_image_size // 8
    return torch.cat(
        [
            torch.tensor([0]),
            patch_positions(side, config.image_bucket_size),
            torch.full((768,), 1024),
        ]
    )
