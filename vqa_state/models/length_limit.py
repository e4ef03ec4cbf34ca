"""How long an answer may get: a setting in a model's name, and advice where it was too short."""

from dataclasses import replace

from vqa_state.answers.answer import CUT_OFF
from vqa_state.errors import ModelError
from vqa_state.models.address import DEFAULT_MAX_TOKENS, ModelAddress

__all__ = ["FIELD", "cut_off_sentence", "cut_off_words", "max_tokens_of", "with_max_tokens"]

#: What the app calls it.
FIELD = "Most tokens of an answer"


def max_tokens_of(name: str) -> int:
    """The length limit that a model's name sets, in tokens; the default where it sets none."""
    try:
        return ModelAddress.parse(name).max_tokens
    except ModelError:
        return DEFAULT_MAX_TOKENS


def with_max_tokens(name: str, max_tokens: int) -> str:
    """The same model with another length limit; a limit that changes nothing changes no name.

    Raises:
        ModelError: if it is no number of tokens, or the model has no address to keep it in.
    """
    if ":" in name:
        return str(replace(ModelAddress.parse(name), max_tokens=max_tokens))
    if max_tokens != DEFAULT_MAX_TOKENS:
        raise ModelError(
            f"--max-tokens is of chat models and servers; the model {name!r} has its own length of "
            "answers: leave it out"
        )
    return name


def cut_off_words(n: int, name: str) -> str:
    """How many answers were cut off, and what to do; to go on a sentence."""
    return (
        f"{CUT_OFF}: {n:,}, for the length limit ended {'it' if n == 1 else 'them'} before yes or "
        f"no; raise --max-tokens (in the app: “{FIELD}”), {max_tokens_of(name)} now, and ask "
        "again; a model that thinks first needs hundreds, or its thinking turned off"
    )


def cut_off_sentence(n: int, name: str) -> str:
    """The same as a sentence of its own."""
    words = cut_off_words(n, name)
    return f"{words[0].upper()}{words[1:]}."
