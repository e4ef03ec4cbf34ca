"""Encodes a question as words, and every word as hashed pieces, so that no word is unknown.

Source: P. Bojanowski et al., *Enriching Word Vectors with Subword Information*, TACL 2017.
"""

import re
import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "MAX_WORDS",
    "N_BUCKETS",
    "N_PIECES",
    "encode_questions",
    "view_of",
    "word_pieces",
    "words",
]

#: Words beyond this many are not read. The longest question of the paper has 15.
MAX_WORDS = 24

#: Pieces of one word: itself and its first character trigrams.
N_PIECES = 12

#: Rows of the embedding table. Bucket 0 is padding.
N_BUCKETS = 4096

_WORD = re.compile(r"[^\W_]+")


def words(question: str) -> list[str]:
    """The words of a question in lower case, at most `MAX_WORDS`; "isn't" is "is not"."""
    plain = question.lower().replace("’", "'").replace("n't", " not")
    return _WORD.findall(plain)[:MAX_WORDS]


def view_of(question: str, n_views: int) -> int:
    """Which of the network's views a question reads, from 0 to `n_views` - 1.

    It is drawn by the words alone, so a question gets the same answer whatever else is asked.
    """
    return zlib.crc32(" ".join(words(question)).encode()) % n_views


def word_pieces(word: str) -> list[int]:
    """Buckets from 1 to `N_BUCKETS` - 1 of the whole word and of its trigrams."""
    marked = f"<{word}>"
    trigrams = [marked[start : start + 3] for start in range(len(marked) - 2)]
    pieces = [f"={word}", *trigrams][:N_PIECES]
    # CRC-32 is the same on every machine and in every Python, unlike hash().
    return [1 + zlib.crc32(piece.encode()) % (N_BUCKETS - 1) for piece in pieces]


def encode_questions(questions: Sequence[str]) -> NDArray[np.int64]:
    """Questions as buckets of shape (n_questions, MAX_WORDS, N_PIECES), 0 where there is nothing.

    A question without any word becomes one unknown word, so that there is something to read.
    """
    encoded = np.zeros((len(questions), MAX_WORDS, N_PIECES), np.int64)
    for row, question in enumerate(questions):
        for column, word in enumerate(words(question) or ["?"]):
            pieces = word_pieces(word)
            encoded[row, column, : len(pieces)] = pieces
    return encoded
