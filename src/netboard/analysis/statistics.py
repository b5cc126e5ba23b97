"""What few dyads can show: intervals, exact tests and sizes of effects, with the dyad as the unit of replication.

Trials of one dyad are not independent of each other, and neither are its partners; a study has as many values as it has
dyads. Every result therefore carries how many units it is made of, and of what kind they are. With few units the
bootstrap's intervals are too short (docs/analysis-modern.md has the numbers); those of t are the default elsewhere, and
exact tests say by `least_p` what they could show at best.

Nothing here draws a random number but from the generator that it is given.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import comb, exp, inf, lgamma, log, sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.optimize import brentq

Alternative = Literal["two-sided", "greater", "less"]
Bootstrap = Literal["percentile", "basic", "BCa"]
Weighting = Literal["units", "samples"]
Correction = Literal["none", "hedges"]

MOST_EXACT = 100_000
"""Up to so many arrangements are all looked at [1]."""

ROUNDING = 1e-12
"""Relative differences up to this are none, but of rounding [1]."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and how sure it is.

    Attributes
    ----------
    value : float
        The estimate; NaN where there is none [its own].
    low, high : float
        Ends of the confidence interval; NaN for too few units [its own].
    level : float
        Confidence [1].
    n : int
        Units of replication [1].
    unit : str
        What they are.
    method : str
        How the interval was found.
    """

    value: float
    low: float
    high: float
    level: float
    n: int
    unit: str
    method: str


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


def t_interval(values: ArrayLike, *, level: float = 0.95, unit: str = "dyad") -> Estimate:
    """Estimate a mean with Student's interval.

    Parameters
    ----------
    values : array_like, shape (n,)
        One for each unit; NaN are left out [any].
    level : float
        Confidence [1].
    unit : str
        What the values are of.

    Returns
    -------
    Estimate
        The mean; without an interval for fewer than two units.
    """
    x = _finite(values)
    if len(x) < 2:
        return Estimate(_mean(x), np.nan, np.nan, level, len(x), unit, "t")
    half = float(stats.t.ppf(0.5 + level / 2.0, len(x) - 1) * stats.sem(x))
    return Estimate(_mean(x), _mean(x) - half, _mean(x) + half, level, len(x), unit, "t")


def cluster_mean(
    clusters: Sequence[ArrayLike],
    rng: np.random.Generator,
    *,
    weighting: Weighting = "units",
    level: float = 0.95,
    method: Bootstrap = "BCa",
    resamples: int = 9999,
    unit: str = "dyad",
) -> Estimate:
    """Estimate the mean of samples that come in clusters, such as the trials of dyads: clusters are drawn, not samples.

    Parameters
    ----------
    clusters : sequence of array_like, shape (n_k,)
        The samples of each unit; NaN, and units without any sample, are left out [any].
    rng : numpy.random.Generator
        Source of chance.
    weighting : {"units", "samples"}
        The mean of the units' means; or that of all samples, in which units with more of them weigh more.
    level : float
        Confidence [1].
    method : {"percentile", "basic", "BCa"}
        As in `bootstrap`.
    resamples : int
        How many sets of units are drawn [1].
    unit : str
        What a cluster is of.

    Returns
    -------
    Estimate
        The mean; without an interval for fewer than two units.
    """
    samples = [x for x in map(_finite, clusters) if len(x)]
    sums, counts = np.array([x.sum() for x in samples]), np.array([float(len(x)) for x in samples])
    if weighting == "units":
        sums, counts = sums / np.maximum(counts, 1.0), np.ones(len(samples))
    return bootstrap((sums, counts), ratio_of_sums, rng, level=level, method=method, resamples=resamples, unit=unit)


def ratio_of_sums(above: NDArray[np.float64], below: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
    """Divide sums over units, for `bootstrap`: a weighted mean, or how much of one effect another one makes.

    Parameters
    ----------
    above, below : ndarray of float64, shape (..., n)
        Values of the units [any].
    axis : int
        That of the units [1].

    Returns
    -------
    ndarray of float64, shape (...)
        Their ratio; NaN where the divisor is 0 [1].
    """
    divisor = np.sum(below, axis=axis)
    return np.asarray(np.sum(above, axis=axis) / np.where(divisor == 0.0, np.nan, divisor))


def bootstrap(
    columns: Sequence[ArrayLike],
    statistic: Callable[..., NDArray[np.float64]],
    rng: np.random.Generator,
    *,
    level: float = 0.95,
    method: Bootstrap = "BCa",
    resamples: int = 9999,
    unit: str = "dyad",
) -> Estimate:
    """Estimate any statistic of units, whole units being drawn with replacement (`scipy.stats.bootstrap`).

    Parameters
    ----------
    columns : sequence of array_like, shape (n,)
        One or more values of each unit [any].
    statistic : callable
        Takes the columns, shape (..., n), and `axis`; returns shape (...) [any].
    rng : numpy.random.Generator
        Source of chance.
    level : float
        Confidence [1].
    method : {"percentile", "basic", "BCa"}
        Percentiles of the drawn statistics, mirrored, or corrected for bias and skewness (Efron 1987).
    resamples : int
        How many sets of units are drawn [1].
    unit : str
        What a row is of.

    Returns
    -------
    Estimate
        The statistic; without an interval for fewer than two units, or where draws have none. Where any one unit alone
        gives the same the interval is a point.

    Raises
    ------
    ValueError
        If the columns have no equal length.
    """
    data = [np.asarray(column, dtype=float) for column in columns]
    if not data or any(column.ndim != 1 or len(column) != len(data[0]) for column in data):
        raise ValueError(f"one value of each unit in each column is expected, found {[len(x) for x in data]}")
    n = len(data[0])
    value = float(statistic(*data, axis=-1)) if n else np.nan
    if n < 2 or not np.isfinite(value):
        return Estimate(value, np.nan, np.nan, level, n, unit, f"bootstrap, {method}")
    alone = statistic(*(np.repeat(column[:, None], n, axis=1) for column in data), axis=-1)
    if np.allclose(alone, value, rtol=ROUNDING, atol=0.0):
        return Estimate(value, value, value, level, n, unit, f"bootstrap, {method}")
    found = stats.bootstrap(
        data,
        statistic,
        paired=True,
        vectorized=True,
        n_resamples=resamples,
        confidence_level=level,
        method=method,
        rng=rng,
    ).confidence_interval
    return Estimate(value, float(found.low), float(found.high), level, n, unit, f"bootstrap, {method}")


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
        The statistic is the number of positive differences.
    """
    x = _finite(differences)
    x = x[x != 0.0]
    n, positive = len(x), int((x > 0.0).sum())
    p = float(stats.binomtest(positive, n, alternative=alternative).pvalue) if n else np.nan
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

    It holds for any distribution that is symmetric about zero if there is no difference.

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
    x = _finite(differences)
    if len(x) < 2:
        return Test(_mean(x), np.nan, np.nan, len(x), unit, True, "sign flips")
    p, exact = _permuted((x,), _mean_along, "samples", 2 ** len(x), alternative, rng, resamples)
    return Test(_mean(x), p, _least(2 ** len(x), alternative), len(x), unit, exact, "sign flips")


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
    x, y = _finite(first), _finite(second)
    n = len(x) + len(y)
    if len(x) < 2 or len(y) < 2:
        return Test(_mean(x) - _mean(y), np.nan, np.nan, n, unit, True, "divisions")
    divisions = comb(n, len(x))
    p, exact = _permuted((x, y), _difference_along, "independent", divisions, alternative, rng, resamples)
    # Two groups of one size change places: each division has a mirror image, as each choice of signs has.
    paired = divisions if len(x) == len(y) or alternative != "two-sided" else 2 * divisions
    return Test(_mean(x) - _mean(y), p, min(1.0, _least(paired, alternative)), n, unit, exact, "divisions")


