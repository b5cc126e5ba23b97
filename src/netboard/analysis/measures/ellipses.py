"""Strategy ellipses: centre, orientation and spread of a group of trials in the distance-velocity plane.

Centre: the mean. Rotation: the first principal component. Width and height: "the 90th percentile of the range of
variation" along the two components, a phrase with four readings. The components combine metres and metres per second,
so their directions depend on the units; these are SI, as printed in the paper.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Extent = Literal["middle_90", "twice_p90", "p10_to_p90", "nine_tenths"]
Scaling = Literal["si", "standardised"]

GROUP = 30
"""Number of trials in a group [1]."""

FEWEST = 3
"""Minimum number of trials for an ellipse [1]."""


@dataclass(frozen=True, slots=True)
class Ellipse:
    """Ellipse that contains most points of a group; all NaN for fewer than `FEWEST` points.

    Attributes
    ----------
    centre : ndarray, shape (2,)
        Mean of both quantities [m, m/s].
    components : ndarray, shape (2, 2)
        First and second principal components as unit row vectors. The first coordinate of the first component is not
        negative, and the second component lies 90 degrees counter-clockwise of the first [1].
    width, height : float
        Full extent along the first and the second component, in units of `scale` [1].
    scale : ndarray, shape (2,)
        Divisors of the two quantities: 1, or their standard deviations [m, m/s].
    count : int
        Number of points [1].
    """

    centre: NDArray[np.float64]
    components: NDArray[np.float64]
    width: float
    height: float
    scale: NDArray[np.float64]
    count: int

    @property
    def rotation(self) -> float:
        """Angle of the first component from the first axis, from -90 to 90 degrees [rad]."""
        return float(np.arctan2(self.components[0, 1], self.components[0, 0]))

    @property
    def area(self) -> float:
        """Area of the ellipse [m2/s]."""
        return float(np.pi / 4 * self.width * self.height * self.scale.prod())

    def outline(self, count: int = 100) -> NDArray[np.float64]:
        """Return points on the ellipse, once around, shape (count, 2) [m, m/s].

        Parameters
        ----------
        count : int
            Number of points [1].
        """
        turn = np.linspace(0, 2 * np.pi, count)
        radii = np.stack([self.width / 2 * np.cos(turn), self.height / 2 * np.sin(turn)], axis=1)
        return np.asarray(self.centre + (radii @ self.components) * self.scale)


def _extent(scores: NDArray[np.float64], extent: Extent) -> float:
    """Return the full extent of scores along a component."""
    if extent == "middle_90":
        low, high = np.percentile(scores, (5, 95))
    elif extent == "p10_to_p90":
        low, high = np.percentile(scores, (10, 90))
    elif extent == "nine_tenths":
        low, high = 0.9 * scores.min(), 0.9 * scores.max()
    else:
        high = np.percentile(np.abs(scores), 90)
        low = -high
    return float(high - low)


def ellipse(points: NDArray[np.float64], *, extent: Extent = "middle_90", scaling: Scaling = "si") -> Ellipse:
    """Return the ellipse of a group of points.

    Parameters
    ----------
    extent : {"middle_90", "twice_p90", "p10_to_p90", "nine_tenths"}
        Extent along a component: from the 5th to the 95th percentile of the scores, twice the 90th percentile of their
        magnitudes, from the 10th to the 90th percentile, or nine tenths of their range.
    scaling : {"si", "standardised"}
        Whether the components are computed from the quantities in SI units or from standardised quantities.
    """
    known = points[np.isfinite(points).all(axis=1)]
    scale = np.ones(2)
    if len(known) < FEWEST:
        nothing = np.full(2, np.nan)
        return Ellipse(nothing, np.full((2, 2), np.nan), np.nan, np.nan, scale, len(known))
    centre = known.mean(axis=0)
    if scaling == "standardised":
        deviations = known.std(axis=0, ddof=1)
        scale = np.where(deviations > 0, deviations, 1.0)
    centred = (known - centre) / scale
    across, up = np.linalg.svd(centred, full_matrices=False)[2][0]
    if across < 0 or (across == 0 and up < 0):
        across, up = -across, -up
    components = np.array([[across, up], [-up, across]])
    scores = centred @ components.T
    return Ellipse(centre, components, _extent(scores[:, 0], extent), _extent(scores[:, 1], extent), scale, len(known))


@dataclass(frozen=True, slots=True)
class Convergence:
    """Spread of the strategies in each group of trials, in the order of the groups.

    Attributes
    ----------
    groups : ndarray of int64, shape (k,)
        Number of each group, ascending [1].
    ellipses : tuple of Ellipse
        Ellipse of each group; all NaN for fewer than `FEWEST` points.
    variance : ndarray, shape (k, 2)
        Variances of distance and velocity; NaN for fewer than `FEWEST` points [m2, m2/s2].
    generalised : ndarray, shape (k,)
        Generalised variance: the determinant of the covariance matrix [m4/s2].
    """

    groups: NDArray[np.int64]
    ellipses: tuple[Ellipse, ...]
    variance: NDArray[np.float64]
    generalised: NDArray[np.float64]

    @property
    def areas(self) -> NDArray[np.float64]:
        """Area of each ellipse, shape (k,) [m2/s]."""
        return np.array([one.area for one in self.ellipses])


def groups_of(order: NDArray[np.int64], size: int = GROUP) -> NDArray[np.int64]:
    """Return the group of each trial: 0 for the first 30 trials of a condition, 1 for the next 30, and so on [1].

    Parameters
    ----------
    size : int
        Number of trials in a group [1].
    """
    return (order - 1) // size


def convergence(
    points: NDArray[np.float64], groups: NDArray[np.int64], *, extent: Extent = "middle_90", scaling: Scaling = "si"
) -> Convergence:
    """Return the ellipses and variances of the strategies in each group of trials.

    Pass the trials of one participant or dyad for their variances. The paper's ellipses pool the trials of all.

    Parameters
    ----------
    groups : ndarray of int64, shape (n,)
        Group of each trial, as `groups_of` numbers them [1].
    extent, scaling
        As for `ellipse`.
    """
    numbers = np.unique(groups)
    ellipses, variance, generalised = [], np.full((len(numbers), 2), np.nan), np.full(len(numbers), np.nan)
    for row, number in enumerate(numbers):
        own = points[groups == number]
        own = own[np.isfinite(own).all(axis=1)]
        ellipses.append(ellipse(own, extent=extent, scaling=scaling))
        if len(own) >= FEWEST:
            covariance = np.cov(own, rowvar=False)
            variance[row], generalised[row] = np.diag(covariance), np.linalg.det(covariance)
    return Convergence(numbers, tuple(ellipses), variance, generalised)
