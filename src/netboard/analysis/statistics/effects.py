"""Results of a model: fixed effects with their uncertainty, variance components, residual diagnostics.

This module fits nothing: `netboard.analysis.statistics.models` fits the models, to the columns of
`netboard.analysis.statistics.factors`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from netboard.analysis.statistics.estimates import Estimate
from netboard.analysis.statistics.factors import Cell, ModelDesign, simple_effects
from netboard.analysis.statistics.restricted import Moments
from netboard.analysis.statistics.small_samples import (
    kenward_roger_covariance,
    kenward_roger_freedom,
    satterthwaite_freedom,
)

Interval = Literal["t", "z"]

METHODS = ("Satterthwaite", "Kenward-Roger")
"""Small-sample inference methods."""

NOT_CONVERGED = "the fit did not converge"
"""Caution for the estimates and p values of such a fit."""


@dataclass(frozen=True, slots=True)
class Inference:
    """Inference on an effect by a small-sample method.

    Attributes
    ----------
    method : str
        ``Satterthwaite`` or ``Kenward-Roger``.
    estimate, ratio : Estimate
        Coefficient [log of the response] and its exponential [1], with the method's confidence interval.
    error : float
        Standard error of the coefficient [log of the response].
    free : float
        Degrees of freedom [1].
    p : float
        p value of the null hypothesis of no effect [1].
    """

    method: str
    estimate: Estimate
    ratio: Estimate
    error: float
    free: float
    p: float


@dataclass(frozen=True, slots=True)
class Effect:
    """One fixed effect of a model.

    Attributes
    ----------
    name : str
        Column of the design, or an effect of `simple_effects`, such as ``haptics, dyadic``.
    estimate : Estimate
        Coefficient; NaN if it cannot be estimated [log of the response].
    ratio : Estimate
        Exponential of the coefficient: the factor by which the response, or the odds, are multiplied. For the intercept
        it is the response at the first trial [1].
    error : float
        Standard error of the coefficient [log of the response].
    free : float
        Degrees of freedom of the confidence interval; infinite for z [1].
    p : float
        p value: probability of a coefficient at least as large under the null hypothesis [1].
    others : tuple of Inference
        The same effect by the small-sample methods; empty for a marginal model.
    """

    name: str
    estimate: Estimate
    ratio: Estimate
    error: float
    free: float
    p: float
    others: tuple[Inference, ...] = ()

    def by(self, method: str) -> Inference:
        """Return the inference by a small-sample method.

        Parameters
        ----------
        method : str
            ``Satterthwaite`` or ``Kenward-Roger``.
        """
        found = {one.method: one for one in self.others}
        if method not in found:
            raise ValueError(f"{self.name}: no inference by {method!r}, expected one of {', '.join(found) or 'none'}")
        return found[method]


@dataclass(frozen=True, slots=True)
class Component:
    """Variance component of one random effect.

    Attributes
    ----------
    name : str
        The random effect, or ``residual``.
    variance : float
        Estimate, 0 or more [square of the log of the response].
    deviation : float
        Square root of the variance [log of the response].
    levels : int
        Number of levels of the random effect [1].
    """

    name: str
    variance: float
    deviation: float
    levels: int


@dataclass(frozen=True, slots=True, eq=False)
class Diagnostics:
    """Residual diagnostics of a model's assumptions.

    A normality test is left out on purpose: with thousands of trials it rejects every model, with a few dyads none.

    Attributes
    ----------
    quantiles : ndarray of float64, shape (n,)
        Quantiles of the normal distribution for a Q-Q plot [residual SD].
    residuals : ndarray of float64, shape (n,)
        Residuals after fixed and random effects, sorted [residual SD].
    skewness, kurtosis : float
        Skewness and excess kurtosis of the residuals; both 0 for a normal distribution [1].
    spread : float
        Rank correlation of the absolute residual with the fitted value; 0 for equal variances [1].
    successive : float
        Correlation of the residuals of successive trials of a performer in a condition; 0 for independent trials, NaN
        without successive ones [1].
    """

    quantiles: NDArray[np.float64]
    residuals: NDArray[np.float64]
    skewness: float
    kurtosis: float
    spread: float
    successive: float


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Result of a model of a study, fitted or not.

    Attributes
    ----------
    name, equation : str
        Kind of model and method of fit, and the equation.
    fitted : bool
        Whether there are estimates; otherwise the notes say why not, and every number of the model is NaN.
    converged : bool
        Whether the fit converged.
    effects : tuple of Effect
        Effect of each column of the model, then those of `simple_effects`.
    components : tuple of Component
        Variance components of the random effects, the residual last; empty for a marginal model.
    cells : tuple of Cell
        Observed conditions, whether or not the fit succeeded.
    dispersion : float
        Pearson's chi-square over its degrees of freedom, with the variance of a Poisson distribution; NaN for other
        models [1].
    alpha : float
        Over-dispersion: variance beyond the mean, divided by the squared mean; NaN if the model has none [1].
    correlation : float
        Working correlation of two trials of a dyad in a marginal model; NaN for other models [1].
    trials, performers, dyads : int
        Numbers of trials, performers and dyads; the dyad is the unit of replication [1].
    left_out : int
        Number of trials without a value [1].
    assumptions : tuple of str
        Assumptions of the model, as sentences.
    notes : tuple of str
        Problems and omissions, including the warnings of statsmodels.
    diagnostics : Diagnostics or None
        Residual diagnostics, if the model's residuals share one scale.
    """

    name: str
    equation: str
    fitted: bool
    converged: bool
    effects: tuple[Effect, ...]
    components: tuple[Component, ...]
    cells: tuple[Cell, ...]
    dispersion: float
    alpha: float
    correlation: float
    trials: int
    performers: int
    dyads: int
    left_out: int
    assumptions: tuple[str, ...]
    notes: tuple[str, ...]
    diagnostics: Diagnostics | None

    @property
    def caution(self) -> str:
        """Caution that belongs beside every p of the model; empty for none."""
        return NOT_CONVERGED if self.fitted and not self.converged else ""

    def effect(self, name: str) -> Effect:
        """Return the effect with a name."""
        found = {effect.name: effect for effect in self.effects}
        if name not in found:
            raise ValueError(f"no effect {name!r}, expected one of {', '.join(found)}")
        return found[name]


