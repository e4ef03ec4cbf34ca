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

Answers come in *batches*: what is asked in one go. `Schedule` says which answer comes in which.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.table import MISSING
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import FittedVote, VoteKind
from vqa_state.votes.state import State

__all__ = ["Batch", "Schedule", "calls_needed", "is_settled", "verdict_so_far"]


class Batch(StrEnum):
    """What is asked in one go.

    COPY: all questions about one copy, copy after copy; for a model that looks at an image once and
        answers many questions cheaply.
    QUESTION: one question about all copies, question after question.
    CALL: one question about one copy, all copies of a question in turn; the fewest calls.
    """

    COPY = "copy"
    QUESTION = "question"
    CALL = "call"


@dataclass(frozen=True, slots=True)
class Schedule:
    """In which order the answers about an image are asked for.

    Attributes:
        questions: positions of the vote's questions in the table, in the order of asking.
        n_copies: copies of each image, asked about in their order.
        batch: what is asked in one go.

    Raises:
        ValueError: if there is no question or no copy, or a question stands there twice.
    """

    questions: tuple[int, ...]
    n_copies: int
    batch: Batch = Batch.COPY

    def __post_init__(self) -> None:
        if not self.questions or len(set(self.questions)) < len(self.questions):
            raise ValueError(f"need distinct questions, at least one; got {self.questions}")
        if self.n_copies < 1:
            raise ValueError(f"need at least one copy, got {self.n_copies}")

    def batches(self) -> list[list[tuple[int, int]]]:
        """The calls of each batch, as pairs of a copy and a question."""
        copies = range(self.n_copies)
        if self.batch is Batch.COPY:
            return [[(copy, question) for question in self.questions] for copy in copies]
        whole = [[(copy, question) for copy in copies] for question in self.questions]
        if self.batch is Batch.QUESTION:
            return whole
        return [[call] for calls in whole for call in calls]


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
    valid |= rule.vote.kind is VoteKind.WEIGHTED_P_YES
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
    schedule: Schedule,
    verdicts: NDArray[np.int8],
    p_positive: NDArray[np.float32] | None = None,
) -> NDArray[np.int64]:
    """Calls until the verdict on each image is settled, (n_images,): what stopping early costs.

    Args:
        rule: the vote.
        schedule: the order; the vote's questions, and as many copies as the verdicts have.
        verdicts: all answers, (n_images, n_copies, n_questions).
        p_positive: the model's own shares, same shape; only for a vote by p_yes.

    Raises:
        ValueError: if the schedule does not fit; else as `AbstainRule.states`.
    """
    if set(schedule.questions) != set(rule.vote.questions):
        raise ValueError(
            f"the schedule asks {sorted(schedule.questions)}, the vote is on {rule.vote.questions}"
        )
    if verdicts.ndim != 3 or verdicts.shape[1] != schedule.n_copies:
        raise ValueError(
            f"the schedule is for {schedule.n_copies} copies, verdicts are {verdicts.shape}"
        )
    turn = np.zeros(verdicts.shape[1:], dtype=np.int64)  # batch of each answer, from 1
    batches = schedule.batches()
    for number, batch in enumerate(batches, start=1):
        for call in batch:
            turn[call] = number
    # Once settled, always settled: so halving finds the first batch, for all images at once.
    too_few = np.zeros(len(verdicts), dtype=np.int64)
    enough = np.full(len(verdicts), len(batches))
    while (enough - too_few > 1).any():
        middle = (too_few + enough) // 2
        seen = np.where(turn <= middle[:, np.newaxis, np.newaxis], verdicts, MISSING)
        settled = is_settled(rule, seen.astype(np.int8), p_positive)
        too_few, enough = np.where(settled, too_few, middle), np.where(settled, middle, enough)
    calls = np.cumsum([len(batch) for batch in batches])
    needed: NDArray[np.int64] = calls[enough - 1]
    return needed


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