def paired_effect(
    differences: ArrayLike, *, correction: Correction = "none", level: float = 0.95, unit: str = "dyad"
) -> Estimate:
    """Estimate the size of a paired effect: d_z, the mean difference over the differences' standard deviation.

    Its interval is that of the noncentral t distribution (Cumming and Finch, Educ. Psychol. Meas. 61:532, 2001).

    Parameters
    ----------
    differences : array_like, shape (n,)
        One for each unit; NaN are left out [any].
    correction : {"none", "hedges"}
        As it is; or times the factor that takes its bias in small samples away (`hedges_factor`), interval and all.
    level : float
        Confidence [1].
    unit : str
        What the differences are of.

    Returns
    -------
    Estimate
        d_z, or g_z; NaN for fewer than two units, or differences that do not vary [1].
    """
    x = _finite(differences)
    name = "d_z, noncentral t" if correction == "none" else "g_z, noncentral t"
    if len(x) < 2 or not np.ptp(x) > ROUNDING * np.abs(x).max():
        return Estimate(np.nan, np.nan, np.nan, level, len(x), unit, name)
    factor = hedges_factor(len(x) - 1) if correction == "hedges" else 1.0
    return _effect(_mean(x) / float(x.std(ddof=1)), sqrt(len(x)), len(x) - 1, factor, level, len(x), unit, name)


