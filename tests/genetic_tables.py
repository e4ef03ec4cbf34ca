"""What the tests of the genetic search share."""

import numpy as np

from vqa_state.answers.rates import Counts
from vqa_state.search.genetic import SearchSettings

QUICK = SearchSettings(population=60, generations=12)


def table(n_images=10, n_questions=16, seed=0) -> Counts:
    """Answers hard enough that runs end in different places."""
    rng = np.random.default_rng(seed)
    correct = rng.binomial(6, rng.beta(0.6, 0.6, (n_images, n_questions)))
    invalid = rng.binomial(6 - correct, 0.15)
    labels = np.where(np.arange(n_images) % 2, 1, -1).astype(np.int8)
    return Counts(correct, 6 - correct - invalid, invalid, labels)


def put_singles(population, questions):
    """Let the first individuals hold one question each."""
    for row, question in enumerate(questions):
        for place in range(len(population[row])):
            population[row][place] = int(place == question)


def last(reports):
    *_, report = reports
    return report
