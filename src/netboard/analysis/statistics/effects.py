"""What models of a study say: effects and how sure they are, sources of chance, residuals.

Knows no model: `netboard.analysis.statistics.models` fits them, to the columns of
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
from netboard.analysis.statistics.factors import Cell, Design, simple_effects
from netboard.analysis.statistics.restricted import Moments
from netboard.analysis.statistics.small_samples import (
    kenward_roger_covariance,
    kenward_roger_freedom,
    satterthwaite_freedom,
)

Interval = Literal["t", "z"]

METHODS = ("Satterthwaite", "Kenward-Roger")
"""Methods for small samples."""


@dataclass(frozen=True, slots=True)
class Inference:
    """How sure an effect is, by a method for small samples.

    Attributes
    ----------
    method : str
        ``Satterthwaite`` or ``Kenward-Roger``.
    estimate, ratio : Estimate
        The coefficient [log of the response] and its exponential [1], with the method's confidence interval.
    error : float
        Standard error of the coefficient [log of the response].
    free : float
        Degrees of freedom [1].
    p : float
        p value of no effect [1].
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
        A column of the design, or an effect of `simple_effects`, such as ``haptics, dyadic``.
    estimate : Estimate
        Its coefficient; NaN where data cannot tell it [log of the response].
    ratio : Estimate
        The exponential of it: by how much the response, or the odds, are multiplied. That of the intercept is the
        response at the first trial [1].
    error : float
        Standard error of the coefficient [log of the response].
    free : float
        Degrees of freedom of the interval; infinite for z [1].
    p : float
        How probable so large a coefficient is if there is none [1].
    others : tuple of Inference
        The same effect by the methods for small samples; none of a marginal model.
    """

    name: str
    estimate: Estimate
    ratio: Estimate
    error: float
    free: float
    p: float
    others: tuple[Inference, ...] = ()

    def by(self, method: str) -> Inference:
        """Return the inference of a method.

        Parameters
        ----------
        method : str
            ``Satterthwaite`` or ``Kenward-Roger``.

        Returns
        -------
        Inference
            That one.

        Raises
        ------
        ValueError
            If the model has none of it.
        """
        found = {one.method: one for one in self.others}
        if method not in found:
            raise ValueError(f"{self.name}: no inference by {method!r}, expected one of {', '.join(found) or 'none'}")
        return found[method]


@dataclass(frozen=True, slots=True)
class Component:
    """How much one source of chance contributes.

    Attributes
    ----------
    name : str
        The source.
    variance : float
        Its variance [square of the log of the response].
    deviation : float
        Its square root [log of the response].
    levels : int
        How many values of it there are [1].
    """

    name: str
    variance: float
    deviation: float
    levels: int


@dataclass(frozen=True, slots=True, eq=False)
class Diagnostics:
    """What residuals say of a model's assumptions.

    There is no test of normality: of thousands of trials it rejects every model, of a few dyads none.

    Attributes
    ----------
    quantiles : ndarray of float64, shape (n,)
        Of the normal distribution, where the residuals should be [residual SD].
    residuals : ndarray of float64, shape (n,)
        What neither fixed nor random effects explain, in order of size [residual SD].
    skewness, kurtosis : float
        Of the residuals; 0 of normal ones, both [1].
    spread : float
        Rank correlation of the residuals' magnitude with the fitted value; 0 for equal variances [1].
    successive : float
        Correlation of residuals of successive trials of a performer in a condition; 0 for independent trials, NaN
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
    """A model of a study, fitted or not.

    Attributes
    ----------
    name, equation : str
        What it is.
    fitted : bool
        There are estimates; otherwise the notes say why not, and every number of the model is NaN.
    converged : bool
        The fit ended where it should.
    effects : tuple of Effect
        One for each column of the model, then those of `simple_effects`.
    components : tuple of Component
        Sources of chance, the residual last; none of a marginal model.
    cells : tuple of Cell
        What was observed, whatever became of the fit.
    dispersion : float
        Pearson's chi-square over its degrees of freedom, with the variance of a Poisson distribution; NaN of other
        models [1].
    alpha : float
        Variance beyond the mean over the square of the mean, if the model has it, otherwise NaN [1].
    correlation : float
        That of two trials of a dyad, as estimated for the weights of a marginal model; NaN of other models [1].
    trials, performers, dyads : int
        How many there are; the dyad is the unit [1].
    left_out : int
        Trials without a value [1].
    assumptions : tuple of str
        What must hold, as sentences.
    notes : tuple of str
        What went wrong or was left out, with the warnings of statsmodels.
    diagnostics : Diagnostics or None
        Residuals, if the model has any of one scale.
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

    def effect(self, name: str) -> Effect:
        """Return the effect of a name.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        Effect
            That one.

        Raises
        ------
        ValueError
            If there is none of that name.
        """
        found = {effect.name: effect for effect in self.effects}
        if name not in found:
            raise ValueError(f"no effect {name!r}, expected one of {', '.join(found)}")
        return found[name]


def effects_of(
    design: Design,
    coefficients: NDArray[np.float64],
    covariance: NDArray[np.float64],
    *,
    level: float,
    interval: Interval,
    moments: Moments | None = None,
) -> tuple[Effect, ...]:
    """Turn coefficients into effects, those of a factor at each level of another with them.

    Parameters
    ----------
    design : Design
        Its names are those of the coefficients.
    coefficients : ndarray of float64, shape (k,)
        One for each name [log of the response].
    covariance : ndarray of float64, shape (k, k)
        Their covariance; NaN without one [square of the log of the response].
    level : float
        Confidence [1].
    interval : {"t", "z"}
        Student's with `careful_freedom`; or the normal one.
    moments : Moments or None
        Of a mixed model: Satterthwaite's and Kenward and Roger's inference is added.

    Returns
    -------
    tuple of Effect
        One for each column asked for, then those of `simple_effects`; NaN where data cannot tell.
    """
    free = careful_freedom(design) if interval == "t" else inf
    found = []
    enlarged = None if moments is None else kenward_roger_covariance(moments)
    for name, row in contrasts_of(design).items():
        value = nan if row is None else float(row @ coefficients)
        others = []
        if row is not None and moments is not None and enlarged is not None:
            degrees = satterthwaite_freedom(moments, row), kenward_roger_freedom(moments, row)
            for method, size, own in zip(METHODS, (covariance, enlarged), degrees, strict=True):
                others.append(Inference(method, *_sure(value, _error(row, size), own, level, design.n_dyads, method)))
        sure = _sure(value, _error(row, covariance), free, level, design.n_dyads)
        found.append(Effect(name, *sure, tuple(others)))
    return tuple(found)


def _error(row: NDArray[np.float64] | None, covariance: NDArray[np.float64]) -> float:
    """Return the standard error of a combination of coefficients."""
    variance = nan if row is None else float(row @ covariance @ row)
    return sqrt(variance) if variance >= 0.0 else nan


def careful_freedom(design: Design) -> float:
    """Return the degrees of freedom between dyads: dyads less one, and less the effects that vary between dyads only.

    Parameters
    ----------
    design : Design
        The trials.

    Returns
    -------
    float
        Degrees of freedom; 0 if there are too few dyads [1].
    """
    return max(0.0, design.n_dyads - 1.0 - design.between)


def contrasts_of(design: Design) -> dict[str, NDArray[np.float64] | None]:
    """Return how much each effect has of each coefficient.

    Parameters
    ----------
    design : Design
        The trials.

    Returns
    -------
    dict of str to ndarray of float64, shape (k,), or None
        By name of the effect; None where these trials cannot tell a coefficient that it needs [1].
    """
    place = {name: i for i, name in enumerate(design.names)}
    wanted = {name: {name: 1.0} for name in design.asked} | simple_effects(design)
    rows: dict[str, NDArray[np.float64] | None] = {}
    for name, shares in wanted.items():
        row = np.zeros(len(place))
        known = all(column in place for column in shares)
        for column, share in shares.items() if known else ():
            row[place[column]] = share
        rows[name] = row if known else None
    return rows


def _sure(
    value: float, error: float, free: float, level: float, n: int, method: str = ""
) -> tuple[Estimate, Estimate, float, float, float]:
    """Return coefficient, ratio, error, degrees of freedom and p."""
    digits = 1 if method else 0
    name = "z" if free == inf else f"t, {free:.{digits}f} df"
    p = half = nan
    if free > 0.0 and error > 0.0:
        half = float(stats.t.ppf(0.5 + level / 2.0, free)) * error
        p = float(2.0 * stats.t.sf(abs(value) / error, free))
    said = f"{name} ({method})" if method else name
    estimate, ratio = _estimates((value, value - half, value + half), level, n, said)
    return estimate, ratio, error, free, p


def _estimates(ends: tuple[float, float, float], level: float, n: int, method: str) -> tuple[Estimate, Estimate]:
    """Return value, low and high as they are, and their exponentials."""
    value, low, high = ends
    ratio = Estimate(_exp(value), _exp(low), _exp(high), level, n, "dyad", method)
    return Estimate(value, low, high, level, n, "dyad", method), ratio


def interval_effect(
    name: str, ends: tuple[float, float, float], error: float, free: float, p: float, level: float, n: int, method: str
) -> Effect:
    """Make an effect of an interval that is not symmetric.

    Parameters
    ----------
    name : str
        Its name.
    ends : tuple of float
        The coefficient, and the low and the high end of its interval [log of the response].
    error : float
        Standard error [log of the response].
    free : float
        Degrees of freedom [1].
    p : float
        p value of no effect [1].
    level : float
        Confidence [1].
    n : int
        Dyads [1].
    method : str
        What the interval is.

    Returns
    -------
    Effect
        With its ratio.
    """
    return Effect(name, *_estimates(ends, level, n, method), error, free, p)


def _exp(x: float) -> float:
    """Return the exponential, infinite where no number is large enough."""
    return float(np.exp(x)) if x < 700.0 else (x if np.isnan(x) else inf)


def diagnose(design: Design, residuals: NDArray[np.float64], fitted: NDArray[np.float64]) -> Diagnostics:
    """Look at the residuals of a model.

    Parameters
    ----------
    design : Design
        The trials.
    residuals, fitted : ndarray of float64, shape (n,)
        What is not explained, and what is [log of the response].

    Returns
    -------
    Diagnostics
        Quantiles after Blom: of the i-th of n residuals, that at (i - 3/8) / (n + 1/4).
    """
    scaled = residuals / residuals.std()
    n = len(scaled)
    varied = np.ptp(fitted) > 1e-9 * max(1.0, float(np.abs(fitted).max()))
    return Diagnostics(
        stats.norm.ppf((np.arange(1, n + 1) - 0.375) / (n + 0.25)),
        np.sort(scaled),
        float(stats.skew(scaled)),
        float(stats.kurtosis(scaled)),
        float(stats.spearmanr(np.abs(scaled), fitted).statistic) if varied else nan,
        _successive(design, scaled),
    )


def _successive(design: Design, residuals: NDArray[np.float64]) -> float:
    """Correlate residuals of trials k and k + 1 of one performer in one condition."""
    keys = np.column_stack([design.performers, design.conditions, design.order])
    by = np.lexsort(keys.T[::-1])
    keys, residuals = keys[by], residuals[by]
    next_to = (np.diff(keys[:, :2], axis=0) == 0.0).all(axis=1) & (np.diff(keys[:, 2]) == 1.0)
    if next_to.sum() < 3:
        return nan
    return float(np.corrcoef(residuals[:-1][next_to], residuals[1:][next_to])[0, 1])


def said(sentences: Sequence[str]) -> tuple[str, ...]:
    """Say everything once, in the order in which it was said first.

    Parameters
    ----------
    sentences : sequence of str
        Notes.

    Returns
    -------
    tuple of str
        Those notes.
    """
    return tuple(dict.fromkeys(sentences))
