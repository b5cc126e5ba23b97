"""Small-sample inference for fixed effects: the methods of Satterthwaite and of Kenward and Roger.

The covariance of the coefficients treats the estimated variances as the true ones. With few dyads they are uncertain,
so the ratio of an effect to its standard error has heavier tails than the normal distribution. Both methods approximate
it by Student's t::

    Satterthwaite   2 v^2 / (g' A g),   v = l' Phi l, g its gradient by the variances, A their asymptotic covariance
    Kenward-Roger   the same with the expected information, and a covariance Phi that is enlarged for the uncertainty
                    of the variances and for its own bias (Kenward and Roger, Biometrics 53:983, 1997)

A variance that is estimated as 0 lies on the boundary of its range. Satterthwaite's method treats it as known, like
lmerTest. Kenward and Roger's method treats it as uncertain, like pbkrtest.
"""

import numpy as np
from numpy.typing import NDArray

from netboard.analysis.statistics.restricted import Moments

Array = NDArray[np.float64]


def satterthwaite_freedom(moments: Moments, contrast: Array) -> float:
    """Return Satterthwaite's degrees of freedom of a combination of coefficients; infinite for a known variance [1].

    As in lmerTest (Kuznetsova et al., J. Stat. Softw. 82:13, 2017): with the observed information about the variances.
    """
    active = moments.active
    inverse = _inverse(moments.observed[np.ix_(active, active)])
    return _freedom(moments, contrast, active, inverse)


def kenward_roger_freedom(moments: Moments, contrast: Array) -> float:
    """Return Kenward and Roger's degrees of freedom of a linear combination of coefficients [1].

    As in pbkrtest (Halekoh and Hojsgaard, J. Stat. Softw. 59:9, 2014); for one combination the scale of their F is 1.
    """
    return _freedom(moments, contrast, np.ones_like(moments.active), _inverse(moments.expected))


def kenward_roger_covariance(moments: Moments) -> Array:
    """Return Kenward and Roger's covariance of the coefficients, shape (k, k) [square of a coefficient's].

    It is adjusted for the uncertainty of the variances.
    """
    c, first = moments.unscaled, moments.first
    doubt = moments.second - np.einsum("iab,bc,jcd->ijad", first, c, first, optimize=True)
    added = c @ np.einsum("ij,ijab->ab", _inverse(moments.expected), doubt) @ c
    # Their factor 2, times 2: the variances' covariance is twice the inverse of `expected`. The mean with the transpose
    # removes rounding errors.
    enlarged: Array = moments.residual * (c + 4.0 * 0.5 * (added + added.T))
    return enlarged


def _freedom(moments: Moments, contrast: Array, of: NDArray[np.bool_], inverse: Array) -> float:
    """Return 2 v^2 / var(v); the residual variance cancels, and the 2, because `inverse` is half of a covariance."""
    along = moments.unscaled @ contrast
    gradient = np.einsum("a,iab,b->i", along, moments.first, along)[of]
    spread = float(gradient @ inverse @ gradient)
    return float(contrast @ along) ** 2 / spread if spread > 0.0 else np.inf


def _inverse(information: Array) -> Array:
    """Return the pseudo-inverse of the information about the variances; null directions add nothing."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    known = values > 1e-10 * values[-1]
    roots = vectors[:, known] / np.sqrt(values[known]) * scale[:, None]
    inverse: Array = roots @ roots.T
    return inverse
