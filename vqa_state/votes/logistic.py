"""Logistic regression with an L2 penalty whose strength is chosen by cross-validation.

    minimize  sum_i c_i log(1 + exp(-y_i (w x_i + b))) + strength * S / 2 * |w|^2

where the weights c_i give both states the same sum and S is the mean squared distance of the
features from their mean, so that neither the features' scale nor their number changes what a
strength means. The intercept is not penalized.

All folds and strengths are solved at once, by Newton's method in the space of the images: an
out-of-bag estimate needs thousands of such fits on tens of images, which scikit-learn's
`LogisticRegression`, the oracle of the tests, does one by one, a hundred times slower. With
hundreds of images a step's matrices become too large; then conjugate gradients find the step
(`_iterated_step`), which for rows along their principal axes takes a few rounds.

Source: T. Hastie, R. Tibshirani, J. Friedman, *The Elements of Statistical Learning*, 2nd edition,
sections 4.4.1 (Newton's method) and 18.3.5 (the rotation to n_images dimensions); J. Nocedal,
S. J. Wright, *Numerical Optimization*, 2nd edition, algorithm 5.3 (preconditioned gradients).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.votes.folds import stratified_folds

__all__ = ["STRENGTHS", "LogisticFit", "balanced", "fit_logistic", "solve"]

STRENGTHS = (1 / 64, 1 / 16, 1 / 4, 1.0, 4.0)
N_FOLDS = 5

_MAX_STEPS = 100
_MAX_HALVINGS = 30
_CLOSE = 1e-9

_FEW_COLUMNS = 200  # up to here a step's matrices are solved as they are
_MAX_ROUNDS = 500
_STEP_CLOSE = 1e-8  # of the gradient's length, that a step may leave

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class LogisticFit:
    """A linear model: the positive state where `features @ coefficients + intercept` is above 0.

    Attributes:
        coefficients: (n_features,).
        intercept: in the same unit.
        strength: of the penalty, one of those tried.
    """

    coefficients: Floats
    intercept: float
    strength: float

    def decision(self, features: Floats) -> Floats:
        """Logarithm of the odds for the positive state, (n_rows,)."""
        return features @ self.coefficients + self.intercept


def fit_logistic(
    features: Floats,
    labels: NDArray[np.int8],
    groups: NDArray[np.int64],
    strengths: tuple[float, ...] = STRENGTHS,
) -> LogisticFit:
    """Choose a strength by cross-validation and fit with it. The same arguments, the same fit.

    Args:
        features: (n_rows, n_features).
        labels: +1 or -1, (n_rows,), both present.
        groups: rows of one number never stand on both sides of a fold, (n_rows,).
        strengths: to choose from, ascending; of equally good ones, the strongest. Where a state
            has one group only there is nothing to validate on, and the middle one is taken.

    Raises:
        ValueError: if shapes differ, a feature is not finite, or a state has no rows.
    """
    n_rows = len(labels)
    if features.ndim != 2 or not len(features) == n_rows == len(groups):
        raise ValueError(f"need {n_rows} rows of features, got {features.shape}")
    if not np.isfinite(features).all() or set(labels.tolist()) != {1, -1}:
        raise ValueError("need finite features, and rows of both states")
    center = features.mean(axis=0)
    left, sizes, right = np.linalg.svd(features - center, full_matrices=False)
    rows = left * sizes  # (n_rows, rank), the same distances as the features
    scale = float((sizes**2).sum()) / n_rows
    if scale == 0:
        return LogisticFit(np.zeros(features.shape[1]), 0.0, strengths[len(strengths) // 2])
    strength = _best_strength(rows, labels, groups, strengths, scale)
    rotated, intercepts = solve(rows, labels, balanced(labels)[np.newaxis], [strength * scale])
    coefficients = rotated[0] @ right
    return LogisticFit(coefficients, float(intercepts[0] - center @ coefficients), strength)


def balanced(labels: NDArray[np.int8], used: NDArray[np.bool_] | None = None) -> Floats:
    """Weights of rows, (n_rows,), that sum up to the rows used, half of it for each state."""
    used = np.ones(len(labels), dtype=bool) if used is None else used
    weights = np.zeros(len(labels))
    for state in (1, -1):
        of_state = used & (labels == state)
        n_of_state = max(1, int(np.count_nonzero(of_state)))
        weights[of_state] = int(np.count_nonzero(used)) / 2 / n_of_state
    return weights


def _best_strength(
    rows: Floats,
    labels: NDArray[np.int8],
    groups: NDArray[np.int64],
    strengths: tuple[float, ...],
    scale: float,
) -> float:
    """The strength with the least loss on the folds left out."""
    fold = stratified_folds(labels, groups, N_FOLDS)
    n_folds = int(fold.max()) + 1
    if n_folds < 2:
        return strengths[len(strengths) // 2]
    weights = np.stack([balanced(labels, fold != number) for number in range(n_folds)])
    coefficients, intercepts = solve(
        rows,
        labels,
        np.repeat(weights, len(strengths), axis=0),
        np.tile(np.array(strengths) * scale, n_folds),
    )
    odds = (coefficients @ rows.T + intercepts[:, np.newaxis]).reshape(n_folds, len(strengths), -1)
    left_out = odds[fold, :, np.arange(len(labels))]  # (n_rows, n_strengths)
    losses = balanced(labels) @ np.logaddexp(0, -labels[:, np.newaxis] * left_out)
    return strengths[int(np.flatnonzero(losses <= losses.min() + _CLOSE)[-1])]


def solve(
    rows: Floats, labels: NDArray[np.int8], weights: Floats, penalties: Floats | list[float]
) -> tuple[Floats, Floats]:
    """Solve several problems on the same rows.

    Args:
        rows: (n_rows, n_features), best centered.
        labels: +1 or -1, (n_rows,).
        weights: of the rows in each problem, (n_problems, n_rows); both states need some.
        penalties: what |w|^2 / 2 is multiplied with, above 0, (n_problems,).

    Returns:
        Coefficients, (n_problems, n_features), and intercepts, (n_problems,).
    """
    design = np.column_stack([rows, np.ones(len(rows))])
    ridge = np.outer(np.asarray(penalties, dtype=np.float64), np.ones(design.shape[1]))
    ridge[:, -1] = 0  # the intercept
    theta = np.zeros(ridge.shape)
    loss = _loss(theta, design, labels, weights, ridge)
    for _ in range(_MAX_STEPS):
        step = _newton_step(theta, design, labels, weights, ridge)
        theta, before = theta - step, theta
        size = np.ones((len(theta), 1))
        for _ in range(_MAX_HALVINGS):
            now = _loss(theta, design, labels, weights, ridge)
            worse = now > loss + _CLOSE * (1 + loss)
            if not worse.any():
                break
            size[worse] /= 2
            theta = before - size * step
        loss = now
        if np.abs(size * step).max() <= _CLOSE * (1 + np.abs(theta).max()):
            break
    return theta[:, :-1], theta[:, -1]


def _loss(
    theta: Floats, design: Floats, labels: NDArray[np.int8], weights: Floats, ridge: Floats
) -> Floats:
    margins = labels * (theta @ design.T)  # (n_problems, n_rows)
    losses: Floats = (weights * np.logaddexp(0, -margins)).sum(axis=1)
    penalty: Floats = (ridge * theta**2).sum(axis=1) / 2
    return losses + penalty


def _newton_step(
    theta: Floats, design: Floats, labels: NDArray[np.int8], weights: Floats, ridge: Floats
) -> Floats:
    margins = labels * (theta @ design.T)
    surprise = np.exp(-np.logaddexp(0, margins))  # 1 - P(label), (n_problems, n_rows)
    gradient = ridge * theta - (weights * labels * surprise) @ design
    curvature = weights * surprise * (1 - surprise)
    if design.shape[1] > _FEW_COLUMNS:
        return _iterated_step(design, curvature, ridge, gradient)
    hessian = (design.T * curvature[:, np.newaxis]) @ design  # (n_problems, n, n)
    diagonal = np.arange(design.shape[1])
    hessian[:, diagonal, diagonal] += ridge + 1e-12
    step: Floats = np.linalg.solve(hessian, gradient[..., np.newaxis])[..., 0]
    return step


def _iterated_step(design: Floats, curvature: Floats, ridge: Floats, gradient: Floats) -> Floats:
    """Newton's step of every problem by conjugate gradients: no matrix of a problem is made.

    The principal axes make each Hessian nearly diagonal, so its diagonal is divided by first.
    """
    diagonal = curvature @ design**2 + ridge + 1e-12
    step, left = np.zeros_like(gradient), gradient.copy()
    scaled = left / diagonal
    way, length = scaled.copy(), (left * scaled).sum(axis=1, keepdims=True)
    enough = _STEP_CLOSE**2 * length
    for _ in range(_MAX_ROUNDS):
        if (length <= enough).all():
            break
        bent = ((way @ design.T) * curvature) @ design + ridge * way
        going = (way * bent).sum(axis=1, keepdims=True)
        # A problem that is solved stays where it is: 0 / 0 is no step.
        size = np.divide(length, going, out=np.zeros_like(length), where=length > enough)
        step += size * way
        left -= size * bent
        scaled = left / diagonal
        before, length = length, (left * scaled).sum(axis=1, keepdims=True)
        way = scaled + np.divide(length, before, out=np.zeros_like(length), where=before > 0) * way
    return step
