"""Models of a whole study: completion times, counts and failures over the study's factors and practice.

Trials of a dyad are alike, and so are trials of a performer. The mixed model of log times says so with sources of
chance; the models of counts and shares leave it open and take the spread between dyads for their errors. Either way the
dyad is the unit, and an interval has one degree of freedom less than there are dyads. What cannot be fitted is said in
the result, with every warning of statsmodels; it is no exception.

Needs statsmodels (extra `analysis`). docs/analysis-modern.md has the equations, and how often the intervals are right.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import nan, sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from statsmodels.genmod import families
from statsmodels.genmod.cov_struct import Exchangeable
from statsmodels.genmod.generalized_estimating_equations import GEE
from statsmodels.genmod.generalized_linear_model import GLM

from netboard.analysis.effects import (
    Component,
    Diagnostics,
    Interval,
    Model,
    diagnose,
    effects_of,
    said,
)
from netboard.analysis.factors import Design, Factor, cells_of, design_of
from netboard.analysis.restricted import Moments, restricted_fit

Slopes = Literal["none", "dyad", "performer"]
Family = Literal["poisson", "negative_binomial"]

FEW = 20
"""With fewer dyads than this, a result says what few dyads do to it [1]."""

MOST = 2.0**53
"""The largest count: beyond it a float64 does not tell a whole number from the next [1]."""

TIMES = "log(time) = {fixed} + dyad + performer (+ slopes) + residual"
COUNTS = "log(mean count) = {fixed}"
SHARES = "log(odds) = {fixed}"

AT_ZERO = (
    "Satterthwaite takes a variance that is estimated as 0 for known, and so has too many degrees of freedom; "
    "Kenward-Roger keeps it among the uncertain ones"
)

_MIXED = (
    "Dyads are a random sample of one population, and performers of a dyad of another: any two could change places.",
    "Deviations of dyads, of performers and of trials are normal on the log scale, and independent of each other.",
    "The spread of trials is the same in all conditions and for all performers, on the log scale.",
    "Trials of a performer depend on each other through performer and trial number only; no streaks, no tiredness.",
    "Practice is a power law with one exponent for all conditions and performers.",
    "Trials without a time are missing by chance.",
)
_MARGINAL = (
    "Dyads are independent of each other; within a dyad, trials may depend on each other in any way.",
    "Effects multiply the {what}; practice is a power law with one exponent for all conditions and performers.",
    "The effects are those on the average of the population, not on one performer.",
    "There are many dyads; with few, the covariance is that of Mancl and DeRouen, and t has as few degrees of freedom.",
)


def log_time_model(
    times: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    factors: Sequence[Factor],
    order: ArrayLike,
    *,
    slopes: Slopes = "performer",
    level: float = 0.95,
    interval: Interval = "t",
) -> Model:
    """Fit a linear mixed model of log completion times (REML, `restricted_fit`).

    Parameters
    ----------
    times : array_like, shape (n,)
        Completion times of trials; NaN are left out [s].
    dyads, performers : array_like, shape (n,)
        Whose trial it is: labels of any kind. The performer is a person, or the two of a dyad together.
    factors : sequence of Factor
        The fixed factors of the study, such as `netboard.analysis.factors.paper_factors`.
    order : array_like, shape (n,)
        Number of the trial in its condition, from 1 [1].
    slopes : {"none", "dyad", "performer"}
        Whose effects differ by chance: nobody's, a dyad's, or a dyad's and a performer's, of each factor that varies
        within performers. Without them an effect that differs between dyads is taken for surer than it is.
    level : float
        Confidence [1].
    interval : {"t", "z"}
        Student's with the degrees of freedom between dyads (`careful_freedom`); or the normal one, too short for few.

    Returns
    -------
    Model
        With components and diagnostics. With one dyad, least squares without intervals.

    Raises
    ------
    ValueError
        If there is not one label for each trial, a trial number below 1, or a time that is not positive.
    """
    seconds = np.asarray(times, dtype=float)
    if (seconds <= 0.0).any():
        raise ValueError(f"times: positive times are expected, found {seconds[seconds <= 0.0][0]} s")
    design = design_of(np.log(seconds), dyads, performers, factors, order)
    fit = _Fit("linear mixed model, REML", TIMES, _MIXED, level, interval, geometric=True)
    lack = _lack(design)
    if lack:
        return fit.without(design, lack)
    if not _spread(design) > 1e-9 * max(1.0, float(np.abs(design.values).max())):
        return fit.without(design, "not fitted: the times do not vary beyond the effects")
    if design.n_dyads < 2:
        return fit.alone(design, families.Gaussian())
    parts, notes = _parts(design, slopes)
    return _mixed(fit, design, parts, notes)


def count_model(
    counts: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    factors: Sequence[Factor],
    order: ArrayLike,
    *,
    family: Family = "poisson",
    level: float = 0.95,
    interval: Interval = "t",
) -> Model:
    """Fit a marginal model of counts, such as velocity peaks or falls of a trial (GEE, exchangeable within dyads).

    The covariance is that of the dyads' own deviations, with its bias for few dyads taken away (Mancl and DeRouen,
    Biometrics 57:126, 2001). It holds whatever the variance of a count is; the family only weights the trials.

    Parameters
    ----------
    counts : array_like, shape (n,)
        Whole numbers from 0 to `MOST`; NaN are left out [1].
    dyads, performers : array_like, shape (n,)
        Whose trial it is: labels of any kind. The performer is a person, or the two of a dyad together.
    factors : sequence of Factor
        The fixed factors of the study, such as `netboard.analysis.factors.paper_factors`.
    order : array_like, shape (n,)
        Number of the trial in its condition, from 1 [1].
    family : {"poisson", "negative_binomial"}
        Variance of a count: its mean m; or m + alpha m^2, with alpha from the residuals of the first.
    level : float
        Confidence [1].
    interval : {"t", "z"}
        Student's with the degrees of freedom between dyads (`careful_freedom`); or the normal one, too short for few.

    Returns
    -------
    Model
        With dispersion, and ratios of means. With one dyad, without intervals.

    Raises
    ------
    ValueError
        If there is not one label for each trial, a trial number below 1, or a value that is no count.
    """
    values = np.asarray(counts, dtype=float)
    strange = np.isfinite(values) & ((values < 0.0) | (values != np.floor(values)) | (values > MOST))
    if strange.any():
        raise ValueError(f"counts: whole numbers from 0 to 2^53 are expected, found {values[strange][0]}")
    design = design_of(values, dyads, performers, factors, order)
    assumptions = tuple(sentence.format(what="mean count") for sentence in _MARGINAL)
    fit = _Fit("Poisson GEE", COUNTS, assumptions, level, interval)
    lack = _lack(design) or _one_sided(design, "nothing was counted", 0.0)
    if lack:
        return fit.without(design, lack)
    poisson = _marginal(fit, design, families.Poisson())
    if family == "poisson" or not poisson.fitted:
        return poisson
    return _over_dispersed(fit, design, poisson)


def share_model(
    failed: ArrayLike,
    dyads: ArrayLike,
    performers: ArrayLike,
    factors: Sequence[Factor],
    order: ArrayLike,
    *,
    level: float = 0.95,
    interval: Interval = "t",
) -> Model:
    """Fit a marginal logistic model of whether attempts failed (GEE, exchangeable within dyads; see `count_model`).

    Parameters
    ----------
    failed : array_like, shape (n,)
        1 for an attempt that failed, 0 for one that did not; NaN are left out [1].
    dyads, performers : array_like, shape (n,)
        Whose attempt it is: labels of any kind. The performer is a person, or the two of a dyad together.
    factors : sequence of Factor
        The fixed factors of the study, such as `netboard.analysis.factors.paper_factors`.
    order : array_like, shape (n,)
        Number of the trial in its condition, from 1 [1].
    level : float
        Confidence [1].
    interval : {"t", "z"}
        Student's with the degrees of freedom between dyads (`careful_freedom`); or the normal one, too short for few.

    Returns
    -------
    Model
        With ratios of odds. Not fitted if all or none failed in a condition: such odds have no finite estimate.

    Raises
    ------
    ValueError
        If there is not one label for each attempt, a trial number below 1, or a value that is neither 0 nor 1.
    """
    values = np.asarray(failed, dtype=float)
    strange = np.isfinite(values) & (values != 0.0) & (values != 1.0)
    if strange.any():
        raise ValueError(f"failed: 0 or 1 is expected, found {values[strange][0]}")
    design = design_of(values, dyads, performers, factors, order)
    assumptions = tuple(sentence.format(what="odds") for sentence in _MARGINAL)
    fit = _Fit("logistic GEE", SHARES, assumptions, level, interval)
    lack = _lack(design) or _one_sided(design, "none failed", 0.0) or _one_sided(design, "all failed", 1.0)
    return fit.without(design, lack) if lack else _marginal(fit, design, families.Binomial())


# --- parts -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Fit:
    """What all results of a model have in common."""

    name: str
    equation: str
    assumptions: tuple[str, ...]
    level: float
    interval: Interval
    geometric: bool = False

    def model(
        self,
        design: Design,
        coefficients: NDArray[np.float64],
        covariance: NDArray[np.float64],
        *,
        converged: bool,
        notes: tuple[str, ...] = (),
        components: tuple[Component, ...] = (),
        diagnostics: Diagnostics | None = None,
        dispersion: float = nan,
        correlation: float = nan,
        moments: Moments | None = None,
    ) -> Model:
        """Say everything about a fit; numbers that are not finite are no fit."""
        fitted = bool(np.isfinite(coefficients).all() and len(coefficients))
        few = self._few(design) if fitted else ()
        return Model(
            self.name,
            self.equation.format(fixed=_fixed(design)),
            fitted,
            converged and fitted,
            effects_of(design, coefficients, covariance, level=self.level, interval=self.interval, moments=moments),
            components,
            cells_of(design, geometric=self.geometric),
            dispersion,
            nan,
            correlation,
            len(design.values),
            design.n_performers,
            design.n_dyads,
            design.left_out,
            self.assumptions,
            said((*design.notes, *notes, *few)),
            diagnostics,
        )

    def _few(self, design: Design) -> tuple[str, ...]:
        n = design.n_dyads
        if n < 2:
            return ("one dyad: nothing is known about others, and there are no intervals",)
        if n >= FEW:
            return ()
        what = "z intervals are too short for so few" if self.interval == "z" else f"t has {n - 1} degrees of freedom"
        return (f"{n} dyads: {what}",)

    def without(self, design: Design, why: str) -> Model:
        """Say why there is no fit."""
        nothing = np.full(len(design.names), np.nan)
        return self.model(design, nothing, np.full((len(nothing),) * 2, np.nan), converged=False, notes=(why,))

    def alone(self, design: Design, family: Any) -> Model:
        """Fit a single dyad as if its trials were independent, without intervals."""
        fit, notes = _noting(lambda: GLM(design.values, design.columns, family=family).fit())
        if fit is None:
            return self.without(design, notes[-1])
        unknown = np.full((len(design.names),) * 2, np.nan)
        coefficients = np.asarray(fit.params)
        return self.model(design, coefficients, unknown, converged=bool(fit.converged), notes=notes)


def _fixed(design: Design) -> str:
    """Write the fixed part of a model; a product of factors has their main effects with it."""
    pairs = [f"{a.name} x {b.name}" for a, b in combinations(design.factors, 2)]
    return " + ".join(("intercept", *(pairs or [one.name for one in design.factors]), "b log(trial)"))


def _lack(design: Design) -> str:
    """Say what a design has too little of."""
    n, k = design.columns.shape
    return "" if n > k and k else f"not fitted: {n} trials are too few for {k} effects"


def _one_sided(design: Design, what: str, value: float) -> str:
    """Say where the response has the same extreme value in all trials of a condition."""
    for cell in cells_of(design):
        if cell.mean == value:
            return f"not fitted: {what} in one condition ({cell.label}), so an effect has no finite estimate"
    return ""


def _noting(fit: Callable[[], Any]) -> tuple[Any, tuple[str, ...]]:
    """Fit, and turn warnings and singular matrices into notes; the fit is None without a result."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            found = fit()
            failed = () if found is not None else ("not fitted: statsmodels found no estimate",)
        except np.linalg.LinAlgError as error:
            found, failed = None, (f"not fitted: {error}",)
    return found, said([*(f"statsmodels: {warning.message}" for warning in heard), *failed])


