"""Estimates with confidence intervals, with the dyad as the unit of replication.

Trials of one dyad are not independent, nor are its partners: a study has as many independent values as dyads. Every
result therefore carries the number and the kind of its units. With few units bootstrap confidence intervals are too
short (docs/explanation/analysis-modern.md has the numbers), so t intervals are the default elsewhere. The interval of a
mean stays in the range of its quantity, which is declared (`Range`). Tests are in
`netboard.analysis.statistics.exact_tests`, effect sizes in `netboard.analysis.statistics.effect_sizes`.

All random numbers come from the generator that the caller passes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import atanh, exp, inf, sqrt, tanh
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.special import stdtrit

Bootstrap = Literal["percentile", "basic", "BCa"]
Weighting = Literal["units", "samples"]

Range = Literal["real", "positive", "share", "balance"]
"""Range of a quantity: any real number; 0 or more; from 0 to 1; from -1 to 1."""

ROUNDING = 1e-12
"""Relative difference up to which values are equal but for rounding [1]."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimate with its confidence interval.

    Attributes
    ----------
    value : float
        Point estimate; NaN if there is none [its own].
    low, high : float
        Limits of the confidence interval; NaN for too few units [its own].
    level : float
        Confidence level [1].
    n : int
        Number of units of replication [1].
    unit : str
        Name of that unit, such as ``dyad``.
    method : str
        Method of the confidence interval.
    """

    value: float
    low: float
    high: float
    level: float
    n: int
    unit: str
    method: str


def t_interval(values: ArrayLike, *, level: float = 0.95, unit: str = "dyad") -> Estimate:
    """Estimate a mean with Student's t interval, which is missing for fewer than two units."""
    x = known(values)
    if len(x) < 2:
        return Estimate(mean(x), np.nan, np.nan, level, len(x), unit, "t")
    half = float(stdtrit(len(x) - 1, 0.5 + level / 2.0) * (x.std(ddof=1) / sqrt(len(x))))
    return Estimate(mean(x), mean(x) - half, mean(x) + half, level, len(x), unit, "t")


def mean_interval(
    values: ArrayLike, within: Range, *, level: float = 0.95, unit: str = "dyad", events: float = inf
) -> Estimate:
    """Estimate a mean with a confidence interval that stays in the range of the quantity.

    The estimate is the mean m of the units; s is its standard error, t the quantile with n - 1 degrees of freedom.

    - real: ``m +- t s``.
    - positive: on the log scale by the delta method, ``m exp(+- t s / m)``.
    - balance: on the scale of Fisher's z by the delta method, ``tanh(atanh(m) +- t s / (1 - m^2))``.
    - share: Wilson's interval with t instead of z and the effective sample size ``m (1 - m) / s^2``, in which the units
      are clusters (Korn and Graubard, Surv. Methodol. 24:193, 1998).

    There is no interval for fewer than two units. If the mean is at the end of its range, all units are: the interval
    is a point, except for a share of events.

    Parameters
    ----------
    within : Range
        Range of the quantity, one of those above.
    events : float
        Number of events or non-events of which a share is made, which limits its effective sample size; infinite for a
        share of time [1].
    """
    x = known(values)
    plain = t_interval(x, level=level, unit=unit)
    ends = plain.low, plain.high
    if len(x) > 1 and within != "real":
        m = _inside(plain.value, within)
        t = float(stdtrit(len(x) - 1, 0.5 + level / 2.0))
        ends = _ends(m, (plain.high - plain.low) / (2.0 * t), t, within, events)
    return replace(plain, low=ends[0], high=ends[1], method=METHODS[within])


METHODS: dict[Range, str] = {
    "real": "t",
    "positive": "t on the log scale",
    "balance": "t on the scale of Fisher's z",
    "share": "Wilson",
}
"""Method of the confidence interval of a mean, by the range of the quantity."""


def _inside(m: float, within: Range) -> float:
    """Return a mean, exactly at the end of its range if only rounding separates them."""
    low, high = {"real": (-inf, inf), "positive": (0.0, inf), "share": (0.0, 1.0), "balance": (-1.0, 1.0)}[within]
    inside = min(max(m, low), high)
    if abs(m - inside) > ROUNDING:
        raise ValueError(f"values: a mean from {low:g} to {high:g} is expected, found {m}")
    return inside


