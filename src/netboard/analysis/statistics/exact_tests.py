"""Tests of differences with the dyad as the unit of replication: all arrangements, where they are not too many.

With few units a test says by `least_p` what it could show at best. Nothing here draws a random number but from the
generator that it is given.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import comb, inf
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from netboard.analysis.statistics.estimates import known, mean

Alternative = Literal["two-sided", "greater", "less"]

MOST_EXACT = 100_000
"""Up to so many arrangements are all looked at [1]."""


SYMMETRIC = (
    "assumes that differences are symmetric about 0 where there is no effect: "
    "of 8 log-normal ones, which are skewed, it rejects 15 % at .05"
)
"""What must be known to read a p of changed signs; docs/explanation/analysis-calibration.md has the simulation."""


@dataclass(frozen=True, slots=True)
class Test:
    """A test of the hypothesis that there is no difference.

    Attributes
    ----------
    statistic : float
        What is tested; NaN without data [its own].
    p : float
        How probable so large a statistic is by chance; NaN without data [1].
    least_p : float
        The smallest p that so many units could give [1].
    n : int
        Units of replication that count [1].
    unit : str
        What they are.
    exact : bool
        All arrangements were looked at; otherwise a random sample.
    method : str
        Name of the test.
    """

    statistic: float
    p: float
    least_p: float
    n: int
    unit: str
    exact: bool
    method: str


def sign_test(differences: ArrayLike, *, alternative: Alternative = "two-sided", unit: str = "dyad") -> Test:
    """Test whether differences are as often positive as negative: the exact binomial test.

    Parameters
    ----------
    differences : array_like, shape (n,)
        One for each unit; zeros and NaN are left out [any].
    alternative : {"two-sided", "greater", "less"}
        Positive ones are more, or fewer.
    unit : str
        What the differences are of.

    Returns
    -------
    Test
        The statistic is the number of positive differences; nothing is tested without a difference that is not zero.
    """
    x = known(differences)
    x = x[x != 0.0]
    if not len(x):
        return Test(np.nan, np.nan, np.nan, 0, unit, True, "sign test")
    n, positive = len(x), int((x > 0.0).sum())
    p = float(stats.binomtest(positive, n, alternative=alternative).pvalue)
    return Test(float(positive), p, _least(2**n, alternative), n, unit, True, "sign test")


def permutation_test(
    differences: ArrayLike,
    *,
    alternative: Alternative = "two-sided",
    rng: np.random.Generator | None = None,
    resamples: int = 9999,
    unit: str = "dyad",
) -> Test:
    """Test whether paired differences are zero on average: Fisher's test, by all changes of their signs.

    It holds for any distribution that is symmetric about zero if there is no difference, and not for skewed ones
    (`SYMMETRIC`).

    Parameters
    ----------
    differences : array_like, shape (n,)
        One for each unit; NaN are left out [any].
    alternative : {"two-sided", "greater", "less"}
        The mean is larger, or smaller.
    rng : numpy.random.Generator or None
        Source of chance for more than 16 units, whose arrangements are too many.
    resamples : int
        How many of those are drawn [1].
    unit : str
        What the differences are of.

    Returns
    -------
    Test
        The statistic is the mean; without p for fewer than two units.

    Raises
    ------
    ValueError
        If there are too many units for all arrangements, and no generator.
    """
    x = known(differences)
    if len(x) < 2:
        return Test(mean(x), np.nan, np.nan, len(x), unit, True, "sign flips")
    p, exact = _permuted((x,), _mean_along, "samples", 2 ** len(x), alternative, rng, resamples)
    return Test(mean(x), p, _least(2 ** len(x), alternative), len(x), unit, exact, "sign flips")


def permutation_test_between(
    first: ArrayLike,
    second: ArrayLike,
    *,
    alternative: Alternative = "two-sided",
    rng: np.random.Generator | None = None,
    resamples: int = 9999,
    unit: str = "dyad",
) -> Test:
    """Test whether two groups of different units have equal means, by all divisions of the units into two such groups.

    Parameters
    ----------
    first, second : array_like, shape (n,) and (m,)
        One value for each unit; NaN are left out [any].
    alternative : {"two-sided", "greater", "less"}
        The first mean is larger, or smaller.
    rng : numpy.random.Generator or None
        Source of chance for more than `MOST_EXACT` divisions.
    resamples : int
        How many of those are drawn [1].
    unit : str
        What the values are of.

    Returns
    -------
    Test
        The statistic is the difference of the means, first less second; without p for fewer than two units in a group.

    Raises
    ------
    ValueError
        If there are too many units for all divisions, and no generator.
    """
    x, y = known(first), known(second)
    n = len(x) + len(y)
    if len(x) < 2 or len(y) < 2:
        return Test(mean(x) - mean(y), np.nan, np.nan, n, unit, True, "divisions")
    divisions = comb(n, len(x))
    p, exact = _permuted((x, y), _difference_along, "independent", divisions, alternative, rng, resamples)
    # Two groups of one size change places: each division has a mirror image, as each choice of signs has.
    paired = divisions if len(x) == len(y) or alternative != "two-sided" else 2 * divisions
    return Test(mean(x) - mean(y), p, min(1.0, _least(paired, alternative)), n, unit, exact, "divisions")


def _mean_along(x: NDArray[np.float64], axis: int) -> Any:
    return np.mean(x, axis=axis)


def _difference_along(x: NDArray[np.float64], y: NDArray[np.float64], axis: int) -> Any:
    return np.mean(x, axis=axis) - np.mean(y, axis=axis)


def _least(arrangements: int, alternative: Alternative) -> float:
    """Return the smallest p of a symmetric distribution of equally probable arrangements."""
    return min(1.0, (2.0 if alternative == "two-sided" else 1.0) / arrangements)


def _permuted(
    data: tuple[NDArray[np.float64], ...],
    statistic: Callable[..., Any],
    kind: str,
    arrangements: int,
    alternative: Alternative,
    rng: np.random.Generator | None,
    resamples: int,
) -> tuple[float, bool]:
    """Return p by all arrangements, or by a sample of them."""
    exact = arrangements <= MOST_EXACT
    if not exact and rng is None:
        raise ValueError(f"{arrangements} arrangements are too many to look at all of them: give a random generator")
    found = stats.permutation_test(
        data,
        statistic,
        permutation_type=kind,
        vectorized=True,
        n_resamples=inf if exact else resamples,
        alternative=alternative,
        rng=rng,
    )
    return float(found.pvalue), exact
