"""What a folder of OFA says about itself: the network's sizes, and how it wants to be asked."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from pathlib import Path
from typing import Any

from vqa_state.errors import ModelError
from vqa_state.models.local.families import read_config

__all__ = ["RESNETS", "AskingStyle", "DecoderPrompt", "OfaConfig", "read_folder"]

#: Blocks of the three stages. The last stage of the usual ResNet is left out, and every block is a
#: bottleneck, also in the two small ones.
RESNETS = {
    "resnet18": (2, 2, 2),
    "resnet34": (3, 4, 6),
    "resnet50": (3, 4, 6),
    "resnet101": (3, 4, 23),
    "resnet152": (3, 8, 36),
}

#: Positions that the table of relative distances between words knows.
MAX_POSITIONS = 1024

#: Switches that are so in every public checkpoint; this port has no other way.
_FIXED = {
    "activation_function": "gelu",
    "add_type_embedding": True,
    "attn_scale_factor": 2,
    "bos_token_id": 0,
    "code_layernorm_embedding": True,
    "decoder_normalize_before": True,
    "encoder_normalize_before": True,
    "entangle_position_embedding": False,
    "eos_token_id": 2,
    "layernorm_embedding": True,
    "normformer": True,
    "pad_token_id": 1,
    "patch_layernorm_embedding": True,
    "scale_embedding": False,
    "share_attn_bias": False,
    "share_decoder_input_output_embed": True,
    "use_gamma_feature": False,
    "use_image_feature": True,
    "use_ofasys": False,
}

_MAX_SIZE = 1_000_000


class DecoderPrompt(StrEnum):
    """What the decoder reads before it answers; a checkpoint must be asked as it was trained."""

    NONE = "none"
    SRC = "src"
    PREV_OUTPUT = "prev_output"


@dataclass(frozen=True, slots=True)
class OfaConfig:
    """Sizes of the network, named as in the public `config.json`; the defaults are theirs.

    Raises:
        ModelError: if a size cannot be used.
    """

    vocab_size: int = 59457
    max_position_embeddings: int = 1024
    d_model: int = 512
    encoder_layers: int = 4
    encoder_ffn_dim: int = 2048
    encoder_attention_heads: int = 8
    decoder_layers: int = 4
    decoder_ffn_dim: int = 2048
    decoder_attention_heads: int = 8
    token_bucket_size: int = 256
    image_bucket_size: int = 42
    code_image_size: int = 128
    resnet_type: str = "resnet101"

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name != "resnet_type" and not _is_size(value):
                raise ModelError(f"config.json: {field.name} is {value!r}, not a positive number")
        if self.resnet_type not in RESNETS:
            raise ModelError(
                f"config.json: resnet_type is {self.resnet_type!r}; known are {', '.join(RESNETS)}"
            )
        for heads in (self.encoder_attention_heads, self.decoder_attention_heads):
            if self.d_model % heads:
                raise ModelError(
                    f"config.json: d_model {self.d_model} cannot be shared by {heads} heads"
                )

    @property
    def max_tokens(self) -> int:
        """Words and marks that a text may have, begin and end included."""
        return min(self.max_position_embeddings, MAX_POSITIONS)


@dataclass(frozen=True, slots=True)
class AskingStyle:
    """How a checkpoint was trained to be asked.

    Attributes:
        patch_image_size: pixels a side that an image is resized to.
        imagenet_default_mean_and_std: colours centred as for ImageNet instead of -1 to 1.
        prompt_type: what the decoder reads first.
        max_src_length: tokens of a question; a longer one is refused, not cut.
        answers: if any, the best of them is the answer; else the model speaks freely.

    Raises:
        ModelError: if a value cannot be used.
    """

    patch_image_size: int = 480
    imagenet_default_mean_and_std: bool = False
    prompt_type: DecoderPrompt = DecoderPrompt.NONE
    max_src_length: int = 128
    answers: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("patch_image_size", "max_src_length"):
            if not _is_size(getattr(self, name)):
                raise ModelError(f"config.json: {name} is {getattr(self, name)!r}, not a number")
        if len(set(self.answers)) < len(self.answers) or not all(map(str.strip, self.answers)):
            raise ModelError("config.json: every one of the answers must have a text of its own")


def read_folder(folder: Path) -> tuple[OfaConfig, AskingStyle]:
    """Read `config.json`, and ModelScope's `configuration.json` if there is one.

    What `config.json` says wins.

    Raises:
        ModelError: if it is missing or damaged, or is not of an OFA that this port can run.
    """
    said = read_config(folder)
    for name, value in _FIXED.items():
        if said.get(name, value) != value:
            raise ModelError(
                f"{folder} is an OFA with {name} = {said[name]!r}; only {value!r} can be run"
            )
    if (folder / "configuration.json").is_file():
        more = read_config(folder, "configuration.json").get("model")
        said = {**more, **said} if isinstance(more, dict) else said
    config = OfaConfig(**_known(OfaConfig, said))
    style = _style(_known(AskingStyle, said))
    largest = config.image_bucket_size * 16
    if style.patch_image_size > largest:
        raise ModelError(
            f"config.json: patch_image_size is {style.patch_image_size}; this OFA has places for "
            f"{largest} pixels a side"
        )
    return config, style


def _style(said: dict[str, Any]) -> AskingStyle:
    prompt, answers = said.get("prompt_type", "none"), said.get("answers", [])
    if prompt not in list(DecoderPrompt):
        raise ModelError(
            f"config.json: prompt_type is {prompt!r}; allowed: {', '.join(DecoderPrompt)}"
        )
    if not isinstance(answers, list) or not all(isinstance(text, str) for text in answers):
        raise ModelError("config.json: answers must be a list of texts")
    return AskingStyle(**said | {"prompt_type": DecoderPrompt(prompt), "answers": tuple(answers)})


def _known(kind: type, said: Mapping[str, Any]) -> dict[str, Any]:
    return {field.name: said[field.name] for field in fields(kind) if field.name in said}


def _is_size(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 < value <= _MAX_SIZE
