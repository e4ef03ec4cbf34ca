"""The transformer's layers: attention with a bias given from outside, and NormFormer's extra norms.

Source: S. Shleifer et al., *NormFormer*, arXiv 2110.09456. Attribute names are those of the public
checkpoints.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from vqa_state.models.local.ofa.config import OfaConfig

__all__ = ["DecoderLayer", "EncoderLayer", "KeysValues", "position_scores", "split_heads"]

#: Keys and values, each (n, n_heads, length, width of a head).
KeysValues = tuple[Tensor, Tensor]

#: Queries are made smaller for two summands, content and position.
_SUMMANDS = 2


def split_heads(x: Tensor, n_heads: int) -> Tensor:
    """(n, length, width) -> (n, n_heads, length, width / n_heads)."""
    return x.reshape(*x.shape[:2], n_heads, -1).transpose(1, 2)


def position_scores(queries: Tensor, keys: Tensor, n_heads: int) -> Tensor:
    """How much places attend to each other whatever stands there: (1, n_heads, n_from, n_to)."""
    q, k = split_heads(queries, n_heads), split_heads(keys, n_heads)
    return torch.matmul(q * float(q.shape[-1] * _SUMMANDS) ** -0.5, k.transpose(-1, -2))


class Attention(nn.Module):
    """Attention whose heads have learned weights."""

    def __init__(self, width: int, n_heads: int) -> None:
        super().__init__()
        self.n_heads = n_heads
        self.k_proj = nn.Linear(width, width)
        self.v_proj = nn.Linear(width, width)
        self.q_proj = nn.Linear(width, width)
        self.out_proj = nn.Linear(width, width)
        self.c_attn = nn.Parameter(torch.ones(n_heads))

    def keys_values(self, x: Tensor) -> KeysValues:
        """What others see of x: (n, length, width)."""
        return split_heads(self.k_proj(x), self.n_heads), split_heads(self.v_proj(x), self.n_heads)

    def forward(self, x: Tensor, seen: KeysValues, bias: Tensor) -> Tensor:
        """Let each place of x look at what is seen.

        Args:
            x: (n, n_from, width).
            seen: of n_to places.
            bias: (1, n_heads, n_from, n_to), added before the softmax.

        Returns:
            (n, n_from, width).
        """
        queries = split_heads(self.q_proj(x), self.n_heads)
        scale = float(queries.shape[-1] * _SUMMANDS) ** -0.5
        mixed = functional.scaled_dot_product_attention(
            queries, *seen, attn_mask=bias.expand(len(x), -1, -1, -1), scale=scale
        )
        mixed = mixed * self.c_attn[:, None, None]
        out: Tensor = self.out_proj(mixed.transpose(1, 2).flatten(2))
        return out


class _FeedForward(nn.Module):
    """The second half that both kinds of layers share."""

    def __init__(self, width: int, inner: int) -> None:
        super().__init__()
        self.fc1 = nn.Linear(width, inner)
        self.fc2 = nn.Linear(inner, width)
        self.ffn_layer_norm = nn.LayerNorm(inner)
        self.final_layer_norm = nn.LayerNorm(width)

    def feed(self, x: Tensor) -> Tensor:
        """(..., width) -> the same."""
        inner = functional.gelu(self.fc1(self.final_layer_norm(x)))
        out: Tensor = x + self.fc2(self.ffn_layer_norm(inner))
        return out


class EncoderLayer(_FeedForward):
    """All places look at all places."""

    def __init__(self, config: OfaConfig) -> None:
        super().__init__(config.d_model, config.encoder_ffn_dim)
        self.self_attn = Attention(config.d_model, config.encoder_attention_heads)
        self.self_attn_layer_norm = nn.LayerNorm(config.d_model)
        self.self_attn_mid_layer_norm = nn.LayerNorm(config.d_model)

    def forward(self, x: Tensor, bias: Tensor) -> Tensor:
        """(n, length, width) -> the same, with a bias of (1, n_heads, length, length)."""
        normed = self.self_attn_layer_norm(x)
        mixed = self.self_attn(normed, self.self_attn.keys_values(normed), bias)
        x = self.feed(x + self.self_attn_mid_layer_norm(mixed))
        if x.dtype == torch.float16:  # its largest number is soon reached
            x = torch.nan_to_num(x).clamp(-64504, 64504)
        return x


class DecoderLayer(_FeedForward):
    """New words look at earlier ones, then at what was encoded."""

    def __init__(self, config: OfaConfig) -> None:
        super().__init__(config.d_model, config.decoder_ffn_dim)
        width, n_heads = config.d_model, config.decoder_attention_heads
        self.self_attn = Attention(width, n_heads)
        self.self_attn_layer_norm = nn.LayerNorm(width)
        self.self_attn_mid_layer_norm = nn.LayerNorm(width)
        self.cross_attn = Attention(width, n_heads)
        self.cross_attn_layer_norm = nn.LayerNorm(width)
        self.cross_attn_mid_layer_norm = nn.LayerNorm(width)

    def forward(
        self,
        x: Tensor,
        earlier: KeysValues | None,
        encoded: KeysValues,
        self_bias: Tensor,
        cross_bias: Tensor,
    ) -> tuple[Tensor, KeysValues]:
        """Go on with some rows of words for every question.

        Args:
            x: (n_questions * n_rows, n_new, width).
            earlier: what the rows have said so far, or None.
            encoded: of n_questions; all rows of a question look at the same, which is why they go
                through as one long row there.
            self_bias: (1, n_heads, n_new, n_earlier + n_new), minus infinity for later words.
            cross_bias: (1, n_heads, n_new, n_encoded).

        Returns:
            x changed, and the rows' keys and values with the new words in them.
        """
        normed = self.self_attn_layer_norm(x)
        new = self.self_attn.keys_values(normed)
        if earlier is not None:
            new = torch.cat([earlier[0], new[0]], dim=2), torch.cat([earlier[1], new[1]], dim=2)
        x = x + self.self_attn_mid_layer_norm(self.self_attn(normed, new, self_bias))
        n_questions, n_new = len(encoded[0]), x.shape[1]
        normed = self.cross_attn_layer_norm(x).reshape(n_questions, -1, x.shape[-1])
        bias = cross_bias.repeat(1, 1, normed.shape[1] // n_new, 1)
        mixed = self.cross_attn(normed, encoded, bias).view_as(x)
        return self.feed(x + self.cross_attn_mid_layer_norm(mixed)), new
