"""What all results of a model have in common: name, equation, assumptions, and how its numbers become a result."""

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
    Component,
    Diagnostics,
    Effect,
    Interval,
    Model,
    careful_freedom,
    effects_of,
    said,
)
from netboard.analysis.statistics.factors import Design, cells_of
from netboard.analysis.statistics.restricted import Moments

FEW = 20
"""With fewer dyads than this, a result says what few dyads do to it [1]."""


@dataclass(frozen=True, slots=True)
class Specification:
    """A kind of model.

    Attributes
    ----------
    name, equation : str
        What it is; ``{fixed}`` in the equation is its fixed part.
    assumptions : tuple of str
        What must hold, as sentences.
    level : float
        Confidence [1].
    interval : {"t", "z"}
        Student's with the degrees of freedom between dyads, or the normal one.
    geometric : bool
        Means of conditions are geometric.
    """

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
        effects: tuple[Effect, ...] | None = None,
    ) -> Model:
        """Say everything about a fit; numbers that are not finite are no fit.

        Parameters
        ----------
        design : Design
            The trials.
        coefficients : ndarray of float64, shape (k,)
            One for each column [log of the response].
        covariance : ndarray of float64, shape (k, k)
            Theirs [square of the log of the response].
        converged : bool
            The fit ended where it should.
        notes : tuple of str
            What went wrong or was left out.
        components : tuple of Component
            Sources of chance.
        diagnostics : Diagnostics or None
            Residuals.
        dispersion, correlation : float
            As in `Model` [1].
        moments : Moments or None
            Of a mixed model.
        effects : tuple of Effect or None
            Effects, if they do not follow from coefficients and covariance.
        """
        fitted = bool(np.isfinite(coefficients).all() and len(coefficients))
        few = self._few(design) if fitted else ()
        return Model(
            self.name,
            self.equation.format(fixed=_fixed(design)),
            fitted,
            converged and fitted,
            effects
            or effects_of(design, coefficients, covariance, level=self.level, interval=self.interval, moments=moments),
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
        what = (
            "z intervals are too short for so few"
            if self.interval == "z"
            else f"t has {careful_freedom(design):.0f} degrees of freedom"
        )
        return (f"{n} dyads: {what}",)

    def without(self, design: Design, why: str) -> Model:
        """Say why there is no fit.

        Parameters
        ----------
        design : Design
            The trials.
        why : str
            The reason.
        """
        nothing = np.full(len(design.names), np.nan)
        return self.model(design, nothing, np.full((len(nothing),) * 2, np.nan), converged=False, notes=(why,))

    def alone(self, design: Design, family: Any) -> Model:
        """Fit a single dyad as if its trials were independent, without intervals.

        Parameters
        ----------
        design : Design
            The trials.
        family : statsmodels family
            Distribution of the response.
        """
        fit, notes = noting(lambda: GLM(design.values, design.columns, family=family).fit())
        if fit is None:
            return self.without(design, notes[-1])
        unknown = np.full((len(design.names),) * 2, np.nan)
        coefficients = np.asarray(fit.params)
        return self.model(design, coefficients, unknown, converged=bool(fit.converged), notes=notes)


def _fixed(design: Design) -> str:
    """Write the fixed part of a model; a product of factors has their main effects with it."""
    pairs = [f"{a.name} x {b.name}" for a, b in combinations(design.factors, 2)]
    return " + ".join(("intercept", *(pairs or [one.name for one in design.factors]), "b log(trial)"))


def lacking(design: Design) -> str:
    """Say what a design has too little of.

    Parameters
    ----------
    design : Design
        The trials.
    """
    n, k = design.columns.shape
    return "" if n > k and k else f"not fitted: {n} trials are too few for {k} effects"


def noting(fit: Callable[[], Any]) -> tuple[Any, tuple[str, ...]]:
    """Fit, and turn warnings and singular matrices into notes; the fit is None without a result.

    Parameters
    ----------
    fit : callable
        What may warn.

    Returns
    -------
    object
        The fit, or None.
    tuple of str
        The notes.
    """
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            found = fit()
            failed = () if found is not None else ("not fitted: statsmodels found no estimate",)
        except np.linalg.LinAlgError as error:
            found, failed = None, (f"not fitted: {error}",)
    return found, said([*(f"statsmodels: {warning.message}" for warning in heard), *failed])