# --- the mixed model ---------------------------------------------------------------------------------------------


def _spread(design: Design) -> float:
    """Return the deviation that least squares leave."""
    coefficients = np.linalg.lstsq(design.columns, design.values, rcond=None)[0]
    residuals = design.values - design.columns @ coefficients
    return sqrt(float(residuals @ residuals) / (len(residuals) - design.columns.shape[1]))


def _parts(design: Design, slopes: Slopes) -> tuple[dict[str, NDArray[np.float64]], tuple[str, ...]]:
    """Return the sources of chance that these trials can tell, each as its indicator matrix.

    A source is told from others if its share of the variances is no sum of theirs: the information of REML about the
    variances, at equal ones, is not singular (Searle, Casella and McCulloch, Variance Components, 1992, 6.6).
    """
    units = {"dyad": design.dyads, "performer": design.performers}
    wanted = {name: np.eye(index.max() + 1)[index] for name, index in units.items()}
    for factor in design.varied(design.performers) if slopes != "none" else ():
        for name in ("dyad", "performer")[: 1 + (slopes == "performer")]:
            wanted[f"{factor.name} by {name}"] = _each(factor.deviations, wanted[name])
    n, k = design.columns.shape
    basis = np.linalg.qr(design.columns)[0]
    kept: dict[str, NDArray[np.float64]] = {}
    free: list[NDArray[np.float64]] = []
    notes = []
    for name, matrix in wanted.items():
        left = matrix - basis @ (basis.T @ matrix)
        if _independent([*free, left], n - k):
            kept[name] = matrix
            free.append(left)
        else:
            notes.append(f"{name}: no source of chance of its own, these trials cannot tell it")
    return kept, tuple(notes)


