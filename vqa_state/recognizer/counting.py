"""From a recognizer's votes to its verdict, whether all answers are there or not."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.table import MISSING
from vqa_state.errors import RecognizerError
from vqa_state.recognizer.schema import States, WeightedQuestion
from vqa_state.recognizer.verdict import Verdict, Vote
from vqa_state.votes.early_stop import verdict_so_far
from vqa_state.votes.judgement import Judgement
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import VoteKind
from vqa_state.votes.state import State

__all__ = ["NO_PROBABILITIES", "Said", "Shares", "as_arrays", "as_verdict", "judged_so_far"]

#: What answers speak for, and shares of the positive state, by copy and question.
Said = NDArray[np.int8]
Shares = NDArray[np.float32]

NO_PROBABILITIES = (
    "this recognizer counts the model's own probabilities, and the model gave none with an answer; "
    "use a model that gives them, or export another kind of vote"
)


def as_arrays(
    votes: Sequence[Vote], questions: Sequence[WeightedQuestion], n_copies: int, kind: VoteKind
) -> tuple[Said, Shares | None]:
    """What each answer speaks for, and the model's own shares where the vote needs them.

    Args:
        votes: about these questions and copies; what lacks is `MISSING`.
        questions: of the recognizer.
        n_copies: of the recognizer.
        kind: of its vote.

    Returns:
        (n_copies, n_questions) each; the shares are those of the positive state.

    Raises:
        RecognizerError: if the model gave no share where the vote needs one.
    """
    shape = n_copies, len(questions)
    places = {question.text: place for place, question in enumerate(questions)}
    said = np.full(shape, MISSING, np.int8)
    p_positive = np.full(shape, np.nan, np.float32)
    for vote in votes:
        place = vote.copy, places[vote.question]
        said[place] = vote.speaks_for
        p_yes = vote.answer.p_yes
        if p_yes is not None:
            is_positive = questions[place[1]].yes_means > 0
            p_positive[place] = round(p_yes, 6) if is_positive else 1 - round(p_yes, 6)
    if not kind.by_p_yes:
        return said, None
    if np.isnan(p_positive[said != MISSING]).any():
        raise RecognizerError(NO_PROBABILITIES)
    return said, p_positive


def judged_so_far(rule: AbstainRule, said: Said, p_positive: Shares | None) -> Judgement | None:
    """The judgement that the open answers cannot change, or None if they can.

    Its sureness and the winner's share are the least that they could leave; if unknown, the most.
    """
    state = verdict_so_far(rule, said, p_positive)
    if state is None:
        return None
    ways = {rest: _judged_with(rule, said, p_positive, rest) for rest in (1, -1)}
    if state is State.UNKNOWN:  # even the surest way to go on is not sure enough
        return replace(max(ways.values(), key=lambda judged: judged.sureness), state=state)
    return ways[-1 if state is State.POSITIVE else 1]  # even the least sure one is sure enough


def _judged_with(rule: AbstainRule, said: Said, p_positive: Shares | None, rest: int) -> Judgement:
    """The judgement if every open answer spoke for the state `rest`."""
    is_open = said == MISSING
    full = np.where(is_open, rest, said).astype(np.int8)
    shares = None if p_positive is None else np.where(is_open, rest > 0, p_positive)
    return rule.judge(full, None if shares is None else shares.astype(np.float32))


def as_verdict(
    votes: Sequence[Vote],
    judged: Judgement,
    states: States,
    reason: str,
    n_skipped: int = 0,
    milliseconds: float = 0.0,
) -> Verdict:
    """A judgement with the names of the states and the votes behind it.

    Args:
        votes: that were counted.
        judged: what came of them.
        states: their names.
        reason: in words.
        n_skipped: calls that were not made.
        milliseconds: that the calls took.
    """
    n_positive = sum(vote.speaks_for > 0 for vote in votes)
    n_negative = sum(vote.speaks_for < 0 for vote in votes)
    names = {State.POSITIVE: states.positive, State.NEGATIVE: states.negative}
    return Verdict(
        state=judged.state,
        state_name=names.get(judged.state, "unknown"),
        reason=reason,
        confidence=judged.confidence,
        n_positive=n_positive,
        n_negative=n_negative,
        n_invalid=len(votes) - n_positive - n_negative,
        n_calls=len(votes),
        milliseconds=milliseconds,
        votes=tuple(votes),
        n_skipped=n_skipped,
        sureness=judged.sureness,
        min_sureness=judged.min_sureness,
        n_copies=judged.n_copies,
        n_agreeing=judged.n_agreeing,
    )
