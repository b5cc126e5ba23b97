"""Firth's penalised likelihood: regression of counts and failures with finite estimates under separation.

The likelihood is multiplied by the square root of the determinant of the information (Firth, Biometrika 80:27, 1993),
which removes most of the small-sample bias. Estimates stay finite if a condition has no events. Confidence intervals
are profile intervals of this likelihood (Heinze and Schemper, Stat. Med. 21:2409, 2002), because Wald intervals are far
too short on one side.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import expit, gammaln, xlog1py, xlogy

Array = NDArray[np.float64]
Family = Literal["poisson", "binomial"]

STEPS, LONGEST, ENOUGH = 60, 5.0, 1e-9
"""Maximum number of steps of a search, longest step, and step at which it ends [1, 1, 1]."""

FARTHEST = 60.0
"""Largest distance from the estimate at which a profile is evaluated [log of the response]."""


@dataclass(frozen=True, slots=True, eq=False)
class Penalised:
    """Maximum of the penalised likelihood.

    Attributes
    ----------
    coefficients : ndarray of float64, shape (k,)
        Estimates [log of the response].
    covariance : ndarray of float64, shape (k, k)
        Inverse information of independent trials [square of a coefficient's].
    means : ndarray of float64, shape (n,)
        Fitted mean of each trial: a count, or a probability [the response's].
    likelihood : float
        Penalised log-likelihood [1].
    converged : bool
        Whether the search converged.
    """

    coefficients: Array
    covariance: Array
    means: Array
    likelihood: float
    converged: bool


def firth_fit(response: Array, columns: Array, family: Family, fixed: tuple[Array, float] | None = None) -> Penalised:
    """Maximise the penalised likelihood of a regression with canonical link and independent trials.

    Parameters
    ----------
    fixed : tuple of ndarray of float64, shape (k,), and float, or None
        Linear combination of coefficients and the value at which it is fixed, for a profile [any].
    """
    k = columns.shape[1]
    at, free = np.zeros(k), np.eye(k)
    if fixed is not None:
        row, value = fixed
        at = row * value / float(row @ row)
        free = np.linalg.svd(row[None, :])[2][1:].T
    here = _Point.at(response, columns, family, at)
    for _ in range(STEPS):
        if not free.shape[1]:
            return here.ended(converged=True)
        # Far from the maximum some fitted means are exactly 0 or 1, and the information is singular.
        step = free @ np.linalg.lstsq(free.T @ here.information @ free, free.T @ here.score)[0]
        step *= min(1.0, LONGEST / max(float(np.abs(columns @ step).max()), 1e-300))
        if float(np.abs(step).max()) < ENOUGH:
            return here.ended(converged=True)
        for share in 0.5 ** np.arange(12):
            there = _Point.at(response, columns, family, here.coefficients + share * step)
            if there.likelihood >= here.likelihood - 1e-12 * abs(here.likelihood):
                break
        else:
            return here.ended(converged=float(np.abs(step).max()) < 1e-5)
        here = there
    return here.ended(converged=False)


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """Likelihood, modified score and information at given coefficients."""

    coefficients: Array
    means: Array
    likelihood: float
    score: Array
    information: Array

    @classmethod
    def at(cls, response: Array, columns: Array, family: Family, coefficients: Array) -> "_Point":
        """Compute the score X' (y - m + h V'(m) / 2), with the leverages h and the variance V of the mean m."""
        line = columns @ coefficients
        if family == "poisson":
            means = np.exp(np.minimum(line, 700.0))
            weights, slope = means, 1.0
            plain = float((response * line - means - gammaln(response + 1.0)).sum())
        else:
            means = expit(line)
            weights, slope = means * (1.0 - means), 1.0 - 2.0 * means
            plain = float((xlogy(response, means) + xlog1py(1.0 - response, -means)).sum())
        root = np.sqrt(np.maximum(weights, 1e-300))
        basis, triangle = np.linalg.qr(columns * root[:, None])
        diagonal = np.maximum(np.abs(np.diag(triangle)), 1e-150)
        leverages = (basis**2).sum(axis=1)
        score = columns.T @ (response - means + 0.5 * leverages * slope)
        likelihood = plain + float(np.log(diagonal).sum())
        return cls(coefficients, means, likelihood, score, triangle.T @ triangle)

    def ended(self, *, converged: bool) -> Penalised:
        """Return this point as the estimates."""
        covariance = np.asarray(np.linalg.pinv(self.information), dtype=float)
        return Penalised(self.coefficients, covariance, self.means, self.likelihood, converged)


def profile_interval(
    response: Array, columns: Array, family: Family, best: Penalised, row: Array, drop: float
) -> tuple[float, float]:
    """Return the two values at which the profile lies a given drop below its maximum [log of the response].

    The profile is that of the penalised likelihood; a limit is infinite if it does not drop so far.

    Parameters
    ----------
    best : Penalised
        Maximum of the penalised likelihood of these data.
    row : ndarray of float64, shape (k,)
        Linear combination of the coefficients [1].
    drop : float
        Half of the quantile of the likelihood-ratio statistic [1].
    """
    value = float(row @ best.coefficients)
    error = max(float(np.sqrt(row @ best.covariance @ row)), 1e-6)

    def above(x: float) -> float:
        found = firth_fit(response, columns, family, (row, x)).likelihood - best.likelihood + drop
        return found if np.isfinite(found) else -drop

    ends = []
    for side in (-1.0, 1.0):
        reach = error
        while reach < FARTHEST and above(value + side * reach) > 0.0:
            reach *= 2.0
        end = value + side * reach
        lowered = reach < FARTHEST or above(end) <= 0.0
        ends.append(float(brentq(above, value, end, xtol=1e-4)) if lowered else side * np.inf)
    return ends[0], ends[1]