def _each(deviations: NDArray[np.float64], units: NDArray[np.float64]) -> NDArray[np.float64]:
    """Multiply every column of a factor with every unit's indicator."""
    return (units[:, :, None] * deviations[:, None, :]).reshape(len(units), -1)


def _independent(sources: list[NDArray[np.float64]], residual: int) -> bool:
    """Say whether variances of these sources, and of the residual, can be told from each other."""
    size = len(sources) + 1
    information = np.empty((size, size))
    information[0, 0] = residual
    for i, one in enumerate(sources, start=1):
        information[0, i] = information[i, 0] = (one**2).sum()
        for j, other in enumerate(sources, start=1):
            information[i, j] = ((one.T @ other) ** 2).sum()
    scale = np.sqrt(np.diag(information))
    if not (scale > 1e-6 * sqrt(residual)).all():
        return False
    return float(np.linalg.eigvalsh(information / np.outer(scale, scale))[0]) > 1e-9


def _mixed(fit: _Fit, design: Design, parts: dict[str, NDArray[np.float64]], notes: tuple[str, ...]) -> Model:
    """Fit the mixed model, and say which sources of chance contribute nothing."""
    if not parts:
        return fit.without(design, "not fitted: no source of chance beside the residual can be told")
    found = restricted_fit(design.values, design.columns, list(parts.values()), design.dyads)
    if found is None:
        return fit.without(design, "not fitted: the times do not vary beyond effects, dyads and performers")
    variances = dict(zip(parts, found.variances, strict=True))
    nothing = 1e-6 * found.residual
    notes += tuple(f"{name}: its variance is estimated as 0" for name, s in variances.items() if s < nothing)
    if 0.0 in found.variances:
        notes += (AT_ZERO,)
    if not found.converged:
        notes += ("the search for the variances did not end",)
    components = [Component(name, s, sqrt(s), int(parts[name].any(axis=0).sum())) for name, s in variances.items()]
    return fit.model(
        design,
        found.coefficients,
        found.covariance,
        converged=found.converged,
        notes=notes,
        components=(*components, Component("residual", found.residual, sqrt(found.residual), len(design.values))),
        moments=found.moments,
        diagnostics=_left(design, found.coefficients, parts, variances, found.residual),
    )


