"""Stop asking as soon as the answers still open cannot change the verdict.

A vote is *settled* when it says the same if every open answer spoke for the positive state as if
every one spoke for the negative state. All other ways to answer lie between these two: turning an
answer towards a state never turns the verdict, or its sureness, away from it. For the paper's vote,
with P answers for the positive state so far, N for the negative one and L open ones, that is

    positive for certain:  P / (P + N + L) > t
    negative for certain:  (P + L) / (P + N + L) < t

and it holds likewise for weights, for invalid answers that count half, and for abstaining. So the
verdict is always the one that all answers would have given. At t = 0.5 no vote can be settled
before half of the weight is in: calls are at most halved. While all answers so far are invalid
nothing is settled, because without an answer that counts the verdict is unknown.
"""

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.table import MISSING
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import FittedVote
from vqa_state.votes.state import State

__all__ = ["calls_needed", "is_settled", "verdict_so_far"]


def is_settled(
    rule: AbstainRule,
    verdicts: NDArray[np.int8],
    p_positive: NDArray[np.float32] | None = None,
) -> NDArray[np.bool_]:
    """Whether the answers still open cannot change the verdict on each image, (n_images,).

    Args:
        rule: the vote.
        verdicts: (n_images, n_copies, n_questions): +1, -1, 0, or `MISSING` for an open answer.
        p_positive: the model's own shares, same shape; only for a vote by p_yes. What stands there
            for an open answer does not matter.

    Raises:
        ValueError: as `AbstainRule.states`.
    """
    asked = list(rule.vote.questions)
    is_open = verdicts == MISSING
    extremes = [
        rule.states(*_answered(rule.vote, verdicts, p_positive, is_open, state))
        for state in (1, -1)
    ]
    none_open = ~is_open[:, :, asked].any(axis=(1, 2))
    # Invalid answers that count half settle nothing alone: if none counts, the verdict is unknown.
    valid = ((verdicts != 0) & ~is_open)[:, :, asked].any(axis=(1, 2))
    valid |= rule.vote.kind.by_p_yes
    settled: NDArray[np.bool_] = (extremes[0] == extremes[1]) & (valid | none_open)
    return settled


def verdict_so_far(
    rule: AbstainRule,
    verdicts: NDArray[np.int8],
    p_positive: NDArray[np.float32] | None = None,
) -> State | None:
    """The certain verdict on one image, or None while open answers can change it.

    It is the verdict of `rule.judge` on all answers, whatever the open ones turn out to be.
    Arguments as in `is_settled`, for one image: (n_copies, n_questions).
    """
    one, shares = verdicts[np.newaxis], None if p_positive is None else p_positive[np.newaxis]
    if not is_settled(rule, one, shares)[0]:
        return None
    state = int(rule.states(*_answered(rule.vote, one, shares, one == MISSING, 1))[0])
    return {1: State.POSITIVE, -1: State.NEGATIVE, 0: State.UNKNOWN}[state]


def calls_needed(
    rule: AbstainRule,
    verdicts: NDArray[np.int8],
    p_positive: NDArray[np.float32] | None = None,
) -> NDArray[np.int64]:
    """Calls until the verdict on each image is settled, (n_images,): what stopping early costs.

    All questions are asked about one copy after another, because a model looks at an image once and
    answers many questions cheaply.

    Args:
        rule: the vote.
        verdicts: all answers, (n_images, n_copies, n_questions).
        p_positive: the model's own shares, same shape; only for a vote by p_yes.

    Raises:
        ValueError: as `AbstainRule.states`.
    """
    n_copies = verdicts.shape[1]
    needed = np.full(len(verdicts), n_copies)
    for n_asked in range(n_copies - 1, 0, -1):  # once settled, always settled
        seen = verdicts.copy()
        seen[:, n_asked:] = MISSING
        needed[is_settled(rule, seen, p_positive)] = n_asked
    return needed * rule.vote.n_used


def _answered(
    vote: FittedVote,
    verdicts: NDArray[np.int8],
    p_positive: NDArray[np.float32] | None,
    is_open: NDArray[np.bool_],
    state: int,
) -> tuple[NDArray[np.int8], NDArray[np.float32] | None]:
    """All answers, if every open one spoke for one state."""
    speaks_for = np.full(verdicts.shape[2], state, dtype=np.int8)
    for question, flipped in zip(vote.questions, vote.flipped, strict=True):
        if flipped and question < len(speaks_for):
            speaks_for[question] = -state
    full = np.where(is_open, speaks_for, verdicts)
    if p_positive is None:
        return full, None
    return full, np.where(is_open, (speaks_for > 0).astype(np.float32), p_positive)