def _ends(m: float, error: float, t: float, within: Range, events: float) -> tuple[float, float]:
    """Return the limits of the interval of a mean with a standard error."""
    if within == "share":
        return wilson_interval(m, min(m * (1.0 - m) / error**2 if error > 0.0 else inf, events), t)
    if m == 0.0 if within == "positive" else abs(m) == 1.0:
        return m, m
    if within == "positive":
        factor = exp(min(t * error / m, 700.0))
        return m / factor, m * factor
    z, reach = atanh(m), t * error / (1.0 - m * m)
    return tanh(z - reach), tanh(z + reach)


def wilson_interval(share: float, size: float, quantile: float) -> tuple[float, float]:
    """Return the limits of Wilson's interval (J. Am. Stat. Assoc. 22:209, 1927) of a share [1].

    Parameters
    ----------
    share : float
        Estimated share, from 0 to 1 [1].
    size : float
        Sample size, effective if the sample is clustered; infinite: the interval is a point [1].
    quantile : float
        Quantile of the normal or the t distribution [1].
    """
    square = quantile**2 / size
    middle = (share + square / 2.0) / (1.0 + square)
    half = sqrt(square * share * (1.0 - share) + square**2 / 4.0) / (1.0 + square)
    return max(middle - half, 0.0), min(middle + half, 1.0)


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
    """Estimate the mean of clustered samples, such as trials of dyads, by resampling clusters.

    There is no confidence interval for fewer than two units.

    Parameters
    ----------
    clusters : sequence of array_like, shape (n_k,)
        Samples of each unit; NaN and empty units are ignored [any].
    weighting : {"units", "samples"}
        Mean of the units' means, or mean of all samples, which gives units with more samples more weight.
    """
    samples = [x for x in map(known, clusters) if len(x)]
    sums, counts = np.array([x.sum() for x in samples]), np.array([float(len(x)) for x in samples])
    if weighting == "units":
        sums, counts = sums / np.maximum(counts, 1.0), np.ones(len(samples))
    return bootstrap((sums, counts), ratio_of_sums, rng, level=level, method=method, resamples=resamples, unit=unit)


def ratio_of_sums(above: NDArray[np.float64], below: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
    """Return the ratio of two sums over units, shape (...), for `bootstrap`; NaN for a divisor of 0 [1].

    It is a weighted mean, or the share of an effect.

    Parameters
    ----------
    above, below : ndarray of float64, shape (..., n)
        Values of the units [any].
    axis : int
        Axis of the units [1].
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
    """Estimate any statistic by resampling whole units with replacement (`scipy.stats.bootstrap`).

    There is no confidence interval for fewer than two units, or if the statistic of a resample is undefined. If every
    single unit gives the same statistic, the interval is a point.

    Parameters
    ----------
    columns : sequence of array_like, shape (n,)
        One or more values of each unit [any].
    statistic : callable
        Function of the columns, shape (..., n), and `axis`; returns shape (...) [any].
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


# --- arrays of values, also for the other modules -------------------------------------------------------------


def known(values: ArrayLike) -> NDArray[np.float64]:
    """Return the finite values [any]."""
    x = np.asarray(values, dtype=float)
    if x.ndim != 1:
        raise ValueError(f"one value of each unit is expected, found shape {x.shape}")
    return np.asarray(x[np.isfinite(x)])


def mean(values: NDArray[np.float64]) -> float:
    """Return the mean, NaN for an empty array [any]."""
    return float(values.mean()) if len(values) else np.nan


def difference(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the differences, exactly 0 where two values are equal but for rounding: a tie [any]."""
    gaps = first - second
    return np.where(np.abs(gaps) <= ROUNDING * np.maximum(np.abs(first), np.abs(second)), 0.0, gaps)


def constant(values: NDArray[np.float64]) -> bool:
    """Return whether one or more values differ by no more than rounding."""
    return not np.ptp(values) > ROUNDING * np.abs(values).max()
