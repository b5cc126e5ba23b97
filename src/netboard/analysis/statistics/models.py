"""Statistical models of a whole study: completion times, counts and failures over its factors and practice.

Trials of a dyad are correlated, and so are trials of a performer. The mixed model of log times has random effects for
both, and for the effects that differ between them (`netboard.analysis.statistics.random_effects`). The marginal models
of counts and shares leave the correlation open and base standard errors on the variation between dyads. In both the
dyad is the unit of replication, and a confidence interval has at most one degree of freedom less than there are dyads.
A failed fit is a result with notes, including every warning of statsmodels, and not an exception.

Requires statsmodels (extra `analysis`). docs/explanation/analysis-modern.md has the equations and the coverage of the
confidence intervals.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from statsmodels.genmod import families

from netboard.analysis.statistics.effects import Interval, Model
from netboard.analysis.statistics.factors import FixedFactor, design_of
from netboard.analysis.statistics.marginal import (
    extreme_condition,
    marginal_model,
    over_dispersed_model,
    penalised_model,
)
from netboard.analysis.statistics.random_effects import Slopes, mixed_model, residual_deviation
from netboard.analysis.statistics.specification import Specification, too_few_events, too_few_trials

Family = Literal["poisson", "negative_binomial"]

MOST = 2.0**53
"""Largest count: above it float64 cannot represent every integer [1]."""

TIMES = "log(time) = {fixed} + dyad + performer (+ slopes) + residual"
COUNTS = "log(mean count) = {fixed}"
SHARES = "log(odds) = {fixed}"

_MIXED = (
    "Dyads are a random sample of a population of dyads, and performers of a population of performers: dyads are "
    "exchangeable, and so are the performers of a dyad.",
    "Deviations of dyads, of performers and of trials are normal on the log scale, and independent of each other.",
    "Random slopes are independent of each other; that of a factor at one level of another is at the likelier level.",
    "The spread of trials is the same in all conditions and for all performers, on the log scale.",
    "Trials of a performer depend on each other through performer and trial number only; no streaks, no fatigue.",
    "Practice is a power law with one exponent for all conditions and performers.",
    "Trials without a time are missing at random.",
)
_MARGINAL = (
    "Dyads are independent of each other; within a dyad, trials may depend on each other in any way.",
    "Effects multiply the {what}; practice is a power law with one exponent for all conditions and performers.",
    "The effects are population averages, not those of one performer.",
    "There are many dyads; with few, the covariance is that of Mancl and DeRouen, and t has as few degrees of freedom.",
)


def log_time_model(
    times: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    factors: Sequence[FixedFactor],
    order: ArrayLike,
    *,
    slopes: Slopes = "maximal",
    level: float = 0.95,
    interval: Interval = "t",
) -> Model:
    """Fit a linear mixed model of log completion times (REML, `restricted_fit`).

    With one dyad: least squares without confidence intervals.

    Parameters
    ----------
    times : array_like, shape (n,)
        Completion times of trials, above 0; NaN are ignored [s].
    """
    seconds = np.asarray(times, dtype=float)
    if (seconds <= 0.0).any():
        raise ValueError(f"times: positive times are expected, found {seconds[seconds <= 0.0][0]} s")
    design = design_of(np.log(seconds), dyads, performers, factors, order)
    fit = Specification("linear mixed model, REML", TIMES, _MIXED, level, interval, geometric=True)
    if why := too_few_trials(design):
        return fit.unfitted(design, why)
    if not residual_deviation(design) > 1e-9 * max(1.0, float(np.abs(design.values).max())):
        return fit.unfitted(design, "not fitted: there is no variation of times beyond the effects")
    if design.n_dyads < 2:
        return fit.fit_single_dyad(design, families.Gaussian())
    return mixed_model(fit, design, slopes)


def count_model(
    counts: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    factors: Sequence[FixedFactor],
    order: ArrayLike,
    *,
    family: Family = "poisson",
    level: float = 0.95,
    interval: Interval = "t",
) -> Model:
    """Fit a marginal model of counts, such as velocity peaks or falls per trial (GEE, exchangeable within dyads).

    The covariance is the empirical (sandwich) estimator over dyads with the small-sample correction of Mancl and
    DeRouen (Biometrics 57:126, 2001). It is valid for any variance of the counts; the family only weights the trials.
    With one dyad there are no confidence intervals. If a condition has no events, the fit is by Firth's penalised
    likelihood.

    Parameters
    ----------
    counts : array_like, shape (n,)
        Integers from 0 to `MOST`; NaN are ignored [1].
    family : {"poisson", "negative_binomial"}
        Variance of a count: its mean m, or m + alpha m^2, with alpha estimated from the residuals of the Poisson fit.
    """
    values = np.asarray(counts, dtype=float)
    strange = np.isfinite(values) & ((values < 0.0) | (values != np.floor(values)) | (values > MOST))
    if strange.any():
        raise ValueError(f"counts: whole numbers from 0 to 2^53 are expected, found {values[strange][0]}")
    design = design_of(values, dyads, performers, factors, order)
    assumptions = tuple(sentence.format(what="mean count") for sentence in _MARGINAL)
    fit = Specification("Poisson GEE", COUNTS, assumptions, level, interval)
    if why := too_few_trials(design) or too_few_events(design, float(design.values.sum()), "counted events"):
        return fit.unfitted(design, why)
    if why := extreme_condition(design, "nothing was counted", 0.0):
        return penalised_model(fit, design, "poisson", why)
    poisson = marginal_model(fit, design, families.Poisson())
    if family == "poisson" or not poisson.fitted:
        return poisson
    return over_dispersed_model(fit, design, poisson)


def share_model(
    failed: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    factors: Sequence[FixedFactor],
    order: ArrayLike,
    *,
    level: float = 0.95,
    interval: Interval = "t",
) -> Model:
    """Fit a marginal logistic model of whether attempts failed (GEE, exchangeable within dyads; see `count_model`).

    If all or no attempts failed in a condition: by Firth's penalised likelihood. With fewer failures than effects there
    is no fit.

    Parameters
    ----------
    failed : array_like, shape (n,)
        1 for a failed attempt, 0 otherwise; NaN are ignored [1].
    """
    values = np.asarray(failed, dtype=float)
    strange = np.isfinite(values) & (values != 0.0) & (values != 1.0)
    if strange.any():
        raise ValueError(f"failed: 0 or 1 is expected, found {values[strange][0]}")
    design = design_of(values, dyads, performers, factors, order)
    assumptions = tuple(sentence.format(what="odds") for sentence in _MARGINAL)
    fit = Specification("logistic GEE", SHARES, assumptions, level, interval)
    events, attempts = float(design.values.sum()), len(design.values)
    few = too_few_events(design, events, f"of {attempts} attempts failed") or too_few_events(
        design, attempts - events, f"of {attempts} attempts did not fail"
    )
    if why := too_few_trials(design) or few:
        return fit.unfitted(design, why)
    if why := extreme_condition(design, "none failed", 0.0) or extreme_condition(design, "all failed", 1.0):
        return penalised_model(fit, design, "binomial", why)
    return marginal_model(fit, design, families.Binomial())
