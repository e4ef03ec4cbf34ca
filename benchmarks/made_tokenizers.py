"""Tokenizers made on the spot, and the words that models of random weights may answer in."""

import string
from typing import Any

__all__ = ["ANSWERS", "bert_tokenizer", "bpe_tokenizer", "chat_answers"]

#: What the tokenizers know as whole words; other words fall into letters.
_SENTENCES = (
    "is this door open ? is the kitchen cabinet door closed . does that image look like a shelf",
    "refrigerator microwave oven elevator transparent glass window handbag bag light electricity",
    "display monitor computer tv water running in sink from faucet on off is on is off not",
    "answer the question with yes or no , only one word . and what do you see here !",
)

#: What the models may answer, beside yes and no.
ANSWERS = (
    *("yes", "no", "open", "closed", "on", "off", "door", "window", "water", "light", "white"),
    *("gray", "kitchen", "two", "half", "left", "right", "unsure", "nothing", "image"),
)

_CHAT_TOKENS = (
    *("<|endoftext|>", "<|im_start|>", "<|im_end|>", "<fake_token_around_image>", "<image>"),
    *("<global-img>", "<end_of_utterance>"),
    *(f"<row_{row}_col_{column}>" for row in range(1, 7) for column in range(1, 7)),
)


def bert_tokenizer(size: int | None) -> Any:
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
    words = sorted({word for line in (*_SENTENCES, *ANSWERS) for word in line.split()} - known)
    tokens += words
    if size is not None:
        tokens += [f"[fill{number}]" for number in range(size - len(tokens))]
    return BertTokenizer(vocab={token: number for number, token in enumerate(tokens)})


def bpe_tokenizer() -> Any:
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
    words = [spelling for word in ANSWERS for spelling in (word, word.capitalize(), word.upper())]
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


def chat_answers(tokenizer: Any) -> list[int]:
    spellings = [f"{space}{word}" for word in ANSWERS for space in ("", " ")]
    spellings += [spelling.title() for spelling in spellings]
    ids = [tokenizer(spelling, add_special_tokens=False).input_ids for spelling in spellings]
    return sorted({one[0] for one in ids if len(one) == 1})
