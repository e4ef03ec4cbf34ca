"""A tiny OFA whose weights follow from a rule, so that they need no file: tests and the script
that asks the reference implementation use the same ones."""

import zlib

import numpy as np

SIZES = {
    "tiny": (256, 4, 4, 4, "resnet50"),
    "medium": (512, 4, 4, 8, "resnet101"),
    "base": (768, 6, 6, 12, "resnet101"),
    "large": (1024, 12, 12, 16, "resnet152"),
    "huge": (1280, 24, 12, 16, "resnet152"),
}

#: Numbers after the words of the golden vocabulary, as in the public ones.
N_CODES = 8192 + 1000


def sizes_config(name):
    """config.json of a public size, as the authors' architecture functions have it."""
    width, encoder, decoder, heads, resnet = SIZES[name]
    return {
        "d_model": width,
        "encoder_layers": encoder,
        "decoder_layers": decoder,
        "encoder_attention_heads": heads,
        "decoder_attention_heads": heads,
        "encoder_ffn_dim": 4 * width,
        "decoder_ffn_dim": 4 * width,
        "resnet_type": resnet,
    }


def small_config(n_words):
    """A network of the same shape that is tested number by number."""
    return {
        "vocab_size": n_words + N_CODES,
        "d_model": 32,
        "encoder_layers": 2,
        "decoder_layers": 2,
        "encoder_attention_heads": 4,
        "decoder_attention_heads": 4,
        "encoder_ffn_dim": 48,
        "decoder_ffn_dim": 40,
        "resnet_type": "resnet18",
        "image_bucket_size": 8,
    }


def weight(name, shape, n_words):
    """The weight called `name`: float32, never the same for two names."""
    random = np.random.RandomState(zlib.crc32(name.encode()))
    values = random.standard_normal(shape).astype(np.float32)
    if name.endswith("embed_tokens.weight"):
        values[n_words:] *= 0.3  # codes are seldom the answer
        values[2] = 0.5 * values[2] + 0.6 * values[75] + 0.6 * values[63]  # like two frequent words
        return values
    if name.endswith(("running_var", "c_attn")) or (len(shape) == 1 and name.endswith("weight")):
        return 1 + 0.2 * np.tanh(values)  # of norms and heads: near 1
    if len(shape) == 1:
        return 0.1 * values
    if "rel_pos_table" in name or "embed" in name.split(".")[-2]:
        return values
    return values * np.float32(1.2 * np.prod(shape[1:]) ** -0.5)


def learned_weights(shapes, n_words):
    """Weights for all names but the table's other two names and what is calculated."""
    skipped = ("_bucket", "position_idx", "num_batches_tracked")
    tied = ("decoder.embed_tokens.weight", "decoder.output_projection.weight")
    return {
        name: weight(name, tuple(shape), n_words)
        for name, shape in shapes.items()
        if not name.endswith(skipped) and name not in tied
    }


def picture(number, height, width):
    """Pixels of a picture that follow from its number: (height, width, 3) of uint8."""
    return np.random.RandomState(number).randint(0, 256, (height, width, 3)).astype(np.uint8)
