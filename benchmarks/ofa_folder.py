"""A folder of OFA with random weights, made on the spot: base size, or tiny for tests."""

import json
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["build_ofa"]

_WORDS = (
    *("yes", "no", "open", "closed", "on", "off", "door", "cabinet", "water", "light", "white"),
    *("is", "this", "that", "the", "does", "image", "look", "like", "it", "of", "a", "kitchen"),
)

#: Words, codes of pictures and places of the public checkpoints.
_PUBLIC_VOCABULARY = 59457


def build_ofa(folder: Path, real: bool = False) -> Path:
    """OFA: the sizes of OFA-base with pictures of 480 pixels if `real`, else two layers of 32.

    Its decoder reads the question first, as in checkpoints tuned for VQA.

    Returns:
        The folder.
    """
    from safetensors.torch import save_file

    folder.mkdir(parents=True, exist_ok=True)
    n_words = _write_words(folder)
    config = _base() if real else _tiny(n_words)
    (folder / "config.json").write_text(json.dumps(config), encoding="utf-8")
    save_file(_weights(folder, n_words), folder / "model.safetensors", metadata={"format": "pt"})
    return folder


def _base() -> dict[str, Any]:
    return _config(768, 6, 12, 4 * 768) | {
        "vocab_size": _PUBLIC_VOCABULARY,
        "resnet_type": "resnet101",
        "patch_image_size": 480,
    }


def _tiny(n_words: int) -> dict[str, Any]:
    return _config(32, 2, 4, 48) | {
        "vocab_size": n_words + 8192 + 1000,
        "resnet_type": "resnet18",
        "patch_image_size": 64,
        "image_bucket_size": 8,
    }


def _config(width: int, layers: int, heads: int, inner: int) -> dict[str, Any]:
    sides = {
        f"{side}_{what}": number
        for side in ("encoder", "decoder")
        for what, number in (("layers", layers), ("attention_heads", heads), ("ffn_dim", inner))
    }
    return sides | {"model_type": "ofa", "d_model": width, "prompt_type": "prev_output"}


def _write_words(folder: Path) -> int:
    """Bytes and some whole words, as *vocab.json* and *merges.txt*; how many there are."""
    from tokenizers.pre_tokenizers import ByteLevel

    pieces = ["<s>", "<pad>", "</s>", "<unk>", *sorted(ByteLevel.alphabet())]
    known, merges = set(pieces), []
    for word in _WORDS:
        spelling = "Ġ" + word
        for end in range(2, len(spelling) + 1):
            if (piece := spelling[:end]) not in known:
                known.add(piece)
                pieces.append(piece)
                merges.append(f"{spelling[: end - 1]} {spelling[end - 1]}")
    numbers = {piece: number for number, piece in enumerate(pieces)}
    (folder / "vocab.json").write_text(json.dumps(numbers), encoding="utf-8")
    lines = ["#version: 0.2", *merges]
    (folder / "merges.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return len(pieces)


def _weights(folder: Path, n_words: int) -> "dict[str, Tensor]":
    import torch

    from vqa_state.models.local.ofa.config import read_folder
    from vqa_state.models.local.ofa.network import OfaNetwork

    with torch.device("meta"):
        shapes = OfaNetwork(read_folder(folder)[0]).state_dict()
    return {
        name: _weight(name, shape.shape, n_words)
        for name, shape in shapes.items()
        if not _is_fixed(name)
    }


def _is_fixed(name: str) -> bool:
    """Calculated, or another name of the table of words."""
    calculated = ("_bucket", "position_idx", "num_batches_tracked")
    tied = ("decoder.embed_tokens.weight", "decoder.output_projection.weight")
    return name.endswith(calculated) or name in tied


def _weight(name: str, shape: Any, n_words: int) -> "Tensor":
    """Spread so that question and image change what is said; the same for the same name."""
    import torch

    generator = torch.Generator().manual_seed(zlib.crc32(name.encode()))
    values: Tensor = torch.randn(tuple(shape), generator=generator)
    if name.endswith("embed_tokens.weight"):
        return _words_first(values, n_words)
    if name == "decoder.layer_norm.weight":
        return values.sign()  # else the tied table of words would repeat the question's last one
    if name.endswith(("running_var", "c_attn")) or (values.ndim == 1 and name.endswith("weight")):
        return 1 + 0.2 * values.tanh()  # of norms and heads: near 1
    if values.ndim == 1:
        return 0.1 * values
    if "rel_pos_table" in name or "embed" in name.split(".")[-2]:
        return values
    spread: float = 1.2 / values[0].numel() ** 0.5
    return values * spread


def _words_first(table: "Tensor", n_words: int) -> "Tensor":
    """Codes are seldom said, and an answer ends soon: its end is like many words."""
    table[n_words:] *= 0.3
    table[2] = 0.5 * table[2] + table[4:n_words].mean(dim=0) * (n_words - 4) ** 0.5
    return table
