"""Text to numbers and back: byte-level BPE over a folder's `vocab.json` and `merges.txt`."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from vqa_state.errors import ModelError
from vqa_state.models.local.families import read_config

__all__ = ["BOS", "EOS", "PAD", "OfaTokenizer"]

BOS, PAD, EOS = 0, 1, 2

#: Marks of `vocab.json` that stand for no text. What a user types never becomes one of them.
_MARKS = {"<s>": BOS, "<pad>": PAD, "</s>": EOS}
_SILENT = ("<unk>", "<mask>")

#: Numbers after the words: so many codes of pictures, then places in an image.
_N_CODES = 8192


class OfaTokenizer:
    """Words of a question as numbers.

    Source: A. Radford et al., *Language Models are Unsupervised Multitask Learners*, section 2.2.
    """

    def __init__(self, folder: Path) -> None:
        """Read the two files.

        Raises:
            ModuleNotFoundError: if tokenizers is not installed.
            ModelError: if they are missing or damaged.
        """
        from tokenizers import Tokenizer, decoders, models, pre_tokenizers

        self._words = _read_words(folder)
        merges = _read_merges(folder, self._words)
        unknown = "<unk>" if "<unk>" in self._words else None
        self._tokenizer = Tokenizer(models.BPE(self._words, merges, unk_token=unknown))
        self._tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
        self._tokenizer.decoder = decoders.ByteLevel()
        self._silent = {self._words[mark] for mark in (*_MARKS, *_SILENT) if mark in self._words}

    @property
    def size(self) -> int:
        """Numbers that stand for text or marks; those above are codes of pictures and places."""
        return len(self._words)

    def encode(self, text: str) -> list[int]:
        """The text's tokens, without marks around them."""
        return list(self._tokenizer.encode(text, add_special_tokens=False).ids)

    def decode(self, tokens: Sequence[int]) -> str:
        """The text of tokens, marks left out, codes written as <code_7> and <bin_7>."""
        kept = [token for token in tokens if token not in self._silent]
        parts: list[str] = []
        for is_text, group in groupby(kept, lambda token: token < self.size):
            run = list(group)
            parts += [self._tokenizer.decode(run)] if is_text else map(self._code, run)
        return " ".join(parts)

    def single(self, text: str) -> tuple[int, ...]:
        """The token that is this text, if it is one token; else none."""
        tokens = self.encode(text)
        return tuple(tokens) if len(tokens) == 1 and tokens[0] not in self._silent else ()

    def _code(self, token: int) -> str:
        code = token - self.size
        return f"<code_{code}>" if code < _N_CODES else f"<bin_{code - _N_CODES}>"


def _read_words(folder: Path) -> dict[str, int]:
    words = read_config(folder, "vocab.json")
    for mark, number in _MARKS.items():
        if words.get(mark) != number:
            raise ModelError(f"{folder / 'vocab.json'} is damaged: {mark} must be number {number}")
    if set(words.values()) != set(range(len(words))):
        raise ModelError(f"{folder / 'vocab.json'} is damaged: its numbers must be 0, 1, 2 …")
    return words


def _read_merges(folder: Path, words: dict[str, int]) -> list[tuple[str, str]]:
    path = folder / "merges.txt"
    try:
        lines = path.read_text("utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"cannot read {path} ({error}); copy the model again") from error
    merges = []
    for line in lines[1:]:  # the first line is the version
        left, _, right = line.partition(" ")
        if line and not (left in words and right in words and left + right in words):
            raise ModelError(f"{path} is damaged: {line!r} is no merge of vocab.json")
        if line:
            merges.append((left, right))
    return merges