def _left(
    design: Design,
    coefficients: NDArray[np.float64],
    parts: dict[str, NDArray[np.float64]],
    variances: dict[str, float],
    residual: float,
) -> Diagnostics:
    """Take the best predictions of the random effects away as well, and look at what is left."""
    fixed = design.columns @ coefficients
    chance = np.hstack(list(parts.values()))
    scale = np.sqrt(np.repeat([s / residual for s in variances.values()], [part.shape[1] for part in parts.values()]))
    system = np.eye(len(scale)) + scale[:, None] * (chance.T @ chance) * scale
    predicted = fixed + chance @ (scale * np.linalg.solve(system, scale * (chance.T @ (design.values - fixed))))
    return diagnose(design, design.values - predicted, predicted)


# --- the marginal models -----------------------------------------------------------------------------------------


def _marginal(fit: _Fit, design: Design, family: Any) -> Model:
    """Fit estimating equations, with the covariance that dyads show."""
    if design.n_dyads < 2:
        return fit.alone(design, family)
    model = GEE(design.values, design.columns, groups=design.dyads, family=family, cov_struct=Exchangeable())
    found, notes = _noting(lambda: model.fit(cov_type="bias_reduced", maxiter=200))
    if found is None:
        return replace(fit.without(design, notes[-1]), notes=said((*design.notes, *notes)))
    k = len(design.names)
    if design.n_dyads <= k:
        notes += (
            f"{design.n_dyads} dyads for {k} effects: each effect has an interval, all of them together have none",
        )
    counted = not isinstance(family, families.Binomial)
    covariance = np.asarray(found.cov_params())
    if design.lonely:
        # The correction divides by 1 less the leverage of a dyad, which is 1 here.
        covariance = np.full((k, k), np.nan)
        notes += ("no intervals: dyads cannot show the error of what one of them alone tells",)
    return fit.model(
        design,
        np.asarray(found.params),
        covariance,
        converged=bool(found.converged),
        notes=notes,
        dispersion=_dispersion(design, np.asarray(found.params)) if counted else nan,
        correlation=float(found.cov_struct.dep_params),
    )


def _dispersion(design: Design, coefficients: NDArray[np.float64]) -> float:
    """Return Pearson's chi-square over its degrees of freedom, 1 for counts of Poisson's distribution."""
    mean = np.exp(design.columns @ coefficients)
    n, k = design.columns.shape
    return float(((design.values - mean) ** 2 / mean).sum() / (n - k))


def _over_dispersed(fit: _Fit, design: Design, poisson: Model) -> Model:
    """Fit again, with the variance that the residuals of the first fit have beyond the mean."""
    coefficients = np.array([poisson.effect(name).estimate.value for name in design.names])
    mean = np.exp(design.columns @ coefficients)
    alpha = float(((design.values - mean) ** 2 - mean).sum() / (mean**2).sum())
    if alpha <= 0.0:
        return replace(poisson, notes=(*poisson.notes, "counts vary no more than Poisson's: its variance is used"))
    named = replace(fit, name="negative binomial GEE")
    return replace(_marginal(named, design, families.NegativeBinomial(alpha=alpha)), alpha=alpha)
