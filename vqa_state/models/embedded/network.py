"""The network: an image is encoded once, then every question attends to it with a few slots.

Every question reads one of six *views* of the image, each made from another part of the tokens'
channels. Which one is drawn by the question's own words (`view_of`). Were all questions to read the
same, they would all err on the same images, and choosing among them would change nothing. Source of
the idea: T. K. Ho, *The Random Subspace Method for Constructing Decision Forests*, PAMI 1998.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from vqa_state.models.embedded.text import MAX_WORDS, N_BUCKETS
from vqa_state.models.embedded.trunk import COARSE_WIDTH, N_TOKENS, TOKEN_WIDTH, Trunk
from vqa_state.models.embedded.vocabulary import ANSWERS

__all__ = ["N_VIEWS", "ImageMemory", "VQANetwork"]

_WIDTH = 160
_N_HEADS = 4
_WORD_WIDTH = 128

#: Views of an image; see `_channels`.
N_VIEWS = 6


@dataclass(frozen=True, slots=True)
class ImageMemory:
    """Images as questions attend to them: keys and values of every layer.

    Each tensor is of shape (n_images x n_views, n_heads, 49, width / n_heads).
    """

    keys_values: tuple[tuple[Tensor, Tensor], ...]


class SlotAttention(nn.Module):
    """Multi-head attention and a feed-forward layer, each with its residual."""

    def __init__(self, dropout: float = 0.1) -> None:
        super().__init__()
        self.query_norm = nn.LayerNorm(_WIDTH)
        self.query = nn.Linear(_WIDTH, _WIDTH)
        self.key_value = nn.Linear(_WIDTH, 2 * _WIDTH)
        self.merge = nn.Linear(_WIDTH, _WIDTH)
        self.forward_norm = nn.LayerNorm(_WIDTH)
        self.feed_forward = nn.Sequential(
            nn.Linear(_WIDTH, 2 * _WIDTH),
            nn.GELU(),
            nn.Dropout(dropout),
            nn.Linear(2 * _WIDTH, _WIDTH),
        )

    def keys_and_values(self, source: Tensor) -> tuple[Tensor, Tensor]:
        """Keys and values of a (n, length, width) source: (n, n_heads, length, width / n_heads)."""
        key, value = self.key_value(source).chunk(2, dim=-1)
        return _split_heads(key), _split_heads(value)

    def forward(
        self, x: Tensor, memory: tuple[Tensor, Tensor], mask: Tensor | None = None
    ) -> Tensor:
        """Slots (n, length, width) attend to a memory where `mask`, (n, 1, 1, source), is true."""
        query = _split_heads(self.query(self.query_norm(x)))
        read = functional.scaled_dot_product_attention(query, *memory, attn_mask=mask)
        x = x + self.merge(read.transpose(1, 2).flatten(2))
        forward: Tensor = self.feed_forward(self.forward_norm(x))
        return x + forward


class QuestionEncoder(nn.Module):
    """Encodes the words of a question as slots, the queries with which it attends to an image."""

    def __init__(self, n_slots: int, n_layers: int = 2) -> None:
        super().__init__()
        # The mean of a word's pieces; row 0, the padding, is left out of it.
        self.pieces = nn.EmbeddingBag(N_BUCKETS, _WORD_WIDTH, mode="mean", padding_idx=0)
        nn.init.normal_(self.pieces.weight, std=0.05)
        self.widen = nn.Linear(_WORD_WIDTH, _WIDTH)
        self.place = nn.Parameter(torch.randn(MAX_WORDS, _WIDTH) * 0.05)
        self.layers = nn.ModuleList([SlotAttention() for _ in range(n_layers)])
        self.slots = nn.Parameter(torch.randn(n_slots, _WIDTH) * 0.1)
        self.collect = SlotAttention()

    def forward(self, buckets: Tensor) -> Tensor:
        """Buckets (n, MAX_WORDS, N_PIECES) -> slots (n, n_slots, width)."""
        n_questions, n_words, n_pieces = buckets.shape
        pieces = self.pieces(buckets.reshape(-1, n_pieces)).view(n_questions, n_words, -1)
        x = self.widen(pieces * _WORD_WIDTH**0.5) + self.place[:n_words]
        mask = (buckets[:, :, 0] > 0)[:, None, None, :]
        for layer in self.layers:
            assert isinstance(layer, SlotAttention)  # noqa: S101  (nn.ModuleList forgets types)
            x = layer(x, layer.keys_and_values(layer.query_norm(x)), mask)
        slots = self.slots.expand(n_questions, -1, -1)
        return self.collect(slots, self.collect.keys_and_values(x), mask)  # type: ignore[no-any-return]


class VQANetwork(nn.Module):
    """Encodes every image once and every question once (`read`), then answers all pairs."""

    temperature: Tensor

    def __init__(self, n_slots: int = 4, n_layers: int = 3) -> None:
        super().__init__()
        self.trunk = Trunk()
        self._channels = _channels()
        self.views = nn.ModuleList([_narrowing(len(channels)) for channels in self._channels])
        # Divides the difference of the logits of "yes" and "no"; set after training.
        self.register_buffer("temperature", torch.ones(()))
        self.token_dropout = nn.Dropout(0.2)
        self.place = nn.Parameter(torch.randn(N_TOKENS, _WIDTH) * 0.02)
        self.read = QuestionEncoder(n_slots)
        self.layers = nn.ModuleList([SlotAttention() for _ in range(n_layers)])
        self.decide = nn.Sequential(
            nn.LayerNorm(n_slots * _WIDTH),
            nn.Linear(n_slots * _WIDTH, _WIDTH),
            nn.GELU(),
            nn.Dropout(0.2),
            nn.Linear(_WIDTH, len(ANSWERS)),
        )

    def encode_images(self, pixels: Tensor) -> ImageMemory:
        """(n_images, 3, 224, 224) pixels in about [-1, 1] -> keys and values."""
        return self.encode_tokens(self.trunk(pixels))

    def encode_tokens(self, tokens: Tensor) -> ImageMemory:
        """Tokens (n_images, 49, 768) -> keys and values of every view."""
        views = [
            view(tokens[..., channels])
            for view, channels in zip(self.views, self._channels, strict=True)
        ]
        source = self.token_dropout(torch.stack(views, dim=1).flatten(0, 1)) + self.place
        return ImageMemory(
            tuple(
                layer.keys_and_values(source)
                for layer in self.layers
                if isinstance(layer, SlotAttention)
            )
        )

    def answer(self, memory: ImageMemory, slots: Tensor) -> Tensor:
        """Slots (n_images, n_views, n, n_slots, width) -> logits (n_images, n_views, n, n_answers).

        There are `n` questions for each view. All questions of one view stand in one row of slots;
        slots never read each other, so questions do not either.
        """
        n_images, n_views, n_questions, n_slots, width = slots.shape
        x = slots.reshape(n_images * n_views, n_questions * n_slots, width)
        for layer, keys_values in zip(self.layers, memory.keys_values, strict=True):
            x = layer(x, keys_values)
        x = x.reshape(n_images, n_views, n_questions, n_slots * width)
        return self.decide(x)  # type: ignore[no-any-return]


def _channels() -> list[list[int]]:
    """The channels of each view: the coarse map, the fine one, and two drawn pairs of halves."""
    coarse, fine = list(range(COARSE_WIDTH)), list(range(COARSE_WIDTH, TOKEN_WIDTH))
    halves = []
    for seed in range((N_VIEWS - 2) // 2):
        drawn = np.random.default_rng(seed).permutation(TOKEN_WIDTH)
        halves += [sorted(half.tolist()) for half in np.split(drawn, 2)]
    return [coarse, fine, *halves]


def _narrowing(n_channels: int) -> nn.Sequential:
    """Tokens of one view to the width of the reader."""
    return nn.Sequential(
        nn.LayerNorm(n_channels), nn.Linear(n_channels, _WIDTH), nn.GELU(), nn.LayerNorm(_WIDTH)
    )


def _split_heads(x: Tensor) -> Tensor:
    """(n, length, width) -> (n, n_heads, length, width / n_heads)."""
    n, length, width = x.shape
    return x.view(n, length, _N_HEADS, width // _N_HEADS).transpose(1, 2)
