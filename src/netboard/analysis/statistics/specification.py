"""Specification of a kind of model: name, equation, assumptions; and construction of its results.

Every model returns a `Model`, fitted or not. A fit that fails, or has too few dyads, is a result with notes and not an
exception.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray
from statsmodels.genmod.generalized_linear_model import GLM

from netboard.analysis.statistics.effects import (
    NOT_CONVERGED,
    Component,
    Diagnostics,
    Effect,
    Interval,
    Model,
    between_dyad_freedom,
    effects_of,
    unique,
)
from netboard.analysis.statistics.factors import ModelDesign, cells_of
from netboard.analysis.statistics.restricted import Moments

FEW = 20
"""Number of dyads below which a result carries a caution [1]."""


@dataclass(frozen=True, slots=True)
class Specification:
    """Specification of a kind of model.

    Attributes
    ----------
    name, equation : str
        Name and equation of the model; ``{fixed}`` in the equation stands for its fixed part.
    assumptions : tuple of str
        Assumptions, as sentences.
    level : float
        Confidence level [1].
    interval : {"t", "z"}
        Student's t with the between-dyad degrees of freedom, or the normal distribution.
    geometric : bool
        Whether means of conditions are geometric.
    """

    name: str
    equation: str
    assumptions: tuple[str, ...]
    level: float
    interval: Interval
    geometric: bool = False

    def model(
        self,
        design: ModelDesign,
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
        effects: tuple[Effect, ...] | None = None,
    ) -> Model:
        """Return the result of a fit; non-finite estimates count as not fitted.

        Parameters
        ----------
        converged, components, diagnostics, dispersion, correlation
            As in `Model` [1].
        effects : tuple of Effect or None
            Effects, if they cannot be derived from coefficients and covariance.
        """
        fitted = bool(np.isfinite(coefficients).all() and len(coefficients))
        few = self._few(design) if fitted else ()
        doubt = (NOT_CONVERGED,) if fitted and not converged else ()
        return Model(
            name=self.name,
            equation=self.equation.format(fixed=_fixed(design)),
            fitted=fitted,
            converged=converged and fitted,
            effects=effects
            or effects_of(design, coefficients, covariance, level=self.level, interval=self.interval, moments=moments),
            components=components,
            cells=cells_of(design, geometric=self.geometric),
            dispersion=dispersion,
            alpha=nan,
            correlation=correlation,
            trials=len(design.values),
            performers=design.n_performers,
            dyads=design.n_dyads,
            left_out=design.left_out,
            assumptions=self.assumptions,
            notes=unique((*doubt, *design.notes, *notes, *few)),
            diagnostics=diagnostics,
        )

    def _few(self, design: ModelDesign) -> tuple[str, ...]:
        n = design.n_dyads
        if n < 2:
            return ("one dyad: the variation between dyads is unknown, so there are no confidence intervals",)
        if n >= FEW:
            return ()
        what = (
            "z intervals are too short for this few"
            if self.interval == "z"
            else f"t has {between_dyad_freedom(design):.0f} degrees of freedom, unless a small-sample method is named"
        )
        return (f"{n} dyads: {what}",)

    def unfitted(self, design: ModelDesign, why: str) -> Model:
        """Return a result without a fit, and the reason."""
        nothing = np.full(len(design.names), np.nan)
        return self.model(design, nothing, np.full((len(nothing),) * 2, np.nan), converged=False, notes=(why,))

    def fit_single_dyad(self, design: ModelDesign, family: Any) -> Model:
        """Fit a single dyad as if its trials were independent, without confidence intervals."""
        fit, notes = with_notes(lambda: GLM(design.values, design.columns, family=family).fit())
        if fit is None:
            return self.unfitted(design, notes[-1])
        unknown = np.full((len(design.names),) * 2, np.nan)
        coefficients = np.asarray(fit.params)
        return self.model(design, coefficients, unknown, converged=bool(fit.converged), notes=notes)


def _fixed(design: ModelDesign) -> str:
    """Return the fixed part of a model's equation; a product of factors includes their main effects."""
    pairs = [f"{a.name} x {b.name}" for a, b in combinations(design.factors, 2)]
    return " + ".join(("intercept", *(pairs or [one.name for one in design.factors]), "b log(trial)"))


def too_few_trials(design: ModelDesign) -> str:
    """Return why a design has too few trials for its effects; empty if it has enough."""
    n, k = design.columns.shape
    return "" if n > k and k else f"not fitted: {n} trials are too few for {k} effects"


def too_few_events(design: ModelDesign, events: float, what: str) -> str:
    """Return why a design has too few events for its effects, at least one for each; empty if it has enough, or none.

    Parameters
    ----------
    events : float
        Number of events [1].
    what : str
        What an event is, such as ``attempts failed``.
    """
    k = len(design.names)
    if not 0.0 < events < k:
        return ""
    return f"not estimated, because only {events:.0f} {what}: each of the {k} effects needs at least one"


def with_notes(run: Callable[[], Any]) -> tuple[Any, tuple[str, ...]]:
    """Run a fit and turn warnings and singular matrices into notes; the fit is None without a result.

    Parameters
    ----------
    run : callable
        Function without arguments that returns the fit of statsmodels.
    """
    with warnings.catch_warnings(record=True) as recorded:
        warnings.simplefilter("always")
        try:
            fit = run()
            failed = () if fit is not None else ("not fitted: statsmodels found no estimate",)
        except np.linalg.LinAlgError as error:
            fit, failed = None, (f"not fitted: {error}",)
    return fit, unique([*(f"statsmodels: {warning.message}" for warning in recorded), *failed])
