"""Synthetic answer counts that look like a vision-language model's.

What makes real tables special is that answers hang together: some wordings suit a scene better,
some images are hard in every question, and the copies of one image nearly always agree. So the
evidence is built from effects of the task, the wording, the image and the single question, and
only the last bit of noise is drawn anew for each copy.
"""

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from vqa_state.answers.rates import Counts

__all__ = ["Task", "digest", "draw_counts", "draw_task", "numbered_table"]

N_COPIES = 6

# Spread of the evidence over images, image x wording, image x question, and copies.
IMAGE, IMAGE_WORDING, IMAGE_QUESTION, COPY = 0.45, 0.35, 0.35, 0.25

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """How well a model does on one thing and its questions; arrays are (n_questions,) if not said.

    Attributes:
        wording: which wording each question uses.
        asks_negative: whether "yes" speaks for the negative state.
        strength: evidence of each wording for the true state, (n_wordings,).
        lean: how much each wording prefers one state whatever the image, (n_wordings,).
        gain: how much of the evidence a question uses; negative if it asks for the other state.
        yes_bias: how much a question prefers "yes".
        invalid_bias: how readily a question is answered with neither yes nor no.
    """

    wording: NDArray[np.intp]
    asks_negative: NDArray[np.bool_]
    strength: Floats
    lean: Floats
    gain: Floats
    yes_bias: Floats
    invalid_bias: Floats


def numbered_table(n_questions: int, n_images: int, number: int) -> Counts:
    """The table that `optima.json` knows by this number: a task and its images."""
    rng = np.random.default_rng([n_questions, n_images, number])
    return draw_counts(draw_task(rng, n_questions), n_images, rng)


def digest(counts: Counts) -> str:
    """Of all answers: shows whether this NumPy still draws the table that an optimum is of."""
    kinds = (counts.correct, counts.wrong, counts.invalid)
    content = b"".join(kind.astype("<i8").tobytes() for kind in kinds)
    return hashlib.sha256(content).hexdigest()[:16]


def draw_task(rng: np.random.Generator, n_questions: int) -> Task:
    """Draw a task of random difficulty, with 16 questions a wording, like the paper's grid."""
    difficulty = rng.uniform()
    question = np.arange(n_questions)
    wording, does = question // 16, question // 8 % 2 == 1
    asks_negative = question // 4 % 2 == 1
    n_wordings = int(wording.max()) + 1
    kind = 2 * asks_negative + does  # questions of one kind and wording share a bias
    useless = rng.random(n_wordings) < 0.15 + 0.25 * difficulty
    strength = 1.5 ** (1 - difficulty) * 0.55**difficulty * _spread(rng, 0.35, n_wordings)
    blind = rng.random((2, n_wordings)) < 0.08 + 0.17 * difficulty  # misses "not" or the antonym
    sign = np.where(asks_negative, np.where(blind[does.astype(int), wording], 0.3, -1.0), 1.0)
    shared_bias = rng.normal(0, 0.25 + 0.35 * difficulty, (4, n_wordings))
    invalid_is = rng.choice([-2.6, -2.0, -0.4], p=[0.45, 0.35, 0.2])
    return Task(
        wording=wording,
        asks_negative=asks_negative,
        strength=np.where(useless & (n_wordings > 1), 0.2, 1.0) * strength,
        lean=rng.normal(0, 0.25 + 0.75 * difficulty)
        + rng.normal(0, 0.2 + 0.3 * difficulty, n_wordings),
        gain=sign * np.where(does, 0.9, 1.1) * _spread(rng, 0.25, n_questions),
        yes_bias=shared_bias[kind, wording]
        + rng.normal(0, 0.25, n_questions)
        + np.where(does, 0.2, 0.0),
        invalid_bias=np.where(does, -4.2, invalid_is)
        + rng.normal(0, 0.5, n_wordings)[wording]
        + rng.normal(0, 0.6, n_questions),
    )


def draw_counts(task: Task, n_images: int, rng: np.random.Generator) -> Counts:
    """Draw images of a task, the first half of the positive state, and count their answers."""
    labels = np.where(np.arange(n_images) < n_images // 2, 1, -1)
    truth_is_yes = np.where(task.asks_negative, -1, 1) * labels[:, np.newaxis] > 0
    p_yes = ndtr(_evidence(task, labels, rng) / COPY)
    invalid = rng.binomial(N_COPIES, _p_invalid(task, n_images, rng))
    correct = rng.binomial(N_COPIES - invalid, np.where(truth_is_yes, p_yes, 1 - p_yes))
    return Counts(correct, N_COPIES - invalid - correct, invalid, labels.astype(np.int8))


def _evidence(task: Task, labels: NDArray[np.int_], rng: np.random.Generator) -> Floats:
    """Evidence for "yes" before the noise of a copy, (n_images, n_questions)."""
    n_images, n_wordings = len(labels), len(task.strength)
    clarity = labels * _spread(rng, 0.3, n_images)
    of_wording = (
        clarity[:, np.newaxis] * task.strength
        + rng.normal(0, IMAGE, (n_images, 1))
        + rng.normal(0, IMAGE_WORDING, (n_images, n_wordings))
        + task.lean
    )
    noise = rng.normal(0, IMAGE_QUESTION, (n_images, len(task.gain)))
    evidence: Floats = of_wording[:, task.wording] * task.gain + task.yes_bias + noise
    return evidence


def _p_invalid(task: Task, n_images: int, rng: np.random.Generator) -> Floats:
    """Chance that a copy's answer is Invalid, (n_images, n_questions)."""
    of_image = rng.normal(0, 0.5, (n_images, 1))
    of_wording = rng.normal(0, 0.5, (n_images, len(task.strength)))[:, task.wording]
    noise = rng.normal(0, 0.6, (n_images, len(task.gain)))
    return np.asarray(ndtr((task.invalid_bias + of_image + of_wording + noise) * 0.6 / 0.35))


def _spread(rng: np.random.Generator, sigma: float, size: int) -> Floats:
    """Factors around 1."""
    return np.exp(rng.normal(0, sigma, size))
