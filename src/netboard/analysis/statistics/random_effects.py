"""Mixed model of a study: identifiable random effects, fit, and residuals.

Random effects are intercepts of dyads and performers, and slopes of the factors that vary within performers. Those that
the trials cannot identify are left out, with a note. `netboard.analysis.statistics.restricted` does the fit.
"""

from math import sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.statistics.effects import Component, Diagnostics, Model, diagnose
from netboard.analysis.statistics.factors import ModelDesign
from netboard.analysis.statistics.restricted import restricted_fit
from netboard.analysis.statistics.specification import Specification

Slopes = Literal["none", "dyad", "performer"]

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


def random_effects(design: ModelDesign, slopes: Slopes) -> tuple[dict[str, NDArray[np.float64]], tuple[str, ...]]:
    """Return the random effects that these trials can identify, and notes on the others [1].

    Each is a matrix with a column for each dyad or performer, times the factor's. It is identifiable if its covariance
    is not a linear combination of the others': the REML information about the variances, at equal ones, is not singular
    (Searle, Casella and McCulloch, Variance Components, 1992, 6.6).
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
            notes.append(f"{name}: no random effect, because these trials cannot identify it")
    return kept, tuple(notes)


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
    parts, notes = random_effects(design, slopes)
    if not parts:
        return fit.unfitted(design, "not fitted: no random effect can be identified")
    found = restricted_fit(design.values, design.columns, list(parts.values()), design.dyads)
    if found is None:
        return fit.unfitted(design, "not fitted: there is no variation of times beyond effects, dyads and performers")
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


def _left(
    design: ModelDesign,
    coefficients: NDArray[np.float64],
    parts: dict[str, NDArray[np.float64]],
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
