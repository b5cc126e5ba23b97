"""What few dyads can show: estimates with intervals, with the dyad as the unit of replication.

Trials of one dyad are not independent of each other, and neither are its partners; a study has as many values as it has
dyads. Every result therefore carries how many units it is made of, and of what kind they are. With few units the
bootstrap's intervals are too short (docs/explanation/analysis-modern.md has the numbers); those of t are the default
elsewhere. Tests are in `netboard.analysis.statistics.exact_tests`, sizes of effects in
`netboard.analysis.statistics.effect_sizes`.

Nothing here draws a random number but from the generator that it is given.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.special import stdtrit

Bootstrap = Literal["percentile", "basic", "BCa"]
Weighting = Literal["units", "samples"]

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
    x = known(values)
    if len(x) < 2:
        return Estimate(mean(x), np.nan, np.nan, level, len(x), unit, "t")
    half = float(stdtrit(len(x) - 1, 0.5 + level / 2.0) * (x.std(ddof=1) / sqrt(len(x))))
    return Estimate(mean(x), mean(x) - half, mean(x) + half, level, len(x), unit, "t")


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
    samples = [x for x in map(known, clusters) if len(x)]
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


# --- parts, of the other statistics too --------------------------------------------------------------------------


def known(values: ArrayLike) -> NDArray[np.float64]:
    """Leave out what is missing.

    Parameters
    ----------
    values : array_like, shape (n,)
        One for each unit [any].

    Returns
    -------
    ndarray of float64, shape (m,)
        The finite ones [any].

    Raises
    ------
    ValueError
        If there is not one value for each unit.
    """
    x = np.asarray(values, dtype=float)
    if x.ndim != 1:
        raise ValueError(f"one value of each unit is expected, found shape {x.shape}")
    return np.asarray(x[np.isfinite(x)])


def mean(x: NDArray[np.float64]) -> float:
    """Return the mean, which nothing has not.

    Parameters
    ----------
    x : ndarray of float64, shape (n,)
        Values [any].

    Returns
    -------
    float
        NaN of none [any].
    """
    return float(x.mean()) if len(x) else np.nan
