"""The paper's genetic algorithm, on the whole population as one array.

The operators and their order are those of DEAP's `eaSimple`; only the population is one array
of zeros and ones, (n_individuals, n_questions), instead of a list of lists. Why, and how that
is checked: docs/decisions/0002-population-as-array.md.

Source: paper II-B; F.-A. Fortin et al., "DEAP: Evolutionary Algorithms Made Easy", JMLR 2012.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.errors import NothingToSearchError
from vqa_state.search.fitness import Fitness, Terms
from vqa_state.search.objectives import PAPER_WEIGHTS, Objective, ObjectiveWeights

__all__ = [
    "PAPER_SETTINGS",
    "SearchReport",
    "SearchSettings",
    "better",
    "first_population",
    "fittest",
    "flip_mutation",
    "report_of",
    "require_searchable",
    "require_small",
    "search",
    "stream",
    "tournament",
    "two_point_crossover",
]

#: At most one individual in this many starts as a single question.
_SINGLE_SHARE = 8

MAX_POPULATION = 100_000
MAX_GENERATIONS = 100_000
MAX_TOURNAMENT = 100
MAX_GENES = 100_000_000  # zeros and ones in one population: about a gigabyte while it breeds


def _require(name: str, value: float, low: int, high: int) -> None:
    if not low <= value <= high:  # also refuses NaN
        raise ValueError(f"{name} must be {low} to {high}, got {value}")


def _require_whole(name: str, value: object) -> None:
    if not isinstance(value, int):
        raise ValueError(f"{name} must be a whole number, got {value!r}")


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Sizes and probabilities of the genetic algorithm; the defaults are the paper's.

    Attributes:
        population: individuals in a generation.
        generations: generations after the initial one.
        crossover: chance that two neighbours mate.
        mutation: chance that an individual mutates.
        bit_flip: chance that a bit of a mutating individual flips. The paper does not give it.
        tournament: individuals that compete for each place in the next generation.

    Raises:
        ValueError: if a size or a probability is out of its range.
    """

    population: int = 1000
    generations: int = 200
    crossover: float = 0.5
    mutation: float = 0.2
    bit_flip: float = 0.05
    tournament: int = 5

    def __post_init__(self) -> None:
        for name in ("population", "generations", "tournament"):
            _require_whole(name, getattr(self, name))
        _require("population", self.population, 2, MAX_POPULATION)
        _require("generations", self.generations, 0, MAX_GENERATIONS)
        _require("tournament", self.tournament, 1, MAX_TOURNAMENT)
        for name in ("crossover", "mutation", "bit_flip"):
            _require(name, getattr(self, name), 0, 1)


PAPER_SETTINGS = SearchSettings()


@dataclass(frozen=True, slots=True)
class SearchReport:
    """The search after one generation.

    Attributes:
        generation: 0 for the initial population, up to `total`.
        total: generations asked for.
        best_fitness: fitness of the best individual ever evaluated; it never falls.
        mean_fitness: mean fitness of this generation.
        terms: what the best fitness is made of.
        subset: positions of the best individual's questions, ascending. It is empty only if
            chance offered nothing else, as it may with one question and a tiny population.
        n_evaluations: individuals evaluated so far; unchanged ones are not evaluated again.
    """

    generation: int
    total: int
    best_fitness: float
    mean_fitness: float
    terms: Terms
    subset: tuple[int, ...]
    n_evaluations: int


def search(
    counts: Counts,
    objective: Objective,
    *,
    weights: ObjectiveWeights = PAPER_WEIGHTS,
    settings: SearchSettings = PAPER_SETTINGS,
    seed: int,
    singles_first: bool = True,
) -> Iterator[SearchReport]:
    """Look for the subset with the highest fitness, reporting after every generation.

    The caller shows progress by iterating and stops by no longer iterating. Of equally fit
    subsets, the one with fewer questions is best, and of these the one whose vector of zeros
    and ones is smallest where they first differ: of {0, 3} and {1, 2}, that is {1, 2}.

    Args:
        counts: the training images' answers.
        objective: what to maximize.
        weights: weights of the objective's terms.
        settings: sizes and probabilities.
        seed: 0 or more. Each objective draws from its own stream, so searches for several
            objectives with one seed are independent.
        singles_first: whether the first population holds single questions, see
            `first_population`. False is the paper's search to the letter.

    Yields:
        settings.generations + 1 reports. The same arguments give the same reports.

    Raises:
        NothingToSearchError: if there are no questions, no images or no images of one state.
        ValueError: if the seed is negative, or population times questions is too large.

    Source: paper II-B.
    """
    require_searchable(counts)
    require_small(settings, counts.n_questions)
    rng = stream(objective, seed)
    return _evolve(Fitness(counts, objective, weights), settings, rng, singles_first)


