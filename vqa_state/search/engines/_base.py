"""What an engine has to offer: a way to look for the fittest subset."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from vqa_state.answers.rates import Counts
from vqa_state.search.genetic import SearchReport, SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights

__all__ = ["EngineKind", "EngineSearch"]


class EngineSearch(Protocol):
    """A search for the subset with the highest fitness."""

    def __call__(
        self,
        counts: Counts,
        objective: Objective,
        *,
        weights: ObjectiveWeights = ...,
        settings: SearchSettings = ...,
        seed: int,
    ) -> Iterator[SearchReport]:
        """Search, reporting often enough to be stopped by no longer iterating.

        Args:
            counts: the training images' answers.
            objective: what to maximize.
            weights: weights of the objective's terms.
            settings: sizes and probabilities of the genetic algorithm.
            seed: 0 or more; objectives draw from streams of their own.

        Yields:
            Reports of generation 0, 1, ... up to `total`, which all of them name alike; the best
            fitness never falls, and ties are broken as `vqa_state.search.genetic.search` says. The
            same arguments give the same reports.

        Raises:
            NothingToSearchError: if there are no questions, no images or no images of one state.
            ValueError: if the seed is negative, or the population too large.
        """


@dataclass(frozen=True, slots=True)
class EngineKind:
    """One engine.

    Attributes:
        name: in files and options.
        hint: what it does, in one line for the user.
        is_proved: whether a proof of optimality follows its search.
        search: the search itself.
    """

    name: str
    hint: str
    is_proved: bool
    search: EngineSearch
