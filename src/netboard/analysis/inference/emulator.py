"""A regression that stands for the simulation: quadratic in the scores of the parameters, with a ridge penalty.

A posterior needs the summaries at hundreds of thousands of parameter sets, of which some hundred can be simulated.
The penalty of each summary is that with the smallest leave-one-out error (PRESS), which a singular value decomposition
gives without refitting (Hastie, Tibshirani and Friedman 2009, section 7.10; Allen 1974).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PENALTIES = np.logspace(-3.0, 3.0, 25)
"""Ridge penalties that are compared [1]."""


def features(scores: Array) -> Array:
    """Return linear terms, squares and products of scores, shape (n, terms) [1]."""
    first, second = np.triu_indices(scores.shape[1])
    return np.concatenate([scores, scores[:, first] * scores[:, second]], axis=1)


@dataclass(frozen=True, slots=True)
class Emulator:
    """Expected summaries as a function of the scores.

    - `centre` (shape (terms,)), `slopes` (shape (terms, m)), `level` (shape (m,)): regression on centred terms [1].
    - `explained` (shape (m,)): share of the variance of each summary that leave-one-out predictions explain [1].
    """

    centre: Array
    slopes: Array
    level: Array
    explained: Array

    def __call__(self, scores: Array) -> Array:
        """Return the summaries at scores, shape (n, m)."""
        return np.asarray((features(scores) - self.centre) @ self.slopes + self.level)


def fitted(scores: Array, summaries: Array) -> Emulator:
    """Fit the regression.

    - `scores` (shape (n, k)), `summaries` (shape (n, m)): simulated designs.
    """
    terms = features(scores)
    centre, level = terms.mean(axis=0), summaries.mean(axis=0)
    left, singular, right = np.linalg.svd(terms - centre, full_matrices=False)
    rotated, errors = left.T @ (summaries - level), []
    for penalty in PENALTIES:
        kept = singular**2 / (singular**2 + penalty)
        leverage = 1.0 / len(terms) + (left**2 * kept).sum(axis=1)
        residuals = summaries - level - left @ (kept[:, None] * rotated)
        errors.append(np.mean((residuals / (1.0 - leverage)[:, None]) ** 2, axis=0))
    best = np.argmin(errors, axis=0)
    shrunk = singular[:, None] / (singular[:, None] ** 2 + PENALTIES[best])
    explained = 1.0 - np.min(errors, axis=0) / summaries.var(axis=0)
    return Emulator(centre, right.T @ (shrunk * rotated), level, explained)