def stream(objective: Objective, seed: int, purpose: str = "") -> np.random.Generator:
    """Random numbers of an objective's own, and of a purpose's.

    Raises:
        ValueError: if the seed is negative.
    """
    if seed < 0:
        raise ValueError(f"seed must be 0 or more, got {seed}")
    words = [seed, *objective.value.encode(), *purpose.encode()]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


def _evolve(
    fitness: Fitness,
    settings: SearchSettings,
    rng: np.random.Generator,
    singles_first: bool = True,
) -> Iterator[SearchReport]:
    """DEAP's `eaSimple`: select, mate, mutate, evaluate what changed."""
    population = first_population(
        settings.population, fitness.n_questions, rng, singles_first=singles_first
    )
    values = fitness(population)
    n_evaluations = settings.population
    best = population[fittest(population, values)]
    for generation in range(settings.generations + 1):
        if generation > 0:
            parents = tournament(values, settings.tournament, rng)
            population, values = population[parents], values[parents]
            changed = two_point_crossover(population, settings.crossover, rng)
            changed |= flip_mutation(population, settings.mutation, settings.bit_flip, rng)
            values[changed] = fitness(population[changed])
            n_evaluations += int(np.count_nonzero(changed))
            best = better(best, population[fittest(population, values)], fitness)
        yield report_of(best, fitness, generation, settings.generations, values, n_evaluations)


def report_of(
    best: NDArray[np.uint8],
    fitness: Fitness,
    generation: int,
    total: int,
    values: NDArray[np.float64],
    n_evaluations: int,
) -> SearchReport:
    """A report about the best individual so far, (n_questions,), and the fitness of the present."""
    subset = tuple(np.flatnonzero(best).tolist())
    terms = fitness.terms(subset)
    return SearchReport(
        generation=generation,
        total=total,
        best_fitness=terms.value,
        mean_fitness=float(values.mean()),
        terms=terms,
        subset=subset,
        n_evaluations=n_evaluations,
    )


