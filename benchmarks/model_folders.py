"""Model folders with random weights, made on the spot: for tests (tiny) and timings (real size).

Each builder writes what `from_pretrained` reads: a configuration, safetensors, a tokenizer made
here and a processor. The weights are spread so far that questions and images change the answers;
as a library initializes them, a model gives one answer to everything.
"""

import math
import string
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor, nn

__all__ = ["build_blip", "build_idefics3", "build_vilt"]

#: What the tokenizers know as whole words; other words fall into letters.
_SENTENCES = (
    "is this door open ? is the kitchen cabinet door closed . does that image look like a shelf",
    "refrigerator microwave oven elevator transparent glass window handbag bag light electricity",
    "display monitor computer tv water running in sink from faucet on off is on is off not",
    "answer the question with yes or no , only one word . and what do you see here !",
)

#: What the models may answer, beside yes and no.
_ANSWERS = (
    *("yes", "no", "open", "closed", "on", "off", "door", "window", "water", "light", "white"),
    *("gray", "kitchen", "two", "half", "left", "right", "unsure", "nothing", "image"),
)

_SEP = 102  # where BERT has its [SEP]


def build_blip(folder: Path, real: bool = False, seed: int = 0) -> Path:
    """BLIP for question answering: BLIP-base size if `real`, else two layers of 32.

    Returns:
        The folder.
    """
    from transformers import BlipConfig, BlipForQuestionAnswering, BlipProcessor
    from transformers.models.blip.image_processing_pil_blip import BlipImageProcessorPil

    tokenizer = _bert_tokenizer(size=30522 if real else None)
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
    _spread(model, seed)
    head = model.text_decoder.cls.predictions
    images = BlipImageProcessorPil(size={"height": side, "width": side})
    kind: Any = BlipProcessor
    processor = kind(images, tokenizer)
    _shorten(model.text_decoder.bert.embeddings, head.transform.dense, _SEP)
    _even(model, processor, head.bias, seed)
    _favour(head.bias, [tokenizer.convert_tokens_to_ids(word) for word in _ANSWERS], _SEP)
    return _saved(folder, model, processor)


def build_vilt(folder: Path, real: bool = False, seed: int = 0) -> Path:
    """ViLT for question answering: the size of ViLT-B/32 with 3129 labels if `real`, else tiny.

    Returns:
        The folder.
    """
    from transformers import ViltConfig, ViltForQuestionAnswering, ViltProcessor
    from transformers.models.vilt.image_processing_pil_vilt import ViltImageProcessorPil

    tokenizer = _bert_tokenizer(size=30522 if real else None)
    n_labels = 3129 if real else len(_ANSWERS)
    labels = [*_ANSWERS, *(f"thing {number}" for number in range(len(_ANSWERS), n_labels))]
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
    _spread(model, seed)
    prepares: Any = ViltImageProcessorPil
    kind: Any = ViltProcessor
    images = prepares(size={"shortest_edge": side}, size_divisor=patch)
    return _saved(folder, model, kind(images, tokenizer))


_CHAT_TOKENS = (
    *("<|endoftext|>", "<|im_start|>", "<|im_end|>", "<fake_token_around_image>", "<image>"),
    *("<global-img>", "<end_of_utterance>"),
    *(f"<row_{row}_col_{column}>" for row in range(1, 7) for column in range(1, 7)),
)

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

    tokenizer = _bpe_tokenizer()
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
    _spread(model, seed)
    model.generation_config.eos_token_id = tokenizer.eos_token_id
    model.generation_config.pad_token_id = tokenizer.pad_token_id
    _lengthen(model.lm_head.weight, _chat_answers(tokenizer))
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


def _spread(model: "nn.Module", seed: int) -> None:
    """New weights from the seed, so large that what goes in shows in what comes out."""
    import torch
    from torch import nn

    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        norms = [module for module in model.modules() if "Norm" in type(module).__name__]
        kept = {weight for norm in norms for weight in norm.parameters()}
        for name, weight in model.named_parameters():
            if weight in kept:
                continue
            if weight.ndim < 2:
                nn.init.normal_(weight, std=0.1, generator=generator)
                continue
            std = _gain(name) / math.sqrt(weight[0].numel())
            nn.init.normal_(weight, std=std, generator=generator)


def _gain(name: str) -> float:
    if "text_model.layers" in name and ("q_proj" in name or "k_proj" in name):
        return 1.5  # thirty layers of sharper attention blow the last digits up
    # Sharp attention: an average over everything forgets what was asked.
    if any(part in name for part in ("query", "key", "q_proj", "k_proj")):
        return 2.5
    if name.startswith("text_") and "output.dense" in name:
        return 0.3  # each of the many layers covers a bit of what went in; a trace shall stay
    if name.startswith("text_") and "embeddings" in name:
        return 4.0  # the last matrix of BLIP is its first: far apart words answer far apart
    is_vilt = name.startswith(("vilt.", "classifier."))
    return 2.0 if "embedding" in name or (is_vilt and "attention" in name) else 1.0