def effects_of(
    design: ModelDesign,
    coefficients: NDArray[np.float64],
    covariance: NDArray[np.float64],
    *,
    level: float,
    interval: Interval,
    moments: Moments | None = None,
) -> tuple[Effect, ...]:
    """Return the effect of each requested column, then those of `simple_effects`; NaN if not estimable.

    The moments of a mixed model add Satterthwaite's and Kenward and Roger's inference.
    """
    free = between_dyad_freedom(design) if interval == "t" else inf
    effects = []
    enlarged = None if moments is None else kenward_roger_covariance(moments)
    for name, row in contrasts_of(design).items():
        value = nan if row is None else float(row @ coefficients)
        others = []
        if row is not None and moments is not None and enlarged is not None:
            degrees = satterthwaite_freedom(moments, row), kenward_roger_freedom(moments, row)
            for method, size, df in zip(METHODS, (covariance, enlarged), degrees, strict=True):
                inference = _inference(value, _error(row, size), df, level, design.n_dyads, method)
                others.append(Inference(method, *inference))
        inference = _inference(value, _error(row, covariance), free, level, design.n_dyads)
        effects.append(Effect(name, *inference, tuple(others)))
    return tuple(effects)


def _error(row: NDArray[np.float64] | None, covariance: NDArray[np.float64]) -> float:
    """Return the standard error of a combination of coefficients."""
    variance = nan if row is None else float(row @ covariance @ row)
    return sqrt(variance) if variance >= 0.0 else nan


def between_dyad_freedom(design: ModelDesign) -> float:
    """Return the dyads minus 1, minus the effects that vary only between dyads; 0 for too few dyads [1]."""
    return max(0.0, design.n_dyads - 1.0 - design.between)


