"""Model folders with random weights, made on the spot: for tests (tiny) and timings (real size).

Each builder writes what `from_pretrained` reads: a configuration, safetensors, a tokenizer made
here and a processor. The weights are spread so far that questions and images change the answers;
as a library initializes them, a model gives one answer to everything.
"""

from pathlib import Path
from typing import Any

from benchmarks.made_tokenizers import ANSWERS, bert_tokenizer, bpe_tokenizer, chat_answers
from benchmarks.random_weights import even, favour, lengthen, shorten, spread

__all__ = ["build_blip", "build_idefics3", "build_vilt"]


_SEP = 102  # where BERT has its [SEP]


def build_blip(folder: Path, real: bool = False, seed: int = 0) -> Path:
    """BLIP for question answering: BLIP-base size if `real`, else two layers of 32.

    Returns:
        The folder.
    """
    from transformers import BlipConfig, BlipForQuestionAnswering, BlipProcessor
    from transformers.models.blip.image_processing_pil_blip import BlipImageProcessorPil

    tokenizer = bert_tokenizer(size=30522 if real else None)
    n_tokens = len(tokenizer) + 2
    width, layers, heads, side = (768, 12, 12, 384) if real else (32, 2, 4, 64)
    size = _transformer(width, layers, heads)
    text = size | {
        "vocab_size": n_tokens,
        "encoder_hidden_size": width,
        "bos_token_id": n_tokens - 2,
        "pad_token_id": 0,
        "sep_token_id": _SEP,
        "eos_token_id": _SEP,
        "is_decoder": True,
    }
    vision = size | {"image_size": side, "patch_size": 16}
    model = _made(BlipForQuestionAnswering, BlipConfig(text_config=text, vision_config=vision))
    spread(model, seed)
    head = model.text_decoder.cls.predictions
    images = BlipImageProcessorPil(size={"height": side, "width": side})
    kind: Any = BlipProcessor
    processor = kind(images, tokenizer)
    shorten(model.text_decoder.bert.embeddings, head.transform.dense, _SEP)
    even(model, processor, head.bias, seed)
    favour(head.bias, [tokenizer.convert_tokens_to_ids(word) for word in ANSWERS], _SEP)
    return _saved(folder, model, processor)


def build_vilt(folder: Path, real: bool = False, seed: int = 0) -> Path:
    """ViLT for question answering: the size of ViLT-B/32 with 3129 labels if `real`, else tiny.

    Returns:
        The folder.
    """
    from transformers import ViltConfig, ViltForQuestionAnswering, ViltProcessor
    from transformers.models.vilt.image_processing_pil_vilt import ViltImageProcessorPil

    tokenizer = bert_tokenizer(size=30522 if real else None)
    n_labels = 3129 if real else len(ANSWERS)
    labels = [*ANSWERS, *(f"thing {number}" for number in range(len(ANSWERS), n_labels))]
    side, patch = (384, 32) if real else (64, 16)
    config = ViltConfig(
        **(_transformer(768, 12, 12) if real else _transformer(32, 2, 4)),
        vocab_size=len(tokenizer),
        image_size=side,
        patch_size=patch,
        max_image_length=-1,
        id2label=dict(enumerate(labels)),
        label2id={label: number for number, label in enumerate(labels)},
    )
    model = _made(ViltForQuestionAnswering, config)
    spread(model, seed)
    prepares: Any = ViltImageProcessorPil
    kind: Any = ViltProcessor
    images = prepares(size={"shortest_edge": side}, size_divisor=patch)
    return _saved(folder, model, kind(images, tokenizer))


_CHAT_TEMPLATE = (
    "<|im_start|>{% for message in messages %}{{ message['role'] | capitalize }}"
    "{% if message['content'][0]['type'] == 'image' %}{{ ':' }}{% else %}{{ ': ' }}{% endif %}"
    "{% for part in message['content'] %}{% if part['type'] == 'text' %}{{ part['text'] }}"
    "{% elif part['type'] == 'image' %}{{ '<image>' }}{% endif %}{% endfor %}"
    "<end_of_utterance>\n{% endfor %}{% if add_generation_prompt %}{{ 'Assistant:' }}{% endif %}"
)


def build_idefics3(folder: Path, real: bool = False, seed: int = 0) -> Path:
    """A chat model with images: the size of SmolVLM-256M if `real`, else two layers of 32.

    Idefics3 is the family that SmolVLM comes from; it needs no torchvision.

    Returns:
        The folder.
    """
    from transformers import Idefics3Config, Idefics3ForConditionalGeneration, Idefics3Processor
    from transformers.models.idefics3.image_processing_pil_idefics3 import (
        Idefics3ImageProcessorPil,
    )

    tokenizer = bpe_tokenizer()
    text = (
        _transformer(576, 30, 9) | {"intermediate_size": 1536} if real else _transformer(32, 2, 4)
    )
    text |= {
        "model_type": "llama",
        "num_key_value_heads": 3 if real else 2,
        "vocab_size": 49280 if real else len(tokenizer),
        "max_position_embeddings": 8192 if real else 1024,
        "pad_token_id": tokenizer.pad_token_id,
        "bos_token_id": tokenizer.bos_token_id,
        "eos_token_id": tokenizer.eos_token_id,
    }
    side, shuffled = (512, 4) if real else (64, 2)
    vision = _transformer(768, 12, 12) if real else _transformer(32, 2, 4)
    kind: Any = Idefics3Config
    config = kind(
        text_config=text,
        vision_config=vision | {"image_size": side, "patch_size": 16},
        image_token_id=tokenizer.convert_tokens_to_ids("<image>"),
        scale_factor=shuffled,
        pad_token_id=tokenizer.pad_token_id,
        tie_word_embeddings=False,
    )
    model = _made(Idefics3ForConditionalGeneration, config)
    spread(model, seed)
    model.generation_config.eos_token_id = tokenizer.eos_token_id
    model.generation_config.pad_token_id = tokenizer.pad_token_id
    lengthen(model.lm_head.weight, chat_answers(tokenizer))
    images = Idefics3ImageProcessorPil(
        size={"longest_edge": 4 * side if real else side},
        max_image_size={"longest_edge": side},
        do_image_splitting=False,
    )
    processor = Idefics3Processor(
        images,
        tokenizer,
        image_seq_len=(side // 16) ** 2 // shuffled**2,
        chat_template=_CHAT_TEMPLATE,
    )
    return _saved(folder, model, processor)


def _transformer(width: int, layers: int, heads: int) -> dict[str, Any]:
    return {
        "hidden_size": width,
        "intermediate_size": 4 * width if width != 32 else 64,
        "num_hidden_layers": layers,
        "num_attention_heads": heads,
    }


def _made(kind: Any, config: Any) -> Any:
    """The model, without a trace in torch's random state."""
    import torch

    with torch.random.fork_rng(devices=[]):
        return kind(config).eval()


def _saved(folder: Path, model: Any, processor: Any) -> Path:
    model.save_pretrained(folder)
    processor.save_pretrained(folder)
    return folder