#: Asked about noise, to find what a generator would say to everything.
_PROBES = (
    *("is this door open?", "does that image look like the window is closed?", "is it on?"),
    *("is there water in the sink?", "is that a kitchen cabinet?", "is the light off?"),
)


def _even(model: Any, processor: Any, bias: "Tensor", seed: int) -> None:
    """Take from the bias what the first token has for every question."""
    import torch

    generator = torch.Generator().manual_seed(seed)
    side = model.config.vision_config.image_size
    found = []
    for probe in _PROBES:
        pixels = torch.randn(1, 3, side, side, generator=generator)
        said = model.generate(
            input_ids=processor.tokenizer(probe, return_tensors="pt").input_ids,
            pixel_values=pixels,
            max_new_tokens=1,
            do_sample=False,
            output_logits=True,
            return_dict_in_generate=True,
        )
        found.append(said.logits[0][0])
    with torch.no_grad():
        bias -= torch.stack(found).mean(dim=0)


def _favour(bias: "Tensor", answers: Sequence[int], end: int) -> None:
    """Make a generator speak in these tokens, more often in the first two, seldom in none."""
    import torch

    with torch.no_grad():
        allowed = torch.zeros_like(bias, dtype=torch.bool)
        allowed[[*answers, end]] = True
        bias[~allowed] = -30.0
        bias[list(answers[:2])] += 1.0
        bias[end] -= 8.0


def _shorten(embeddings: Any, last: Any, end: int) -> None:
    """Let the later places of an answer ask for its end, as in short answers.

    What a place brings in comes through to the last matrix, which is that of the words, if the
    layer before it turns nothing.
    """
    import torch

    with torch.no_grad():
        torch.nn.init.eye_(last.weight)
        embeddings.position_embeddings.weight[1:] += 3.0 * embeddings.word_embeddings.weight[end]


def _lengthen(head: "Tensor", answers: Sequence[int]) -> None:
    """Make a generator speak mostly in these tokens, by longer rows of its last matrix."""
    import torch

    with torch.no_grad():
        head[list(answers)] *= 4.0


def _bert_tokenizer(size: int | None) -> Any:
    """Lower-case words, else letters, as BERT splits them; the special tokens at BERT's ids."""
    from transformers import BertTokenizer

    letters = string.ascii_lowercase + string.digits
    tokens = ["[PAD]", *(f"[unused{number}]" for number in range(99))]
    tokens += [
        "[UNK]",
        "[CLS]",
        "[SEP]",
        "[MASK]",
        *letters,
        *"?.,!'",
        *("##" + c for c in letters),
    ]
    known = set(tokens)
    words = sorted({word for line in (*_SENTENCES, *_ANSWERS) for word in line.split()} - known)
    tokens += words
    if size is not None:
        tokens += [f"[fill{number}]" for number in range(size - len(tokens))]
    return BertTokenizer(vocab={token: number for number, token in enumerate(tokens)})


def _bpe_tokenizer() -> Any:
    """Byte pairs learnt from the sentences, in the spellings that a chat model uses."""
    from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers
    from transformers import PreTrainedTokenizerFast

    kind: Any = PreTrainedTokenizerFast
    bare = Tokenizer(models.BPE())
    bare.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    bare.decoder = decoders.ByteLevel()
    trainer = trainers.BpeTrainer(
        vocab_size=1200,
        show_progress=False,
        special_tokens=list(_CHAT_TOKENS),
        initial_alphabet=pre_tokenizers.ByteLevel.alphabet(),
    )
    words = [spelling for word in _ANSWERS for spelling in (word, word.capitalize(), word.upper())]
    lines = [*_SENTENCES, *words, *(f" {word}" for word in words), "User Assistant System"]
    bare.train_from_iterator(lines * 4, trainer)
    return kind(
        tokenizer_object=bare,
        additional_special_tokens=list(_CHAT_TOKENS),
        padding_side="left",
        bos_token="<|im_start|>",  # noqa: S106  # no password
        eos_token="<end_of_utterance>",  # noqa: S106
        pad_token="<|im_end|>",  # noqa: S106
    )


def _chat_answers(tokenizer: Any) -> list[int]:
    spellings = [f"{space}{word}" for word in _ANSWERS for space in ("", " ")]
    spellings += [spelling.title() for spelling in spellings]
    ids = [tokenizer(spelling, add_special_tokens=False).input_ids for spelling in spellings]
    return sorted({one[0] for one in ids if len(one) == 1})
