"""Restricted maximum likelihood (REML) of a mixed model with non-negative variance components.

    y = X b + Z_1 u_1 + ... + Z_c u_c + e,    u_j ~ N(0, s r_j I),   e ~ N(0, s I),   all r_j >= 0

The search is over the r_j, the variances relative to the residual variance. The likelihood and its derivatives with
respect to r_j are smooth at 0: nothing is divided by a variance, and no coordinate is a square root of one. A random
effect with zero variance is therefore estimated as 0 and does not disturb the others.

Groups share no level of a random effect, so all computation is per group, on many small matrices.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

STARTS = (0.0, 0.05, 1.0)
"""Starting values of the search, as ratios to the residual variance; the best result counts [1]."""

LARGEST = 1e10
"""Ratio to the residual variance at which the search ends, because the residual is then negligible [1]."""

STEPS, HALVINGS = 200, 40
"""Maximum number of steps of a search, and of halvings of a step [1]."""

ENOUGH = 1e-10
"""Expected decrease of -2 log-likelihood at which a search ends [1]."""

FLAT = 1e-9
"""Relative curvature below which a parabola is too flat to use its minimum [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class Restricted:
    """Maximum of the restricted likelihood.

    Attributes
    ----------
    coefficients : ndarray of float64, shape (k,)
        Generalised least squares estimates with these variances [unit of the response over that of the column].
    covariance : ndarray of float64, shape (k, k)
        Covariance of the coefficients for known variances [square of a coefficient's].
    variances : tuple of float
        Variance of each random effect; may be 0 [square of the response].
    residual : float
        Residual variance [square of the response].
    likelihood : float
        Restricted log-likelihood [1].
    converged : bool
        Whether the search converged.
    moments : Moments
        Moments for small-sample inference.
    """

    coefficients: Array
    covariance: Array
    variances: tuple[float, ...]
    residual: float
    likelihood: float
    converged: bool
    moments: "Moments"


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Information about the variances at the estimates, used by `netboard.analysis.statistics.small_samples`.

    V is the covariance of the response over the residual variance and X the design matrix. G_i is the derivative of V
    with respect to the i-th variance ratio; the last one is the residual's, the identity. P = V^-1 - V^-1 X C X' V^-1.

    Attributes
    ----------
    residual : float
        Residual variance [square of the response].
    active : ndarray of bool, shape (c + 1,)
        Whether each variance is estimated above 0 [1].
    unscaled : ndarray of float64, shape (k, k)
        C = (X' V^-1 X)^-1: the covariance of the coefficients over the residual variance [square of a coefficient's].
    first : ndarray of float64, shape (c + 1, k, k)
        X' V^-1 G_i V^-1 X [1].
    second : ndarray of float64, shape (c + 1, c + 1, k, k)
        X' V^-1 G_i V^-1 G_j V^-1 X [1].
    expected : ndarray of float64, shape (c + 1, c + 1)
        tr(P G_i P G_j): twice the expected information about the variances, times the residual's square [1].
    observed : ndarray of float64, shape (c + 1, c + 1)
        The observed counterpart: 2 y' P G_i P G_j P y / residual - tr(P G_i P G_j) [1].
    """

    residual: float
    active: NDArray[np.bool_]
    unscaled: Array
    first: Array
    second: Array
    expected: Array
    observed: Array


def restricted_fit(
    response: Array, columns: Array, sources: Sequence[Array], groups: NDArray[np.int64]
) -> Restricted | None:
    """Maximise the restricted likelihood (Patterson and Thompson, Biometrika 58:545, 1971).

    None if it grows without limit as the residual variance shrinks: the random effects explain everything.

    Parameters
    ----------
    sources : sequence of ndarray of float64, shape (n, q) each
        Design matrix of each random effect: a column for each of its levels, 0 outside one group [1].
    groups : ndarray of int64, shape (n,)
        Group of each row, from 0 [1].
    """
    n, k = columns.shape
    data = _Data(*_triangles(response, columns, sources, groups), k, n - k)
    ends = [_search(data, np.full(len(sources), start)) for start in STARTS]
    best, converged = min(ends, key=lambda end: end[0].value)
    if best.ratios.max() >= LARGEST:
        return None
    root = np.linalg.inv(best.triangle)
    residual = best.square / data.count
    likelihood = -0.5 * (best.value + data.count * (1.0 + log(2.0 * pi / data.count)))
    variances = tuple(float(residual * ratio) for ratio in best.ratios)
    moments = data.moments(best.ratios, residual)
    return Restricted(root @ best.along, residual * root @ root.T, variances, residual, likelihood, converged, moments)


def _triangles(
    response: Array, columns: Array, sources: Sequence[Array], groups: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Reduce each group's data to a triangular factor with the same information, and map columns to sources.

    Returns (g, p, m + k + 1): for each group the columns of all sources, then effects and response, padded with 0. And
    (m, c): 1 where a column belongs to a source.
    """
    own = [[source[groups == group] for source in sources] for group in range(groups.max() + 1)]
    own = [[part[:, part.any(axis=0)] for part in parts] for parts in own]
    widths = [max(parts[j].shape[1] for parts in own) for j in range(len(sources))]
    fixed = np.column_stack([columns, response])
    size = sum(widths) + fixed.shape[1]
    stack = np.zeros((len(own), size, size))
    for group, parts in enumerate(own):
        wide = [np.pad(part, ((0, 0), (0, width - part.shape[1]))) for part, width in zip(parts, widths, strict=True)]
        triangle = np.linalg.qr(np.column_stack([*wide, fixed[groups == group]]), mode="r")
        stack[group, : len(triangle)] = triangle
    return stack, np.repeat(np.eye(len(sources)), widths, axis=0)


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """Likelihood and derivatives at given variance ratios.

    value : -2 log-likelihood without its constant; gradient (c,), curvature (c, c): its derivatives; expected (c, c):
    the expected curvature at these ratios; scale (c,): step sizes that matter; square : weighted residual sum of
    squares; triangle (k, k), along (k,): triangle b = along gives the least-squares solution.
    """

    ratios: Array
    value: float
    gradient: Array
    curvature: Array
    expected: Array
    scale: Array
    square: float
    triangle: Array
    along: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Data:
    """Triangular factors of the groups, source of each column, number of effects and residual degrees of freedom."""

    stack: Array
    source_of: Array
    k: int
    count: int

    def at(self, ratios: Array) -> _Point:
        """Evaluate log |V| + log |X' V^-1 X| + count log(y' P y), with P as in Searle et al. (1992), 6.6.

        V = I + sum r_j Z_j Z_j'. After weighting with its inverse square root, the sources are z, `basis` spans the
        effects, and `left` is y without them. So Z' P Z = z' z - shared shared', where z' z is block-diagonal with one
        block for each group.
        """
        z, x, y, logs = self._weighted(np.sqrt(self.source_of @ ratios), self.stack)
        found = _quadratic(z, x, y, self.source_of)
        n, square, squares = self.count, found.square, found.squares
        return _Point(
            ratios=ratios,
            value=logs + 2.0 * float(np.log(np.abs(np.diag(found.triangle))).sum()) + n * log(square),
            gradient=found.traces - n * squares / square,
            curvature=2.0 * n * found.cross / square - n * np.outer(squares, squares) / square**2 - found.overlap,
            expected=found.overlap - np.outer(found.traces, found.traces) / n,
            scale=1.0 / np.sqrt(np.diag(self.source_of.T @ (found.own**2).sum(axis=0) @ self.source_of)),
            square=square,
            triangle=found.triangle,
            along=found.along,
        )

    def moments(self, ratios: Array, residual: float) -> Moments:
        """Return the information about all variances. The residual is one more source, a column for each row."""
        groups, rows, m = *self.stack.shape[:2], len(self.source_of)
        with_residual = np.concatenate(
            [self.stack[:, :, :m], np.broadcast_to(np.eye(rows), (groups, rows, rows)), self.stack[:, :, m:]], axis=2
        )
        z, x, y, _ = self._weighted(np.sqrt(self.source_of @ ratios), with_residual)
        of = np.zeros((m + rows, self.source_of.shape[1] + 1))
        of[:m, :-1], of[m:, -1] = self.source_of, 1.0
        found = _quadratic(z, x, y, of)
        # A triangle has fewer or more rows than its group has trials; the difference is residual only.
        found.overlap[-1, -1] += self.count + self.k - groups * rows
        across, root = z.transpose(0, 2, 1) @ x, np.linalg.inv(found.triangle)
        parts = np.einsum("gmk,mi->igmk", across, of)
        return Moments(
            residual=residual,
            active=np.append(ratios > 0.0, True),
            unscaled=root @ root.T,
            first=np.einsum("igmk,gml->ikl", parts, across),
            second=np.einsum("igmk,gmn,jgnl->ijkl", parts, found.own, parts, optimize=True),
            expected=found.overlap,
            observed=2.0 * found.cross / residual - found.overlap,
        )

    def _weighted(self, spread: Array, stack: Array) -> tuple[Array, Array, Array, float]:
        """Return sources, effects and response, whitened by the inverse square root of V, and log |V|."""
        scaled = self.stack[:, :, : len(self.source_of)] * spread
        root = np.linalg.cholesky(np.eye(scaled.shape[1]) + scaled @ scaled.transpose(0, 2, 1))
        weighted = np.linalg.solve(root, stack)
        logs = 2.0 * float(np.log(np.diagonal(root, axis1=1, axis2=2)).sum())
        return weighted[:, :, : -self.k - 1], weighted[:, :, -self.k - 1 : -1], weighted[:, :, -1], logs


class _Quadratic(NamedTuple):
    """Least squares of the whitened data, and forms of the sources, with P and G_i as in `Moments`.

    traces: tr(P G_i); overlap: tr(P G_i P G_j); squares: y' P G_i P y; cross: y' P G_i P G_j P y; own: z' z.
    """

    triangle: Array
    along: Array
    square: float
    own: Array
    traces: Array
    overlap: Array
    squares: Array
    cross: Array


def _quadratic(z: Array, x: Array, y: Array, of: Array) -> _Quadratic:
    """Compute all forms without a matrix over all trials; `of` maps columns of z to sources."""
    basis, triangle = np.linalg.qr(x.reshape(-1, x.shape[2]))
    along = basis.T @ y.ravel()
    left = y - (basis @ along).reshape(y.shape)
    back = z.transpose(0, 2, 1)
    shared = back @ basis.reshape(x.shape)
    own, pulls = back @ z, (back @ left[:, :, None])[:, :, 0]
    taken = shared @ shared.transpose(0, 2, 1)
    between = np.einsum("gak,gal,aj->jkl", shared, shared, of).reshape(of.shape[1], -1)
    lost = np.einsum("ga,gak,aj->jk", pulls, shared, of)
    return _Quadratic(
        triangle=triangle,
        along=along,
        square=float((left**2).sum()),
        own=own,
        traces=np.einsum("gaa->a", own - taken) @ of,
        overlap=of.T @ (own * (own - 2.0 * taken)).sum(axis=0) @ of + between @ between.T,
        squares=(pulls**2).sum(axis=0) @ of,
        cross=of.T @ (pulls[:, :, None] * own * pulls[:, None, :]).sum(axis=0) @ of - lost @ lost.T,
    )


def _search(data: _Data, start: Array) -> tuple[_Point, bool]:
    """Minimise from a start by Newton steps over non-negative ratios; return the point and if it converged."""
    here = data.at(start)
    for _ in range(STEPS):
        step = _step(here)
        promised = -float(here.gradient @ step)
        for share in 0.5 ** np.arange(HALVINGS):
            there = data.at(np.clip(here.ratios + share * step, 0.0, LARGEST))
            if there.value <= here.value - 1e-4 * share * promised:
                break
        else:
            # No lower point nearby: converged, unless the step promised more than rounding explains.
            return here, promised < 1e4 * ENOUGH
        here = there
        if promised < ENOUGH or here.ratios.max() >= LARGEST:
            return here, True
    return here, False


def _step(here: _Point) -> Array:
    """Return the Newton step to non-negative ratios, by the expected curvature if the observed one is flat."""
    both = np.outer(here.scale, here.scale)
    scaled = here.curvature * both
    if np.linalg.eigvalsh(scaled)[0] < FLAT:
        scaled = here.expected * both + FLAT * np.eye(len(both))
    root = np.linalg.cholesky(scaled)
    lowest = root.T @ (here.ratios / here.scale) - np.linalg.solve(root, here.scale * here.gradient)
    there: Array = nnls(root.T, lowest)[0]
    return here.scale * there - here.ratios
