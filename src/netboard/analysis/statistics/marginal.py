"""Marginal models of counts and failures: estimating equations (GEE), and Firth's likelihood as the fallback.

The models take the dyad as the cluster: errors come from the variation between dyads. Firth's likelihood replaces the
GEE where a condition has no events or only events, because the GEE has no finite estimate there.
"""

from dataclasses import replace
from itertools import combinations
from math import inf, nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from statsmodels.genmod import families
from statsmodels.genmod.cov_struct import Exchangeable
from statsmodels.genmod.generalized_estimating_equations import GEE

from netboard.analysis.statistics.effects import (
    Effect,
    Model,
    between_dyad_freedom,
    contrasts_of,
    interval_effect,
    unique,
)
from netboard.analysis.statistics.factors import ModelDesign, cells_of
from netboard.analysis.statistics.firth import Family, Penalised, firth_fit, profile_interval
from netboard.analysis.statistics.specification import Specification, with_notes

_PENALISED = (
    "Trials are independent given dyad and condition, except for a dispersion that is common to all effects.",
    "Effects multiply the {what}; practice is a power law with one exponent for all conditions and performers.",
)


def marginal_model(fit: Specification, design: ModelDesign, family: Any) -> Model:
    """Fit generalised estimating equations, with the empirical covariance between dyads."""
    if design.n_dyads < 2:
        return fit.fit_single_dyad(design, family)
    model = GEE(design.values, design.columns, groups=design.dyads, family=family, cov_struct=Exchangeable())
    result, notes = with_notes(lambda: model.fit(cov_type="bias_reduced", maxiter=200))
    if result is None:
        return replace(fit.unfitted(design, notes[-1]), notes=unique((*design.notes, *notes)))
    k = len(design.names)
    if design.n_dyads <= k:
        notes += (
            f"{design.n_dyads} dyads for {k} effects: there is an interval for each effect, but no joint test of all",
        )
    counted = not isinstance(family, families.Binomial)
    covariance = np.asarray(result.cov_params())
    if design.single_dyad:
        # The correction divides by 1 minus the leverage of a dyad, which is 1 here.
        covariance = np.full((k, k), np.nan)
        notes += ("no intervals: an effect rests on one dyad alone, so its error between dyads is unknown",)
    return fit.model(
        design,
        np.asarray(result.params),
        covariance,
        converged=bool(result.converged),
        notes=notes,
        dispersion=_dispersion(design, np.asarray(result.params)) if counted else nan,
        correlation=float(result.cov_struct.dep_params),
    )


def _dispersion(design: ModelDesign, coefficients: NDArray[np.float64]) -> float:
    """Return Pearson's chi-square over its degrees of freedom; 1 for Poisson counts."""
    mean = np.exp(design.columns @ coefficients)
    n, k = design.columns.shape
    return float(((design.values - mean) ** 2 / mean).sum() / (n - k))


def over_dispersed_model(fit: Specification, design: ModelDesign, poisson: Model) -> Model:
    """Fit again with the first fit's over-dispersion, its variance beyond the mean; the Poisson fit if there is none.

    Parameters
    ----------
    poisson : Model
        The first fit, whose residuals give the over-dispersion.
    """
    coefficients = np.array([poisson.effect(name).estimate.value for name in design.names])
    mean = np.exp(design.columns @ coefficients)
    alpha = float(((design.values - mean) ** 2 - mean).sum() / (mean**2).sum())
    if alpha <= 0.0:
        return replace(poisson, notes=(*poisson.notes, "counts are not overdispersed: the Poisson variance is used"))
    named = replace(fit, name="negative binomial GEE")
    return replace(marginal_model(named, design, families.NegativeBinomial(alpha=alpha)), alpha=alpha)


def extreme_condition(design: ModelDesign, what: str, value: float) -> str:
    """Describe a level, or two levels, in which all responses have the same extreme value; empty for none.

    Parameters
    ----------
    what : str
        Meaning of that value, such as ``none failed``.
    value : float
        End of the range of the response: 0, or 1 for a share [its own].
    """
    whole = cells_of(design, ())[0]
    if whole.mean == value:
        return f"{what} in any condition"
    pairs = combinations(design.factors, 2) if len(design.factors) > 1 else [(one,) for one in design.factors]
    for own in pairs:
        for cell in cells_of(design, own):
            if cell.mean == value:
                return f"{what} in one condition ({cell.label})"
    return ""


def penalised_model(fit: Specification, design: ModelDesign, family: Family, why: str) -> Model:
    """Fit Firth's penalised likelihood: finite estimates, profile intervals adjusted for the clustering by dyads.

    The likelihood-ratio statistic is divided by the dispersion and compared with F of 1 and the between-dyad degrees of
    freedom.

    Parameters
    ----------
    fit : Specification
        Specification of the model that it replaces.
    why : str
        Description of the condition with no events or only events.
    """
    if "any condition" in why:
        return fit.unfitted(design, f"not fitted: {why}, so conditions cannot be compared")
    best = firth_fit(design.values, design.columns, family)
    spread = _dispersion_of_dyads(design, best, family)
    counts = family == "poisson"
    named = replace(
        fit,
        name=f"{'Poisson' if counts else 'logistic'} regression, Firth's penalised likelihood",
        assumptions=tuple(sentence.format(what="mean count" if counts else "odds") for sentence in _PENALISED),
    )
    effects, converged = _profiled(named, design, best, family, spread)
    return named.model(
        design,
        best.coefficients,
        best.covariance * spread,
        converged=best.converged and converged,
        notes=(f"{why}: Firth's penalised likelihood, which is finite there", f"dispersion between dyads {spread:.2f}"),
        dispersion=spread,
        effects=effects,
    )


def _dispersion_of_dyads(design: ModelDesign, best: Penalised, family: Family) -> float:
    """Return the variance inflation of dyads, or of trials, relative to independent trials; at least 1."""
    means = best.means
    variances = means if family == "poisson" else means * (1.0 - means)
    left = design.values - means
    n, k = design.columns.shape
    found = [1.0, float((left**2 / variances).sum() / (n - k))]
    if design.n_dyads > 1:
        totals = np.bincount(design.dyads, weights=left) ** 2 / np.bincount(design.dyads, weights=variances)
        found.append(float(totals.sum()) / (design.n_dyads - 1))
    return max(found)


def _profiled(
    fit: Specification, design: ModelDesign, best: Penalised, family: Family, spread: float
) -> tuple[tuple[Effect, ...], bool]:
    """Return all effects with profile confidence intervals, and whether the fits without each effect converged."""
    free = between_dyad_freedom(design) if fit.interval == "t" else inf
    found = []
    converged = True
    for name, row in contrasts_of(design).items():
        value = nan if row is None else float(row @ best.coefficients)
        error = low = high = p = nan
        if row is not None and free > 0.0:
            error = sqrt(spread * float(row @ best.covariance @ row))
            drop = 0.5 * spread * float(stats.t.ppf(0.5 + fit.level / 2.0, free)) ** 2
            low, high = profile_interval(design.values, design.columns, family, best, row, drop)
            held = firth_fit(design.values, design.columns, family, (row, 0.0))
            converged &= held.converged
            ratio = 2.0 * max(0.0, best.likelihood - held.likelihood) / spread
            p = float(2.0 * stats.t.sf(sqrt(ratio), free))
        method = "profile, z" if free == inf else f"profile, {free:.0f} df"
        found.append(interval_effect(name, (value, low, high), error, free, p, fit.level, design.n_dyads, method))
    return tuple(found), converged
