"""Velocity from encoder positions: first-order adaptive windowing (Janabi-Sharifi, Hayward, Chen 2000).

The velocity is the slope from the newest position back to the oldest one for which all positions between lie within
one encoder step of the straight line. So a fast movement is judged over few samples, with little delay, and a slow one
over many, with little noise. The estimate is late by half the window it used. The longest window is a compromise: at
1 kHz `SAMPLES` readings make a single encoder step of a Touch look like 7 mm/s, which no longer shakes the paper's
light board, and the estimate is late by 4 ms at most, which leaves the virtual spring the delay it can stand (CHAI3D's
15 ms window would halve that). The other kinds there are, for comparison, are in
`netboard.devices.contract.estimators`.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from netboard.devices.contract import estimators

SAMPLES = 9
"""Positions remembered, so one more than the longest window [1]."""

SLACK = 1.01
"""Width of the band in encoder steps; a little more than one, for rounding [1]."""


@numba.njit(cache=True)
def slope(times: NDArray[np.float64], values: NDArray[np.float64], count: int, band: float) -> float:
    """Slope over the longest window in which a straight line explains all values.

    Parameters
    ----------
    times : ndarray, shape (n,)
        When the values were read, newest first [s].
    values : ndarray, shape (n,)
        What was read, newest first.
    count : int
        How many of them are there [1].
    band : float
        How far a value may be off the line, in the unit of the values.

    Returns
    -------
    float
        In the unit of the values per second; 0 with fewer than two values.
    """
    best = 0.0
    for last in range(1, count):
        rate = (values[0] - values[last]) / (times[0] - times[last])
        for i in range(1, last):
            if abs(values[0] - rate * (times[0] - times[i]) - values[i]) > band:
                return best
        best = rate
    return best


@numba.njit(cache=True)
def taken(
    stamps: NDArray[np.int64],
    places: NDArray[np.float64],
    count: int,
    band: float,
    stamp_ns: int,
    place: tuple[float, ...],
) -> tuple[int, float, float, float]:
    """Take a position into the memory; how many there are now, and the slope along each axis.

    Parameters
    ----------
    stamps : ndarray of int64, shape (SAMPLES,)
        When the positions were read, newest first [ns]; changed in place.
    places : ndarray, shape (3, SAMPLES)
        The positions [m]; changed in place.
    count : int
        How many of them are there [1].
    band : float
        How far a position may be off the line [m].
    stamp_ns : int
        When the new one was read; one not later than the newest known replaces it [ns].
    place : tuple of float
        The new position x, y, z [m].

    Returns
    -------
    tuple of int and float
        How many positions there are now [1], and the velocity x, y, z [m/s].
    """
    if count == 0 or stamp_ns > stamps[0]:
        for k in range(SAMPLES - 1, 0, -1):
            stamps[k] = stamps[k - 1]
            for axis in range(3):
                places[axis, k] = places[axis, k - 1]
        count = min(count + 1, SAMPLES)
        stamps[0] = stamp_ns
    for axis in range(3):
        places[axis, 0] = place[axis]
    times = (stamps - stamps[0]) * 1e-9
    vx, vy = slope(times, places[0], count, band), slope(times, places[1], count, band)
    return count, vx, vy, slope(times, places[2], count, band)


class Estimator(Protocol):
    """Makes velocities of positions."""

    def update(self, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Take a position and estimate the velocity [m/s]."""


class Velocimeter:
    """Velocity of a stylus from its positions.

    Parameters
    ----------
    resolution : float
        Size of one encoder step, 0 for none [m].
    """

    def __init__(self, resolution: float) -> None:
        self._band = SLACK * resolution
        self._stamps_ns = np.zeros(SAMPLES, np.int64)
        self._places = np.zeros((3, SAMPLES))
        self._count = 0

    def update(self, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Take a position and estimate the velocity.

        Parameters
        ----------
        stamp_ns : int
            When the position was read; one not later than the newest known replaces it [ns].
        x, y, z : float
            The position [m].

        Returns
        -------
        tuple of float
            Velocity x, y, z; 0 before the second position [m/s].
        """
        self._count, vx, vy, vz = taken(self._stamps_ns, self._places, self._count, self._band, stamp_ns, (x, y, z))
        return vx, vy, vz


KINDS: Mapping[str, Callable[[float], Estimator]] = {
    "adaptive": Velocimeter,
    "chai3d": lambda resolution: estimators.chai3d(),
    "difference": lambda resolution: estimators.difference(),
    "alpha_beta": lambda resolution: estimators.alpha_beta(),
    "kalman": estimators.kalman,
}
"""What makes an estimator of each kind, for an encoder step."""


def make(kind: str, resolution: float) -> Estimator | None:
    """Estimator of a kind that the configuration names.

    Parameters
    ----------
    kind : str
        As in ``agents.<side>.velocity``.
    resolution : float
        Size of one encoder step, 0 for none [m].

    Returns
    -------
    Estimator or None
        None for ``device``: its own estimate stands.
    """
    return None if kind == "device" else KINDS[kind](resolution)