def hedges_g(
    first: ArrayLike,
    second: ArrayLike,
    *,
    correction: Correction = "hedges",
    level: float = 0.95,
    unit: str = "dyad",
) -> Estimate:
    """Estimate the size of an effect between two groups of different units: the difference of means over the pooled SD.

    Parameters
    ----------
    first, second : array_like, shape (n,) and (m,)
        One value for each unit; NaN are left out [any].
    correction : {"none", "hedges"}
        Cohen's d; or times the factor that takes its bias in small samples away (`hedges_factor`), interval and all.
    level : float
        Confidence [1].
    unit : str
        What the values are of.

    Returns
    -------
    Estimate
        Hedges' g (or d), first less second; NaN for fewer than three units, an empty group, or values that do not vary
        [1].
    """
    x, y = _finite(first), _finite(second)
    n, free = len(x) + len(y), len(x) + len(y) - 2
    name = "d, noncentral t" if correction == "none" else "g, noncentral t"
    spread = ((x - _mean(x)) ** 2).sum() + ((y - _mean(y)) ** 2).sum()
    if free < 1 or not len(x) or not len(y) or not spread > 0.0:
        return Estimate(np.nan, np.nan, np.nan, level, n, unit, name)
    factor = hedges_factor(free) if correction == "hedges" else 1.0
    d = (_mean(x) - _mean(y)) / sqrt(spread / free)
    return _effect(d, sqrt(len(x) * len(y) / n), free, factor, level, n, unit, name)


def hedges_factor(free: int) -> float:
    """Return the factor that takes the bias of a standardised mean away (Hedges, J. Educ. Stat. 6:107, 1981).

    It is ``gamma(f / 2) / (sqrt(f / 2) gamma((f - 1) / 2))``, about ``1 - 3 / (4 f - 1)``.

    Parameters
    ----------
    free : int
        Degrees of freedom of the standard deviation, at least one [1].

    Returns
    -------
    float
        The factor, less than 1; 0 for one degree of freedom, for which d has no mean [1].
    """
    if free < 2:
        return 0.0
    return exp(lgamma(free / 2.0) - lgamma((free - 1) / 2.0) - log(free / 2.0) / 2.0)


# --- parts -------------------------------------------------------------------------------------------------------


def _finite(values: ArrayLike) -> NDArray[np.float64]:
    """Leave out what is missing."""
    x = np.asarray(values, dtype=float)
    if x.ndim != 1:
        raise ValueError(f"one value of each unit is expected, found shape {x.shape}")
    return np.asarray(x[np.isfinite(x)])


def _mean(x: NDArray[np.float64]) -> float:
    """Return the mean, which nothing has not."""
    return float(x.mean()) if len(x) else np.nan


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


def _effect(d: float, scale: float, free: int, factor: float, level: float, n: int, unit: str, name: str) -> Estimate:
    """Put the interval of the noncentral t distribution round a standardised mean."""
    low, high = (_noncentrality(d * scale, free, tail) / scale for tail in (0.5 + level / 2.0, 0.5 - level / 2.0))
    return Estimate(factor * d, factor * low, factor * high, level, n, unit, name)


def _noncentrality(t: float, free: int, below: float) -> float:
    """Find the noncentrality with which t has a given probability below it."""
    if t < 0.0:
        return -_noncentrality(-t, free, 1.0 - below)
    longest, least = stats.chi2.ppf((1.0 - 1e-12, 1.0 - below), free) / free
    if t > 1000.0:  # Only the spread of the standard deviation is left.
        return t * sqrt(least)
    # At t = 0 the probability is that of the normal distribution, and at a larger one it is larger.
    bracket = (float(stats.norm.ppf(1.0 - below)) - 0.1, t * sqrt(longest) + 8.0)
    return float(brentq(lambda shift: stats.nct.cdf(t, free, shift) - below, *bracket, xtol=1e-9))
