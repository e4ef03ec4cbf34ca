"""Pooled features of the embedded model's image network, one row of numbers a picture.

The linear probe (`vqa_state.evaluation.linear_probe`) is trained on them: the baseline of labelled
images and an image network, without questions.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL.Image import Image

if TYPE_CHECKING:
    from vqa_state.models.embedded.trunk import Trunk

__all__ = ["FEATURES_VERSION", "PooledFeatures"]

FEATURES_VERSION = 1
"""Changes whenever code changes a feature that the weights' hash does not."""

_BATCH = 8


class PooledFeatures:
    """Pictures to features: mean and largest value of every channel over the tokens.

    Attributes:
        n_features: numbers a picture.
        fingerprint: all that can change a feature: version, weights' hash, precision, input size.
    """

    def __init__(self, weights: Path | None = None) -> None:
        """Load the shipped weights, or those at another path.

        Raises:
            ModuleNotFoundError: if torch or safetensors is not installed.
            ModelError: if the weights are missing or damaged.
        """
        # Torch is imported here, so that naming this class loads nothing heavy.
        from vqa_state.models.embedded.trunk import INPUT_SIZE, TOKEN_WIDTH
        from vqa_state.models.embedded.weights import WEIGHTS, load_network, weights_digest

        path = WEIGHTS if weights is None else weights
        self._trunk: Trunk = load_network(path).trunk
        self.n_features = 2 * TOKEN_WIDTH
        self.fingerprint = (
            f"pooled {FEATURES_VERSION}; weights {weights_digest(path)}; float32; {INPUT_SIZE} px"
        )

    def __call__(self, images: Sequence[Image]) -> Iterator[NDArray[np.float32]]:
        """Yield the features of every image, (n_features,), in order, some images at a time."""
        import torch

        from vqa_state.models.embedded.pixels import normalise, to_square

        for start in range(0, len(images), _BATCH):
            squares = np.stack(list(map(to_square, images[start : start + _BATCH])))
            pixels = torch.from_numpy(normalise(squares))
            with torch.inference_mode():
                tokens = self._trunk(pixels.contiguous(memory_format=torch.channels_last))
                pooled = torch.cat([tokens.mean(dim=1), tokens.amax(dim=1)], dim=1)
            yield from pooled.numpy()