def contrasts_of(design: ModelDesign) -> dict[str, NDArray[np.float64] | None]:
    """Return the contrast vector of each effect by name; None if a needed coefficient is not estimable [1]."""
    place = {name: i for i, name in enumerate(design.names)}
    weights = {name: {name: 1.0} for name in design.requested} | simple_effects(design)
    rows: dict[str, NDArray[np.float64] | None] = {}
    for name, weight_of in weights.items():
        row = np.zeros(len(place))
        estimable = all(column in place for column in weight_of)
        for column, weight in weight_of.items() if estimable else ():
            row[place[column]] = weight
        rows[name] = row if estimable else None
    return rows


def _inference(
    value: float, error: float, free: float, level: float, n: int, method: str = ""
) -> tuple[Estimate, Estimate, float, float, float]:
    """Return coefficient, ratio, error, degrees of freedom and p."""
    digits = 1 if method else 0  # only the small-sample methods have fractions of a degree of freedom
    name = "z" if free == inf else f"t, {free:.{digits}f} df"
    p = half = nan
    if free > 0.0 and error > 0.0:
        half = float(stats.t.ppf(0.5 + level / 2.0, free)) * error
        p = float(2.0 * stats.t.sf(abs(value) / error, free))
    if method:
        name = f"{name} ({method})"
    estimate, ratio = _estimates((value, value - half, value + half), level, n, name)
    return estimate, ratio, error, free, p


def _estimates(ends: tuple[float, float, float], level: float, n: int, method: str) -> tuple[Estimate, Estimate]:
    """Return value, low and high on the coefficient's scale, and their exponentials."""
    value, low, high = ends
    ratio = Estimate(_exp(value), _exp(low), _exp(high), level, n, "dyad", method)
    return Estimate(value, low, high, level, n, "dyad", method), ratio


def interval_effect(
    name: str, ends: tuple[float, float, float], error: float, free: float, p: float, level: float, n: int, method: str
) -> Effect:
    """Return an effect with an asymmetric confidence interval, and its ratio.

    Parameters
    ----------
    ends : tuple of float
        Coefficient, and lower and upper limit of its confidence interval [log of the response].
    method : str
        Method of the confidence interval.
    """
    return Effect(name, *_estimates(ends, level, n, method), error, free, p)


def _exp(x: float) -> float:
    """Return the exponential, infinite on overflow."""
    return float(np.exp(x)) if x < 700.0 else (x if np.isnan(x) else inf)


def diagnose(design: ModelDesign, residuals: NDArray[np.float64], fitted: NDArray[np.float64]) -> Diagnostics:
    """Return the residual diagnostics of a model.

    Blom's quantiles: for the i-th of n residuals, that at (i - 3/8) / (n + 1/4).

    Parameters
    ----------
    residuals, fitted : ndarray of float64, shape (n,)
        Residuals, on any one scale, and fitted values, in the order of the design's trials [log of the response].
    """
    scaled = residuals / residuals.std()
    n = len(scaled)
    varied = np.ptp(fitted) > 1e-9 * max(1.0, float(np.abs(fitted).max()))
    return Diagnostics(
        quantiles=stats.norm.ppf((np.arange(1, n + 1) - 0.375) / (n + 0.25)),
        residuals=np.sort(scaled),
        skewness=float(stats.skew(scaled)),
        kurtosis=float(stats.kurtosis(scaled)),
        spread=float(stats.spearmanr(np.abs(scaled), fitted).statistic) if varied else nan,
        successive=_successive(design, scaled),
    )


def _successive(design: ModelDesign, residuals: NDArray[np.float64]) -> float:
    """Correlate the residuals of trials k and k + 1 of each performer in each condition."""
    keys = np.column_stack([design.performers, design.conditions, design.order])
    by = np.lexsort(keys.T[::-1])
    keys, residuals = keys[by], residuals[by]
    next_to = (np.diff(keys[:, :2], axis=0) == 0.0).all(axis=1) & (np.diff(keys[:, 2]) == 1.0)
    if next_to.sum() < 3:
        return nan
    return float(np.corrcoef(residuals[:-1][next_to], residuals[1:][next_to])[0, 1])


def unique(notes: Sequence[str]) -> tuple[str, ...]:
    """Remove duplicate notes, keeping the order of first occurrence."""
    return tuple(dict.fromkeys(notes))
