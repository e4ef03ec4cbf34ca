"""OFA's encoder and decoder. Attribute names are those of the public checkpoints.

An image is looked at once (`Encoder.see`) for all questions about it. Questions of one length go
through together, so that nothing is padded and all of them share one table of position biases.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from vqa_state.models.local.ofa import positions
from vqa_state.models.local.ofa.config import RESNETS, OfaConfig
from vqa_state.models.local.ofa.layers import (
    DecoderLayer,
    EncoderLayer,
    KeysValues,
    position_scores,
)
from vqa_state.models.local.ofa.vision import PATCH_WIDTH, ResNet

__all__ = ["Encoded", "OfaNetwork", "Said", "fixed_buffers"]

_TEXT, _IMAGE = 0, 1


class Encoded(NamedTuple):
    """Questions of one length, each with the image that it is about.

    Attributes:
        states: (n_questions, n_patches + n_tokens, width).
        places: their position embeddings, (1, n_patches + n_tokens, width).
    """

    states: Tensor
    places: Tensor


@dataclass(slots=True)
class Said:
    """What the decoder keeps while it answers some questions.

    Attributes:
        encoded: keys and values of the questions, one pair a layer.
        cross_keys: (1, n_encoded, width), where the encoded places are.
        rows: keys and values of the words so far, one pair a layer; empty at the beginning.
        n_words: words so far.
    """

    encoded: list[KeysValues]
    cross_keys: Tensor
    rows: list[KeysValues]
    n_words: int = 0

    def choose_rows(self, chosen: Tensor) -> None:
        """Keep these of the n_questions * n_rows rows, each as often as it is named."""
        self.rows = [(k.index_select(0, chosen), v.index_select(0, chosen)) for k, v in self.rows]


class _Positions(nn.Module):
    """What encoder and decoder both know about places."""

    def __init__(self, config: OfaConfig, n_layers: int, n_heads: int) -> None:
        super().__init__()
        width = config.d_model
        self.n_heads = n_heads
        self.image_bucket_size = config.image_bucket_size
        self.embed_tokens = nn.Embedding(config.vocab_size, width)
        self.embed_positions = nn.Embedding(config.max_position_embeddings + 2, width)
        self.embed_image_positions = nn.Embedding(config.image_bucket_size**2 + 1, width)
        self.pos_ln = nn.LayerNorm(width)
        self.image_pos_ln = nn.LayerNorm(width)
        self.layernorm_embedding = nn.LayerNorm(width)
        self.layer_norm = nn.LayerNorm(width)
        n_words = 2 * config.token_bucket_size - 1
        n_places = positions.n_image_buckets(config.image_bucket_size)
        self.token_rel_pos_table_list = _tables(n_layers, n_words, n_heads)
        self.image_rel_pos_table_list = _tables(n_layers, n_places, n_heads)
        self.register_buffer("token_rp_bucket", positions.word_buckets(config.token_bucket_size))
        self.register_buffer("image_rp_bucket", positions.image_buckets(config.image_bucket_size))
        self.token_rp_bucket: Tensor
        self.image_rp_bucket: Tensor


class Encoder(_Positions):
    """Reads an image and a question together."""

    def __init__(self, config: OfaConfig) -> None:
        super().__init__(config, config.encoder_layers, config.encoder_attention_heads)
        width = config.d_model
        self.type_embedding = nn.Embedding(2, width)
        self.embed_images = ResNet(RESNETS[config.resnet_type])
        self.image_proj = nn.Linear(PATCH_WIDTH, width)
        self.patch_layernorm_embedding = nn.LayerNorm(width)
        self.pos_q_linear = nn.Linear(width, width)
        self.pos_k_linear = nn.Linear(width, width)
        self.layers = nn.ModuleList(EncoderLayer(config) for _ in range(config.encoder_layers))

    def see(self, pixels: Tensor) -> Tensor:
        """What does not depend on a question: (n, 3, side, side) -> (n, n_patches, width)."""
        patches = self.embed_images(pixels).flatten(2).transpose(1, 2)
        x = self.image_proj(patches) + self.type_embedding.weight[_IMAGE]
        seen: Tensor = self.patch_layernorm_embedding(x)
        return seen

    def forward(self, seen: Tensor, tokens: Tensor) -> Encoded:
        """Read questions of one length about one image.

        Args:
            seen: of one image, (1, n_patches, width).
            tokens: (n_questions, n_tokens).
        """
        n_patches, n_tokens = seen.shape[1], tokens.shape[1]
        x = self.embed_tokens(tokens) + self.type_embedding.weight[_TEXT]
        x = torch.cat([seen.expand(len(tokens), -1, -1), self.layernorm_embedding(x)], dim=1)
        patches = positions.patch_positions(round(n_patches**0.5), self.image_bucket_size)
        patches = patches.to(tokens.device)
        places = torch.cat(
            [
                self.image_pos_ln(self.embed_image_positions(patches)),
                self.pos_ln(self.embed_positions.weight[:n_tokens]),
            ]
        )[None]
        absolute = position_scores(
            self.pos_q_linear(places), self.pos_k_linear(places), self.n_heads
        )
        image_rows = self.image_rp_bucket[patches[:, None], patches]
        word_rows = self.token_rp_bucket[:n_tokens, :n_tokens]
        for number, layer in enumerate(self.layers):
            bias = absolute.clone()
            bias[..., :n_patches, :n_patches] += _rows(
                self.image_rel_pos_table_list[number], image_rows
            )
            bias[..., n_patches:, n_patches:] += _rows(
                self.token_rel_pos_table_list[number], word_rows
            )
            x = layer(x, bias)
        return Encoded(self.layer_norm(x), places)


class Decoder(_Positions):
    """Says words after words."""

    def __init__(self, config: OfaConfig) -> None:
        super().__init__(config, config.decoder_layers, config.decoder_attention_heads)
        width = config.d_model
        self.code_layernorm_embedding = nn.LayerNorm(width)  # for drawing pictures: never used
        self.register_buffer("image_position_idx", positions.code_positions(config))
        self.self_pos_q_linear = nn.Linear(width, width)
        self.self_pos_k_linear = nn.Linear(width, width)
        self.cross_pos_q_linear = nn.Linear(width, width)
        self.cross_pos_k_linear = nn.Linear(width, width)
        self.layers = nn.ModuleList(DecoderLayer(config) for _ in range(config.decoder_layers))
        self.output_projection = nn.Linear(width, config.vocab_size, bias=False)

    def begin(self, encoded: Encoded) -> Said:
        """Get ready to answer."""
        keys_values = [layer.cross_attn.keys_values(encoded.states) for layer in self._layers()]
        return Said(keys_values, self.cross_pos_k_linear(encoded.places), [])

    def forward(self, tokens: Tensor, said: Said) -> Tensor:
        """Go on with new words, and keep them in `said`.

        Args:
            tokens: (n_questions * n_rows, n_new), the rows of a question beside each other.
            said: of these questions and rows.

        Returns:
            (n_questions * n_rows, n_new, width), to be given to `score_words`.
        """
        n_new, before = tokens.shape[1], said.n_words
        n_words = before + n_new
        places = self.pos_ln(self.embed_positions.weight[:n_words])[None]
        new = places[:, before:]
        absolute = position_scores(
            self.self_pos_q_linear(new), self.self_pos_k_linear(places), self.n_heads
        )
        later = torch.ones(n_new, n_words, dtype=torch.bool, device=tokens.device)
        absolute = absolute.masked_fill(later.triu(before + 1), -torch.inf)
        cross = position_scores(self.cross_pos_q_linear(new), said.cross_keys, self.n_heads)
        word_rows = self.token_rp_bucket[before:n_words, :n_words]
        x = self.layernorm_embedding(self.embed_tokens(tokens))
        rows: list[KeysValues] = []
        for number, layer in enumerate(self._layers()):
            bias = absolute + _rows(self.token_rel_pos_table_list[number], word_rows)
            earlier = said.rows[number] if said.rows else None
            x, kept = layer(x, earlier, said.encoded[number], bias, cross)
            rows.append(kept)
        said.rows, said.n_words = rows, n_words
        normed: Tensor = self.layer_norm(x)
        return normed

    def score_words(self, x: Tensor, words: Sequence[int] | None = None) -> Tensor:
        """Logits of the next word, or of some words, in float32: (..., width) -> (..., n_words)."""
        if words is None:
            logits: Tensor = self.output_projection(x)
        else:
            logits = functional.linear(x, self.output_projection.weight[list(words)])
        return logits.float()

    def _layers(self) -> list[DecoderLayer]:
        return [layer for layer in self.layers if isinstance(layer, DecoderLayer)]


class OfaNetwork(nn.Module):
    """Encoder and decoder with one table of words for reading and for saying."""

    def __init__(self, config: OfaConfig) -> None:
        super().__init__()
        self.encoder = Encoder(config)
        self.decoder = Decoder(config)
        self.tie()

    def tie(self) -> None:
        """Let the three uses of the table of words be one tensor (again, after loading)."""
        table = self.encoder.embed_tokens.weight
        self.decoder.embed_tokens.weight = table
        self.decoder.output_projection.weight = table


def fixed_buffers(config: OfaConfig) -> dict[str, Tensor]:
    """The tensors of a checkpoint that are calculated, not learned."""
    words = positions.word_buckets(config.token_bucket_size)
    places = positions.image_buckets(config.image_bucket_size)
    both = {
        f"{part}.{name}": value
        for part in ("encoder", "decoder")
        for name, value in (("token_rp_bucket", words), ("image_rp_bucket", places))
    }
    return both | {"decoder.image_position_idx": positions.code_positions(config)}


def _tables(n_tables: int, n_rows: int, n_heads: int) -> nn.ModuleList:
    return nn.ModuleList(nn.Embedding(n_rows, n_heads) for _ in range(n_tables))


def _rows(table: nn.Module, numbers: Tensor) -> Tensor:
    """Biases (n_heads, n_from, n_to) from the rows of a table of (n_rows, n_heads)."""
    weight: Tensor = table.weight  # type: ignore[assignment]
    return weight.T.contiguous()[:, numbers]
