"""Random tables for the tests of searches and proofs, and the literal E in fractions."""

from fractions import Fraction
from itertools import product

import numpy as np

from vqa_state.answers.rates import Counts


def draw_counts(seed, n_images=6, n_questions=8, n_copies=3, p_invalid=0.2) -> Counts:
    """Few copies, so that ties are frequent, and an image that nobody answers about."""
    rng = np.random.default_rng(seed)
    invalid = rng.binomial(n_copies, p_invalid, (n_images, n_questions))
    invalid[rng.integers(n_images)] = n_copies
    correct = rng.binomial(n_copies - invalid, rng.beta(0.8, 0.8, (n_images, n_questions)))
    labels = np.where(np.arange(n_images) % 2, 1, -1).astype(np.int8)
    return Counts(correct, n_copies - invalid - correct, invalid, labels)


def repeat_questions(counts: Counts, times: int) -> Counts:
    """Every question so often, one after the other."""
    kinds = (counts.correct, counts.wrong, counts.invalid)
    return Counts(*(np.tile(kind, (1, times)) for kind in kinds), counts.labels)


def exact_fitness(counts, objective, weights, vector):
    """(E, recognized images) of a vector of zeros and ones, in fractions; None if it is empty."""
    if not any(vector):
        return None
    rates, recognized = [], 0
    for correct, wrong, invalid in zip(counts.correct, counts.wrong, counts.invalid, strict=True):
        C = sum(int(c) for c, bit in zip(correct, vector, strict=True) if bit)
        W = sum(int(w) for w, bit in zip(wrong, vector, strict=True) if bit)
        other = sum(int(i) for i, bit in zip(invalid, vector, strict=True) if bit)
        asked = C + W + (other if objective.kind.primed else 0)
        rates.append(Fraction(C, asked) if asked else Fraction(0))
        recognized += asked < 2 * C
    R_q = Fraction(sum(vector), len(vector))
    E = (
        Fraction(weights.alpha) * recognized / len(rates)
        + sum(rates) / len(rates)
        + objective.kind.beta_sign * Fraction(weights.beta) * R_q
    )
    return E, recognized


def brute_force(counts, objective, weights):
    """(largest E, subset, most recognized images) over all subsets, with the documented ties."""
    ranked, most = [], 0
    for vector in product((0, 1), repeat=counts.n_questions):
        found = exact_fitness(counts, objective, weights, vector)
        if found is not None:
            ranked.append((-found[0], sum(vector), vector))
            most = max(most, found[1])
    E, _, vector = min(ranked)
    return -E, tuple(i for i, bit in enumerate(vector) if bit), most
