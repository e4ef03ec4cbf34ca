"""Which kind of vote to recommend, and why: never a silent choice.

Weighted kinds usually gain. But on few images a small difference is noise, and a simple vote is
easier to understand and asks fewer questions. So of all kinds that come within a quarter of an
image in twenty of the best, the simplest is recommended.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from vqa_state.votes.rules import VoteKind

__all__ = ["NEAR", "Recommendation", "recommend", "simplest_of_the_best"]

NEAR = 0.25 / 20
"""Shares of recognized images that differ by no more than this count as equal."""

_EXACT = 1e-9


@dataclass(frozen=True, slots=True)
class Recommendation:
    """A kind of vote, and one sentence for the user that says why."""

    kind: VoteKind
    reason: str


def simplest_of_the_best(shares: Mapping[VoteKind, float]) -> VoteKind:
    """The simplest kind whose out-of-bag share of recognized images is within `NEAR` of the best.

    Args:
        shares: out-of-bag share of recognized training images in [0, 1] of each kind; NaN where
            it is unknown. If it is so for all, the simplest kind is chosen.

    Raises:
        ValueError: if there is no kind.
    """
    if not shares:
        raise ValueError("there is no kind of vote to choose from")
    kinds = [kind for kind in VoteKind if kind in shares]
    best = max((shares[kind] for kind in kinds if shares[kind] == shares[kind]), default=0.0)
    near = (kind for kind in kinds if shares[kind] >= best - NEAR - _EXACT)
    return next(near, kinds[0])


def recommend(shares: Mapping[VoteKind, float], n_images: int) -> Recommendation:
    """Recommend a kind of vote by out-of-bag shares of the training images alone.

    Args:
        shares: see `simplest_of_the_best`.
        n_images: training images, to say shares as images.
    """
    chosen = simplest_of_the_best(shares)

    def images(kind: VoteKind) -> str:
        return f"{shares[kind] * n_images:.1f} of {n_images}"

    known = [kind for kind in VoteKind if kind in shares and shares[kind] == shares[kind]]
    others = [kind for kind in known if kind is not chosen]
    if chosen not in known:
        reason = "no training image was ever out of bag, so the simplest kind of vote is taken"
    elif not others:
        reason = f"out of bag, it recognizes {images(chosen)} training images; there is no other"
    else:
        most = max(shares[kind] for kind in others)
        best = next(kind for kind in others if shares[kind] >= most - _EXACT)
        reason = (
            f"out of bag, the vote by {chosen.value!r} recognizes {images(chosen)} training "
            f"images, the best other one ({best.value!r}) {images(best)}"
        )
        ahead = shares[best] - shares[chosen]
        if ahead > _EXACT:
            reason += ": too little more to give up the simpler vote"
        elif ahead > -_EXACT:
            reason += ": no better, so the simpler vote is taken"
    return Recommendation(chosen, reason)
