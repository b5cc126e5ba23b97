"""Mixed model of a study: the random effects that its design supports, fit, and residuals.

Random effects are intercepts of dyads and performers, and slopes: what the fixed effects have, in each dyad and
performer within which it varies. A rule that is declared here reduces them.

1. A random effect that the trials cannot identify is left out.
2. The effect of a factor may differ between dyads more at one level of another factor. It gets a slope at one of these
   levels: that with the highest restricted likelihood.
3. While the search does not converge, the slope with the smallest variance is left out, and the rest is fitted again.

A variance that is estimated as 0 stays in the model. Whatever is left out is noted.
`netboard.analysis.statistics.restricted` does the fit.
"""

from dataclasses import dataclass
from itertools import combinations
from math import sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.statistics.effects import Component, Diagnostics, Model, diagnose
from netboard.analysis.statistics.factors import ModelDesign, interaction
from netboard.analysis.statistics.restricted import Restricted, restricted_fit
from netboard.analysis.statistics.specification import Specification

Slopes = Literal["none", "dyad", "performer", "maximal"]

RandomEffects = dict[str, NDArray[np.float64]]
"""Matrix of each random effect by name, with a column for each of its levels [1]."""

NORMAL_EFFECTS = (
    "assumes that the effects of dyads are normal; if they are strongly skewed (log-normal), the test of 8 dyads has "
    "11 % false positives at a level of 5 %"
)
"""Caution for the p value of a mixed model; docs/explanation/analysis-calibration.md has the simulation."""

AT_ZERO = (
    "Satterthwaite's method treats a variance that is estimated as 0 as known, and so has too many degrees of freedom; "
    "Kenward-Roger treats it as uncertain"
)
"""Note for a variance that is estimated as 0."""


def residual_deviation(design: ModelDesign) -> float:
    """Return the residual standard deviation without random effects: least squares [log of the response]."""
    coefficients = np.linalg.lstsq(design.columns, design.values, rcond=None)[0]
    residuals = design.values - design.columns @ coefficients
    return sqrt(float(residuals @ residuals) / (len(residuals) - design.columns.shape[1]))


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """Random effects that the trials of a study can identify; it depends on the design alone.

    Attributes
    ----------
    parts : dict
        Matrix of each random effect by name, with a column for each of its levels [1].
    choices : tuple of dict
        Further ones, of which the fit has one of each group.
    notes : tuple of str
        Random effects that these trials cannot identify.
    """

    parts: RandomEffects
    choices: tuple[RandomEffects, ...]
    notes: tuple[str, ...]


def random_effects(design: ModelDesign, slopes: Slopes) -> Structure:
    """Return the random effects that these trials can identify, and notes on the others.

    Each is a matrix with a column for each dyad or performer, times the factor's. It is identifiable if its covariance
    is not a linear combination of the others': the REML information about the variances, at equal ones, is not singular
    (Searle, Casella and McCulloch, Variance Components, 1992, 6.6).
    """
    parts, notes = _identified(design, {}, _wanted(design, slopes))
    choices, kept = [], parts
    for candidates in _level_slopes(design) if slopes == "maximal" else ():
        known = {name: one for name, one in candidates.items() if not _identified(design, kept, {name: one})[1]}
        if known:
            choices.append(known)
            kept = kept | dict([next(iter(known.items()))])
    return Structure(parts, tuple(choices), notes)


def _wanted(design: ModelDesign, slopes: Slopes) -> RandomEffects:
    """Return the random effects of a kind, identifiable or not."""
    units = {"dyad": design.dyads, "performer": design.performers}
    wanted = {name: np.eye(index.max() + 1)[index] for name, index in units.items()}
    within = {name: design.varied(index) for name, index in units.items()}
    if slopes in ("dyad", "performer"):
        for factor in within["performer"]:
            for name in ("dyad", "performer")[: 1 + (slopes == "performer")]:
                wanted[f"{factor.name} by {name}"] = _each(factor.deviations, wanted[name])
    elif slopes == "maximal":
        for name in units:
            for factor in within[name]:
                wanted[f"{factor.name} by {name}"] = _each(factor.deviations, wanted[name])
            for one, other in combinations(within[name], 2):
                product = _each(one.deviations, other.deviations)
                wanted[f"{interaction(one.name, other.name)} by {name}"] = _each(product, wanted[name])
    return wanted


def _level_slopes(design: ModelDesign) -> list[RandomEffects]:
    """Return, for each pair of factors within dyads, the slope of the first at each level of the second.

    They are candidates: with one of them the effects at two levels may vary differently between dyads.
    """
    dyads = np.eye(design.dyads.max() + 1)[design.dyads]
    return [
        {
            f"{one.name} by dyad, {other.text(level)}": _each(one.deviations * (other.values == level)[:, None], dyads)
            for level in other.present
        }
        for one, other in combinations(design.varied(design.dyads), 2)
        if not other.numeric
    ]


