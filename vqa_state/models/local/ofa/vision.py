"""The part of OFA that looks at pixels: a ResNet without its last stage.

Source: K. He et al., *Deep Residual Learning for Image Recognition*, arXiv 1512.03385, with the
stride in the 3 x 3 convolution; attribute names are those of the public checkpoints.
"""

from collections.abc import Sequence

from torch import Tensor, nn
from torch.nn import functional

__all__ = ["PATCH_WIDTH", "ResNet"]

#: Numbers that describe one place of 16 x 16 pixels.
PATCH_WIDTH = 1024

_WIDEN = 4


class Bottleneck(nn.Module):
    """Narrow, look around, widen; the input is added."""

    def __init__(self, inputs: int, width: int, stride: int) -> None:
        super().__init__()
        outputs = width * _WIDEN
        self.conv1 = nn.Conv2d(inputs, width, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.conv3 = nn.Conv2d(width, outputs, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(outputs)
        self.downsample = None
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs)
            )

    def forward(self, x: Tensor) -> Tensor:
        """(n, inputs, h, w) -> (n, 4 * width, h / stride, w / stride)."""
        kept = x if self.downsample is None else self.downsample(x)
        x = functional.relu(self.bn1(self.conv1(x)))
        x = functional.relu(self.bn2(self.conv2(x)))
        return functional.relu(kept + self.bn3(self.conv3(x)))


class ResNet(nn.Module):
    """Three stages of bottlenecks; one place of the result stands for 16 x 16 pixels."""

    def __init__(self, n_blocks: Sequence[int]) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(3, 64, 7, stride=2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.layer1 = _stage(64, 64, n_blocks[0], stride=1)
        self.layer2 = _stage(256, 128, n_blocks[1], stride=2)
        self.layer3 = _stage(512, 256, n_blocks[2], stride=2)

    def forward(self, pixels: Tensor) -> Tensor:
        """(n, 3, h, w) -> (n, PATCH_WIDTH, ceil(h / 16), ceil(w / 16))."""
        x = functional.relu(self.bn1(self.conv1(pixels)))
        x = functional.max_pool2d(x, 3, stride=2, padding=1)
        patches: Tensor = self.layer3(self.layer2(self.layer1(x)))
        return patches


def _stage(inputs: int, width: int, n_blocks: int, stride: int) -> nn.Sequential:
    first = Bottleneck(inputs, width, stride)
    rest = [Bottleneck(width * _WIDEN, width, 1) for _ in range(n_blocks - 1)]
    return nn.Sequential(first, *rest)
