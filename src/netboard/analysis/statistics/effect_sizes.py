"""Standardised effect sizes, with the dyad as the unit of replication.

Confidence intervals are those of d, by the noncentral t distribution. `correction` selects Hedges' small-sample
correction, which removes the bias of the estimate. It is no factor of the interval: the limits of d have the nominal
coverage of the true effect, and multiplied by the correction they would be too short and too near 0.
"""

from collections.abc import Sequence
from math import exp, isfinite, lgamma, log, nan, sqrt
from typing import Literal

from numpy.typing import ArrayLike
from scipy import stats
from scipy.optimize import brentq

from netboard.analysis.statistics.estimates import Estimate, constant, known, mean

Correction = Literal["none", "hedges"]


def paired_effect(
    differences: ArrayLike, *, correction: Correction = "none", level: float = 0.95, unit: str = "dyad"
) -> Estimate:
    """Estimate the effect size d_z: the mean paired difference over the standard deviation of the differences [1].

    The confidence interval uses the noncentral t distribution (Cumming and Finch, Educ. Psychol. Meas. 61:532, 2001).
    NaN for fewer than two units (g_z: three) or constant differences.
    """
    x = known(differences)
    name = "d_z, noncentral t" if correction == "none" else "g_z, noncentral t"
    if len(x) < 2 or constant(x):
        return Estimate(nan, nan, nan, level, len(x), unit, name)
    factor = hedges_factor(len(x) - 1) if correction == "hedges" else 1.0
    return _effect(mean(x) / float(x.std(ddof=1)), sqrt(len(x)), len(x) - 1, factor, level, len(x), unit, name)


def hedges_g(
    first: ArrayLike,
    second: ArrayLike,
    *,
    correction: Correction = "hedges",
    level: float = 0.95,
    unit: str = "dyad",
) -> Estimate:
    """Estimate the effect size between two groups of different units: the mean difference over the pooled SD [1].

    First minus second; NaN for fewer than four units (d: three), an empty group or constant values.
    """
    x, y = known(first), known(second)
    n, free = len(x) + len(y), len(x) + len(y) - 2
    name = "d, noncentral t" if correction == "none" else "g, noncentral t"
    spread = ((x - mean(x)) ** 2).sum() + ((y - mean(y)) ** 2).sum()
    if free < 1 or not len(x) or not len(y) or not spread > 0.0:
        return Estimate(nan, nan, nan, level, n, unit, name)
    factor = hedges_factor(free) if correction == "hedges" else 1.0
    d = (mean(x) - mean(y)) / sqrt(spread / free)
    return _effect(d, sqrt(len(x) * len(y) / n), free, factor, level, n, unit, name)


def contrast_effect(
    groups: Sequence[ArrayLike],
    weights: Sequence[float],
    *,
    correction: Correction = "hedges",
    level: float = 0.95,
    unit: str = "dyad",
) -> Estimate:
    """Estimate the effect size of a contrast of group means: the contrast over the pooled SD of the values [1].

    Of one group it is `paired_effect`, of the difference of two groups `hedges_g`. NaN for an empty group, constant
    values, or less than two degrees of freedom (without the correction: one).

    Parameters
    ----------
    groups : sequence of array_like, shape (n_k,)
        Values of the units of each group; NaN are ignored [any].
    weights : sequence of float
        Weight of the mean of each group [1].
    """
    values = [known(group) for group in groups]
    n, free = sum(map(len, values)), sum(map(len, values)) - len(values)
    name = f"{'g' if correction == 'hedges' else 'd'}{'_z' if len(values) == 1 else ''}, noncentral t"
    if free < 1 or not all(map(len, values)) or all(map(constant, values)):
        return Estimate(nan, nan, nan, level, n, unit, name)
    factor = hedges_factor(free) if correction == "hedges" else 1.0
    spread = sqrt(sum(float(((x - x.mean()) ** 2).sum()) for x in values) / free)
    d = sum(w * mean(x) for w, x in zip(weights, values, strict=True)) / spread
    scale = 1.0 / sqrt(sum(w * w / len(x) for w, x in zip(weights, values, strict=True)))
    return _effect(d, scale, free, factor, level, n, unit, name)


def hedges_factor(free: int) -> float:
    """Return the small-sample bias correction of a standardised mean (Hedges, J. Educ. Stat. 6:107, 1981) [1].

    It is ``gamma(f / 2) / (sqrt(f / 2) gamma((f - 1) / 2))``, about ``1 - 3 / (4 f - 1)``; NaN for one degree of
    freedom, for which d has no mean.
    """
    if free < 2:
        return nan
    return exp(lgamma(free / 2.0) - lgamma((free - 1) / 2.0) - log(free / 2.0) / 2.0)


def _effect(d: float, scale: float, free: int, factor: float, level: float, n: int, unit: str, name: str) -> Estimate:
    """Return a standardised mean, times the correction, with the noncentral t confidence interval of the true one."""
    if not isfinite(factor):
        return Estimate(nan, nan, nan, level, n, unit, name)
    low, high = (_noncentrality(d * scale, free, tail) / scale for tail in (0.5 + level / 2.0, 0.5 - level / 2.0))
    return Estimate(factor * d, low, high, level, n, unit, name)


def _noncentrality(t: float, free: int, below: float) -> float:
    """Find the noncentrality parameter for which t has a given cumulative probability."""
    if t < 0.0:
        return -_noncentrality(-t, free, 1.0 - below)
    # Quantiles of the squared ratio of the sample standard deviation to the true one: t = (z + shift) / sqrt(ratio).
    longest, least = stats.chi2.ppf((1.0 - 1e-12, 1.0 - below), free) / free
    if t > 1000.0:  # only the sampling variance of the standard deviation matters
        return t * sqrt(least)
    # At t = 0 the noncentrality is the normal quantile; at larger t it is larger.
    bracket = (float(stats.norm.ppf(1.0 - below)) - 0.1, t * sqrt(longest) + 8.0)
    return float(brentq(lambda shift: stats.nct.cdf(t, free, shift) - below, *bracket, xtol=1e-9))