def _identified(
    design: ModelDesign, kept: RandomEffects, wanted: RandomEffects
) -> tuple[RandomEffects, tuple[str, ...]]:
    """Add the wanted random effects that the trials can identify beside the kept ones; notes on the others."""
    n, k = design.columns.shape
    basis = np.linalg.qr(design.columns)[0]

    def left(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the fixed effects leave of a random effect."""
        return matrix - basis @ (basis.T @ matrix)

    found, free = dict(kept), [left(matrix) for matrix in kept.values()]
    notes = []
    for name, matrix in wanted.items():
        more = left(matrix)
        if _independent([*free, more], n - k):
            found[name] = matrix
            free.append(more)
        else:
            notes.append(f"{name}: no random effect, because these trials cannot identify it")
    return found, tuple(notes)


def _each(deviations: NDArray[np.float64], units: NDArray[np.float64]) -> NDArray[np.float64]:
    """Multiply every column of a factor by every unit's indicator."""
    return (units[:, :, None] * deviations[:, None, :]).reshape(len(units), -1)


def _independent(sources: list[NDArray[np.float64]], residual: int) -> bool:
    """Return whether the variances of these random effects and of the residual are identifiable."""
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


def mixed_model(fit: Specification, design: ModelDesign, slopes: Slopes) -> Model:
    """Fit the mixed model, with a note on random effects of zero variance.

    Parameters
    ----------
    design : Design
        Trials of at least two dyads.
    """
    structure = random_effects(design, slopes)
    if not structure.parts:
        return fit.unfitted(design, "not fitted: no random effect can be identified")
    fitted = reduced_fit(design, structure)
    if fitted is None:
        return fit.unfitted(design, "not fitted: there is no variation of times beyond effects, dyads and performers")
    parts, found, notes = fitted.parts, fitted.found, fitted.notes
    variances = dict(zip(parts, found.variances, strict=True))
    nothing = 1e-6 * found.residual
    notes += tuple(f"{name}: its variance is estimated as 0" for name, s in variances.items() if s < nothing)
    if 0.0 in found.variances:
        notes += (AT_ZERO,)
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


@dataclass(frozen=True, slots=True, eq=False)
class ReducedFit:
    """The fit with the random effects that the rule of this module leaves.

    Attributes
    ----------
    parts : dict
        Matrix of each of these random effects by name [1].
    found : Restricted
        Fit with them.
    notes : tuple of str
        Random effects that are left out, and why.
    """

    parts: RandomEffects
    found: Restricted
    notes: tuple[str, ...]


def reduced_fit(design: ModelDesign, of: Structure) -> ReducedFit | None:
    """Fit the random effects that the rule of this module leaves.

    None if no random effect can be identified, or if effects, dyads and performers explain all variation.

    Parameters
    ----------
    of : Structure
        Random effects of the design.
    """
    parts, notes = of.parts, of.notes
    best = _fitted(design, parts) if parts else None
    if best is None:
        return None
    for choice in of.choices:
        wider = [{**parts, name: one} for name, one in choice.items()]
        fits = [(more, found) for more in wider if (found := _fitted(design, more)) is not None]
        if fits:
            parts, best = max(fits, key=lambda each: each[1].likelihood)
    while not best.converged and (removable := [name for name in parts if " by " in name]):
        variance = dict(zip(parts, best.variances, strict=True))
        least = min(removable, key=lambda name: variance[name])
        narrower = {name: one for name, one in parts.items() if name != least}
        found = _fitted(design, narrower)
        if found is None:
            break
        parts, best = narrower, found
        notes += (f"{least}: left out, because the fit with it did not converge",)
    return ReducedFit(parts, best, notes)


def _fitted(design: ModelDesign, parts: RandomEffects) -> Restricted | None:
    return restricted_fit(design.values, design.columns, list(parts.values()), design.dyads)


def _left(
    design: ModelDesign,
    coefficients: NDArray[np.float64],
    parts: RandomEffects,
    variances: dict[str, float],
    residual: float,
) -> Diagnostics:
    """Return the diagnostics of the residuals after the best predictions of the random effects."""
    fixed = design.columns @ coefficients
    chance = np.hstack(list(parts.values()))
    scale = np.sqrt(np.repeat([s / residual for s in variances.values()], [part.shape[1] for part in parts.values()]))
    system = np.eye(len(scale)) + scale[:, None] * (chance.T @ chance) * scale
    predicted = fixed + chance @ (scale * np.linalg.solve(system, scale * (chance.T @ (design.values - fixed))))
    return diagnose(design, design.values - predicted, predicted)
