"""How many new images a recognizer will recognize, estimated from the training images alone.

From the training images, draw as many again and again with replacement, each state by itself and
near-duplicates together. On each such *resample*, do all that was done on the whole: search the
questions, fit every kind of vote, choose one. Then look at the images that the resample happened to
lack. The score of an image is its mean over all resamples that lack it, and the estimate is the
mean over the images.

The choice between the kinds of vote is repeated in every resample: it looks at the out-of-bag
scores of the resample's own images, which come from other resamples, and is judged on images
outside the resample. So the estimate of what is recommended does not flatter by picking the
luckiest of several numbers.

Source: B. Efron, R. Tibshirani, "Improvements on cross-validation: the .632+ bootstrap method",
JASA 1997, section 2 (the leave-one-out bootstrap); I. Tsamardinos, E. Greasidou, G. Borboudakis,
"Bootstrapping the out-of-sample predictions for efficient and accurate cross-validation", Machine
Learning 2018 (the choice inside).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.estimates import Estimate, estimate, known_mean
from vqa_state.search.genetic import SearchSettings, search
from vqa_state.search.objectives import Objective
from vqa_state.votes.fitting import fit_votes
from vqa_state.votes.resampling import divisible, draw_resample
from vqa_state.votes.rules import Ballots, FittedVote, VoteKind
from vqa_state.votes.selection import Recommendation, recommend, simplest_of_the_best

__all__ = [
    "N_RESAMPLES",
    "OutOfBag",
    "OutOfBagProgress",
    "Resample",
    "SubsetSearch",
    "out_of_bag",
    "quick_search",
]

N_RESAMPLES = 30

SubsetSearch = Callable[[Counts, int], Sequence[int]]
"""Looks for a subset of questions on (counts, seed); the same two give the same subset."""

_QUICK = SearchSettings(population=100, generations=30)

Floats = NDArray[np.float64]


def quick_search(counts: Counts, seed: int) -> tuple[int, ...]:
    """A small genetic search for s+: it finds subsets that do as well on new images as a large one.

    Raises:
        NothingToSearchError: if there is no question, or images of one state are lacking.
    """
    *_, last = search(counts, Objective.S_PLUS, settings=_QUICK, seed=seed)
    # Chance offers a tiny search nothing but the empty subset where there is one question.
    return last.subset or tuple(range(counts.n_questions))


@dataclass(frozen=True, slots=True, eq=False)
class Resample:
    """One resample and what it made.

    Attributes:
        drawn: positions of its images; one may stand there several times.
        out: images that the resample lacks, bool (n_images,).
        votes: the fitted vote of every kind.
    """

    drawn: NDArray[np.intp]
    out: NDArray[np.bool_]
    votes: Mapping[VoteKind, FittedVote]


@dataclass(frozen=True, slots=True, eq=False)
class OutOfBag:
    """What the resamples say together; arrays are (n_images,), NaN for images that were never out.

    Attributes:
        kinds: the estimate of each kind of vote.
        recommended: the estimate of the procedure "take the recommended kind".
        recommendation: which kind to take, and why.
        margins: of each kind, the mean margin in [-1, 1] of the resamples that lack the image;
            above 0 it speaks for the positive state, whatever the label.
        recommended_margins: the same of the kind that each resample chose.
        recognized: of each kind, the share of the resamples lacking the image that recognize it.
        resamples: the resamples, for anything else that is to be averaged over them.
        groups_divided: whether near-duplicates had to be parted, because all images of one state
            are near-duplicates; then the estimate flatters, and the report must say so.
    """

    kinds: Mapping[VoteKind, Estimate]
    recommended: Estimate
    recommendation: Recommendation
    margins: Mapping[VoteKind, Floats]
    recommended_margins: Floats
    recognized: Mapping[VoteKind, Floats]
    resamples: tuple[Resample, ...]
    groups_divided: bool


@dataclass(frozen=True, slots=True, eq=False)
class OutOfBagProgress:
    """After one resample more. `result()` is that of the resamples so far, so a stop wastes none.

    Attributes:
        n_done: resamples done, from 1.
        n_total: resamples asked for.
    """

    n_done: int
    n_total: int
    _tally: "_Tally"

    def result(self) -> OutOfBag:
        """What the resamples so far say."""
        return self._tally.result(self.n_done)


def out_of_bag(
    ballots: Ballots,
    labels: NDArray[np.int8],
    groups: NDArray[np.int64] | None = None,
    *,
    seed: int,
    find: SubsetSearch = quick_search,
    n_resamples: int = N_RESAMPLES,
) -> Iterator[OutOfBagProgress]:
    """Estimate, reporting after every resample. The caller stops by no longer iterating.

    Args:
        ballots: the training images' answers. Test images have no place here.
        labels: their states, +1 or -1, (n_images,).
        groups: number of each image's group of near-duplicates, (n_images,); all different without
            it.
        seed: 0 or more; the same arguments give the same reports.
        find: the search that is repeated in each resample; s+ for a recognizer of s+.
        n_resamples: resamples, at least 1. After 30, an estimate changes little.

    Yields:
        n_resamples reports.

    Raises:
        NothingToSearchError: if there is no question, or a state has fewer than two images.
        ValueError: if shapes differ, or a number is out of its range.
    """
    _require_enough(ballots, labels, n_resamples, seed)
    whole = np.arange(ballots.n_images) if groups is None else groups.astype(np.int64)
    if whole.shape != labels.shape:
        raise ValueError(f"need one group an image, got {whole.shape} for {labels.shape}")
    kept = divisible(labels, whole)
    tally = _Tally(labels, kept, bool((kept != whole).any()))
    streams = np.random.SeedSequence([seed, *b"out of bag"]).spawn(n_resamples)
    for n_done, stream in enumerate(streams, 1):
        rng = np.random.Generator(np.random.PCG64(stream))
        drawn = draw_resample(labels, kept, rng)
        inside = ballots.take(drawn)
        subset = find(inside.counts(labels[drawn]), int(rng.integers(2**31)))
        votes = fit_votes(inside, labels[drawn], subset, kept[drawn])
        tally.add(drawn, votes, ballots)
        yield OutOfBagProgress(n_done, n_resamples, tally)


class _Tally:
    """What every resample said about the images that it lacks; grows with every resample."""

    def __init__(
        self, labels: NDArray[np.int8], groups: NDArray[np.int64], groups_divided: bool
    ) -> None:
        self._labels = labels
        self._groups = groups
        self._groups_divided = groups_divided
        self._resamples: list[Resample] = []
        self._margins: list[
            Floats
        ] = []  # of each drawn, (n_kinds, n_images), NaN inside the resample

    def add(
        self, drawn: NDArray[np.intp], votes: Mapping[VoteKind, FittedVote], ballots: Ballots
    ) -> None:
        out = np.ones(len(self._labels), dtype=bool)
        out[drawn] = False
        margins = np.stack([vote.margins(ballots) for vote in votes.values()])
        margins[:, ~out] = np.nan
        self._resamples.append(Resample(drawn, out, MappingProxyType(dict(votes))))
        self._margins.append(margins)

    def result(self, n_done: int) -> OutOfBag:
        kinds = tuple(self._resamples[0].votes)
        margins = np.stack(self._margins[:n_done])  # (n_done, n_kinds, n_images)
        recognized = np.where(np.isnan(margins), np.nan, margins * self._labels > 0)
        of_kind = known_mean(recognized)  # (n_kinds, n_images)
        chosen = self._choices(kinds, of_kind, n_done)
        estimates = {kind: self._estimate(of_kind[i]) for i, kind in enumerate(kinds)}
        shares = {kind: found.share for kind, found in estimates.items()}
        mean_margins = known_mean(margins)
        return OutOfBag(
            kinds=MappingProxyType(estimates),
            recommended=self._estimate(known_mean(recognized[np.arange(n_done), chosen])),
            recommendation=recommend(shares, len(self._labels)),
            margins=MappingProxyType({k: mean_margins[i] for i, k in enumerate(kinds)}),
            recommended_margins=known_mean(margins[np.arange(n_done), chosen]),
            recognized=MappingProxyType({k: of_kind[i] for i, k in enumerate(kinds)}),
            resamples=tuple(self._resamples[:n_done]),
            groups_divided=self._groups_divided,
        )

    def _estimate(self, recognized: Floats) -> Estimate:
        return estimate(recognized, self._labels, self._groups)

    def _choices(
        self, kinds: tuple[VoteKind, ...], of_kind: Floats, n_done: int
    ) -> NDArray[np.intp]:
        """The kind that each resample would recommend, by the scores of its own images alone."""
        chosen = []
        for resample in self._resamples[:n_done]:
            inside = known_mean(of_kind[:, resample.drawn].T)
            shares = dict(zip(kinds, inside.tolist(), strict=True))
            chosen.append(kinds.index(simplest_of_the_best(shares)))
        return np.array(chosen, dtype=np.intp)


def _require_enough(
    ballots: Ballots, labels: NDArray[np.int8], n_resamples: int, seed: int
) -> None:
    if labels.shape != (ballots.n_images,):
        raise ValueError(f"need {ballots.n_images} labels, got {labels.shape}")
    if n_resamples < 1 or seed < 0:
        raise ValueError(f"need at least 1 resample and a seed from 0, got {n_resamples}, {seed}")
    fewest = min(np.count_nonzero(labels == state) for state in (1, -1))
    if fewest < 2 or ballots.n_questions == 0:
        raise NothingToSearchError(
            f"an out-of-bag estimate needs a question and at least two labelled training images of "
            f"each state, got {ballots.n_questions} and {fewest}; label more images"
        )
