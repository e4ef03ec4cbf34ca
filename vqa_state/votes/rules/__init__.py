"""Kinds of vote, one file each, registered in `kinds.py`, and a fitted vote of any kind.

A new kind is a file that defines `RULE`, and one line in `kinds.py` that names the file; app,
command line and contract tests then offer it.

For an image, let question q of weight w_q have P_q answers for the positive state, N_q for the
negative and I_q for neither, over all copies. The positive state wins if its *share* is above the
threshold t, the negative one if it is below; exactly at t the vote is unknown, and so it is without
a valid answer.

    paper, threshold    share = sum(w P) / sum(w (P + N))
    weighted answers    share = sum(w (P + I / 2)) / sum(w (P + N + I))
    weighted p_yes      share = sum(w p) / sum(w (P + N + I))

where p_q is the sum over the copies of the model's own share for the positive state. A question
that is *flipped* counts for the other state: P and N change places, and p becomes 1 - p a copy. The
second share is (1 + sum(w v) / sum(w)) / 2 with v = +1, -1 or 0 for an invalid answer, so a linear
model of the answers is such a vote: negative weights are flips, and its intercept is the threshold.

Everything is counted in whole millionths of whole weights, so every verdict is exact: a tie is a
tie, and the order of the answers never matters.

Source: paper II-A for the paper's vote (weight 1, threshold 0.5); the others are this project's.
"""

from vqa_state.votes.rules._base import MILLION, Ballots, Learned, VoteRule
from vqa_state.votes.rules._weighted import MAX_WEIGHT
from vqa_state.votes.rules.fitted import FittedVote, equal_vote
from vqa_state.votes.rules.kinds import VoteKind

__all__ = [
    "MAX_WEIGHT",
    "MILLION",
    "Ballots",
    "FittedVote",
    "Learned",
    "VoteKind",
    "VoteRule",
    "equal_vote",
]
