"""EfficientNet-Lite0 without its classifier, batch normalisation folded into the convolutions.

Source: M. Tan, Q. Le, *EfficientNet*, ICML 2019; the Lite variants (no squeeze-and-excitation,
ReLU6) are from github.com/tensorflow/tpu, models/official/efficientnet/lite.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

__all__ = ["BLOCK_GROUPS", "COARSE_WIDTH", "INPUT_SIZE", "N_TOKENS", "TOKEN_WIDTH", "Trunk"]

#: Pixels a side of the input.
INPUT_SIZE = 224

#: The output is a 7 x 7 map, each place described by the last block and by the 2 x 2 places of an
#: earlier, finer one (a gap at a door's edge is too small for the last block).
N_TOKENS = 49
COARSE_WIDTH = 320
TOKEN_WIDTH = COARSE_WIDTH + 4 * 112


class BlockGroup(NamedTuple):
    """Blocks in a row: the first one changes width and stride."""

    repeats: int
    kernel: int
    stride: int
    expansion: int
    width: int


BLOCK_GROUPS = (
    BlockGroup(1, 3, 1, 1, 16),
    BlockGroup(2, 3, 2, 6, 24),
    BlockGroup(2, 5, 2, 6, 40),
    BlockGroup(3, 3, 2, 6, 80),
    BlockGroup(3, 5, 1, 6, 112),
    BlockGroup(4, 5, 2, 6, 192),
    BlockGroup(1, 3, 1, 6, 320),
)

_STEM_WIDTH = 32

#: The last block at 14 x 14; its output is the finer half of a token.
_FINE_BLOCK = 10


class SameConv(nn.Conv2d):
    """A convolution with TensorFlow's "same" padding, which is uneven at stride 2."""

    def __init__(
        self, inputs: int, outputs: int, kernel: int, stride: int, groups: int = 1
    ) -> None:
        super().__init__(inputs, outputs, kernel, stride, groups=groups)
        total = kernel - stride
        before = total // 2
        self.pad = (before, total - before, before, total - before)

    def forward(self, x: Tensor) -> Tensor:
        """(n, inputs, h, w) -> (n, outputs, h / stride, w / stride); h, w divisible by stride."""
        before, after = self.pad[:2]
        if before != after:
            x, before = functional.pad(x, self.pad), 0
        return functional.conv2d(
            x, self.weight, self.bias, self.stride, before, self.dilation, self.groups
        )


class Block(nn.Module):
    """An inverted residual block: expand, convolve each channel, project, add what came in."""

    def __init__(self, inputs: int, group: BlockGroup, stride: int) -> None:
        super().__init__()
        wide = inputs * group.expansion
        self.expand = SameConv(inputs, wide, 1, 1) if group.expansion != 1 else None
        self.depthwise = SameConv(wide, wide, group.kernel, stride, groups=wide)
        self.project = SameConv(wide, group.width, 1, 1)
        self.adds_input = stride == 1 and inputs == group.width

    def forward(self, x: Tensor) -> Tensor:
        """(n, inputs, h, w) -> (n, width, h / stride, w / stride)."""
        # In place: new memory for every step took a quarter of the time; the bits are the same.
        h: Tensor = x if self.expand is None else functional.relu6(self.expand(x), inplace=True)
        h = functional.relu6(self.depthwise(h), inplace=True)
        h = self.project(h)
        return h.add_(x) if self.adds_input else h


class Trunk(nn.Module):
    """Pixels to image tokens."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = SameConv(3, _STEM_WIDTH, 3, 2)
        blocks, width = [], _STEM_WIDTH
        for group in BLOCK_GROUPS:
            for repeat in range(group.repeats):
                blocks.append(Block(width, group, group.stride if repeat == 0 else 1))
                width = group.width
        self.blocks = nn.ModuleList(blocks)

    def forward(self, pixels: Tensor) -> Tensor:
        """(n, 3, 224, 224) pixels in about [-1, 1] -> tokens (n, 49, 768)."""
        return self.finish(self.begin(pixels, len(self.blocks) // 2), len(self.blocks) // 2)

    def begin(self, pixels: Tensor, n_blocks: int) -> Tensor:
        """The stem and the first `n_blocks` blocks, which training may leave as they are."""
        h = functional.relu6(self.stem(pixels), inplace=True)
        for block in self.blocks[:n_blocks]:
            h = block(h)
        return h

    def finish(self, h: Tensor, n_blocks: int) -> Tensor:
        """Tokens from the output of `begin`; `n_blocks` is at most 11."""
        fine = h
        for number in range(n_blocks, len(self.blocks)):
            h = self.blocks[number](h)
            if number == _FINE_BLOCK:
                fine = h  # (n, 112, 14, 14)
        both = torch.cat([h, functional.pixel_unshuffle(fine, 2)], dim=1)  # (n, 768, 7, 7)
        return both.flatten(2).transpose(1, 2)