def first_population(
    n_individuals: int,
    n_questions: int,
    rng: np.random.Generator,
    *,
    singles_first: bool = True,
) -> NDArray[np.uint8]:
    """Single questions first, in up to an eighth of it; all others have bits of chance 1/2.

    Random individuals hold about half of the questions. Where few questions are good, every such
    vote is lost, the search sees no difference between them, and never finds the good ones
    (docs/decisions/0007-single-questions-first.md). Without `singles_first` all are random.

    Returns:
        Zeros and ones, (n_individuals, n_questions).
    """
    population = rng.integers(0, 2, size=(n_individuals, n_questions), dtype=np.uint8)
    if not singles_first:
        return population
    single = rng.permutation(n_questions)[: n_individuals // _SINGLE_SHARE]
    population[: single.size] = 0
    population[np.arange(single.size), single] = 1
    return population


def tournament(
    values: NDArray[np.float64], size: int, rng: np.random.Generator
) -> NDArray[np.intp]:
    """Select as many parents as there are individuals, like DEAP's `selTournament`.

    Args:
        values: fitness of each individual, (n_individuals,).
        size: aspirants in each tournament, drawn with replacement.
        rng: source of the draws.

    Returns:
        Positions of the winners, (n_individuals,). Of equally fit aspirants, the first wins.
    """
    aspirants = rng.integers(values.size, size=(values.size, size))
    winners = values[aspirants].argmax(axis=1)
    parents: NDArray[np.intp] = aspirants[np.arange(values.size), winners]
    return parents


def two_point_crossover(
    population: NDArray[np.uint8], probability: float, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Let neighbours (0 and 1, 2 and 3, ...) swap a slice, in place, like DEAP's `cxTwoPoint`.

    The slice [start, stop) lies between two different cuts from 1 to n_questions; so question 0
    never moves, exactly as in DEAP. A single question leaves nothing to swap.

    Args:
        population: zeros and ones, (n_individuals, n_questions); changed in place.
        probability: chance that a pair mates, in [0, 1].
        rng: source of the draws.

    Returns:
        Who mated, (n_individuals,). An odd last individual never does.
    """
    n_individuals, n_questions = population.shape
    mated = np.zeros(n_individuals, dtype=bool)
    if n_questions < 2:
        return mated
    left = 2 * np.flatnonzero(rng.random((n_individuals // 2,)) < probability)
    first = rng.integers(1, n_questions + 1, size=left.size)
    second = rng.integers(1, n_questions, size=left.size)
    second += second >= first  # uniform over the cuts other than the first
    cuts = np.sort([first, second], axis=0)[..., np.newaxis]  # (2, n_pairs, 1)
    question = np.arange(n_questions)
    swapped = (cuts[0] <= question) & (question < cuts[1])  # (n_pairs, n_questions)
    differing = (population[left] ^ population[left + 1]) & swapped
    population[left] ^= differing
    population[left + 1] ^= differing
    mated[left] = mated[left + 1] = True
    return mated


def flip_mutation(
    population: NDArray[np.uint8], probability: float, bit_flip: float, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Flip bits of some individuals, in place, like DEAP's `mutFlipBit`.

    Args:
        population: zeros and ones, (n_individuals, n_questions); changed in place.
        probability: chance that an individual mutates, in [0, 1].
        bit_flip: chance that a bit of a mutating individual flips, in [0, 1].
        rng: source of the draws.

    Returns:
        Who mutated, (n_individuals,), even if no bit of theirs flipped.
    """
    n_individuals, n_questions = population.shape
    mutated = rng.random((n_individuals,)) < probability
    population[mutated] ^= rng.random((np.count_nonzero(mutated), n_questions)) < bit_flip
    return mutated


def fittest(population: NDArray[np.uint8], values: NDArray[np.float64]) -> int:
    """Position of the best individual, ties broken as `search` says; of clones, the first."""
    ties = np.flatnonzero(values == values.max())
    sizes = np.count_nonzero(population[ties], axis=1)
    # Packed bits sort like the vectors themselves, eight at a time; lexsort's last key leads.
    packed = np.packbits(population[ties], axis=1)  # (n_ties, n_questions / 8)
    return int(ties[np.lexsort([*packed.T[::-1], sizes])[0]])


def better(
    first: NDArray[np.uint8], second: NDArray[np.uint8], fitness: Fitness
) -> NDArray[np.uint8]:
    """The better of two individuals, ties broken as `search` says."""
    both = np.stack([first, second])
    winner: NDArray[np.uint8] = both[fittest(both, fitness(both))]
    return winner


def require_small(settings: SearchSettings, n_questions: int) -> None:
    """Refuse a population that would not fit into memory.

    Raises:
        ValueError: if population times questions is too large.
    """
    if settings.population * n_questions > MAX_GENES:
        raise ValueError(
            f"{settings.population} individuals x {n_questions} questions exceed "
            f"{MAX_GENES} bits; lower the population or switch questions off"
        )


def require_searchable(counts: Counts) -> None:
    """Refuse a table in which there is nothing to choose.

    Raises:
        NothingToSearchError: if there are no questions, no images or no images of one state.
    """
    if counts.n_questions == 0:
        raise NothingToSearchError("there are no questions; switch some on or add wordings")
    if counts.n_images == 0:
        raise NothingToSearchError(
            "no training image has a label and all its answers; label images, then ask the model"
        )
    states = set(counts.labels.tolist())
    if len(states) == 1:
        known, lacking = ("positive", "negative") if 1 in states else ("negative", "positive")
        raise NothingToSearchError(
            f"all {counts.n_images} training images show the {known} state; "
            f"label some of the {lacking} state, then ask the model"
        )
