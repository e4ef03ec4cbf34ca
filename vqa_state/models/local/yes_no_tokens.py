"""How sure a generating model is: the share of "yes" among the first tokens that say yes or no."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["YesNoTokens", "yes_no_tokens"]

_SPELLINGS = ("yes", "Yes", "YES", " yes", " Yes", " YES"), ("no", "No", "NO", " no", " No", " NO")


@dataclass(frozen=True, slots=True)
class YesNoTokens:
    """Ids of the tokens that an answer "yes" may begin with, in any spelling, and those of "no"."""

    yes: tuple[int, ...]
    no: tuple[int, ...]

    def p_yes(self, logits: "Tensor") -> list[float | None]:
        """P(yes) / (P(yes) + P(no)) from first-step logits (n, n_tokens); None without tokens."""
        import torch

        if not self.yes or not self.no:
            return [None] * len(logits)
        wide = logits.double()
        yes = torch.logsumexp(wide[:, list(self.yes)], dim=-1)
        no = torch.logsumexp(wide[:, list(self.no)], dim=-1)
        # Later digits than the sixth are the machine's, not the model's.
        return [round(value, 6) for value in torch.sigmoid(yes - no).tolist()]


def yes_no_tokens(tokenizer: Any) -> YesNoTokens:
    """The tokens of a tokenizer that stand for yes and for no at an answer's beginning.

    A spelling counts only if it is one token: a first piece such as "n" begins other words, too.

    Args:
        tokenizer: of transformers; called with a text, it gives `input_ids`.
    """
    return YesNoTokens(*(_single_tokens(tokenizer, words) for words in _SPELLINGS))


def _single_tokens(tokenizer: Any, words: Sequence[str]) -> tuple[int, ...]:
    found = set()
    for word in words:
        ids = tokenizer(word, add_special_tokens=False).input_ids
        if len(ids) == 1 and ids[0] != tokenizer.unk_token_id:
            found.add(int(ids[0]))
    return tuple(sorted(found))
