"""Velocity from encoder positions: first-order adaptive windowing (Janabi-Sharifi, Hayward, Chen 2000).

The velocity is the slope from the newest position back to the oldest one for which all positions in between lie within
one encoder step of the straight line. Fast movements therefore use few samples, with little delay; slow ones use many,
with little noise. The estimate lags by half the window.

The longest window is a compromise. At 1 kHz, `SAMPLES` readings turn a single encoder step of a Touch into 7 mm/s,
which no longer shakes the paper's light board. The estimate is at most 4 ms late, which leaves the virtual coupling its
delay margin (CHAI3D's 15 ms window would halve it). `netboard.devices.contract.estimators` has other estimators for
comparison.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.devices.contract import estimators

SAMPLES = 9
"""Number of stored positions, one more than the intervals in the longest window [1]."""

SLACK = 1.01
"""Width of the band in encoder steps, slightly more than one to allow for rounding [1]."""


@inlined
def slope(stamps: NDArray[np.int64], values: NDArray[np.float64], count: int, band: float) -> float:
    """Return the slope over the longest window in which a straight line fits all values.

    A line from the newest value fits an older one if its slope is within ``band / elapsed time`` of the slope between
    the two. So one pass suffices, which narrows the interval of the slopes that fit all values so far.

    Parameters
    ----------
    stamps : ndarray of int64, shape (n,)
        Sample times, newest first [ns].
    values : ndarray, shape (n,)
        Sampled values, newest first.
    count : int
        Number of valid samples [1].
    band : float
        Largest deviation from the line, in the unit of the values.

    Returns
    -------
    float
        Slope, in the unit of the values per second; 0 with fewer than two values.
    """
    best, lowest, highest = 0.0, -np.inf, np.inf
    for last in range(1, count):
        per_second = 1e9 / (stamps[0] - stamps[last])
        rate = (values[0] - values[last]) * per_second
        if rate < lowest or rate > highest:
            break
        best = rate
        lowest, highest = max(lowest, rate - band * per_second), min(highest, rate + band * per_second)
    return best


@inlined
def taken(
    stamps: NDArray[np.int64],
    places: NDArray[np.float64],
    count: int,
    band: float,
    stamp_ns: int,
    place: tuple[float, ...],
) -> tuple[int, float, float, float]:
    """Add a position to the stored ones; return their number and the slope along each axis.

    Parameters
    ----------
    stamps : ndarray of int64, shape (SAMPLES,)
        Sample times, newest first [ns]; changed in place.
    places : ndarray, shape (3, SAMPLES)
        Positions [m]; changed in place.
    count : int
        Number of valid positions [1].
    band : float
        Largest deviation of a position from the line [m].
    stamp_ns : int
        Time of the new position; one not later than the newest replaces it [ns].
    place : tuple of float
        New position x, y, z [m].

    Returns
    -------
    tuple of int and float
        Number of positions [1] and velocity x, y, z [m/s].
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
    vx, vy = slope(stamps, places[0], count, band), slope(stamps, places[1], count, band)
    return count, vx, vy, slope(stamps, places[2], count, band)


class Estimator(Protocol):
    """Estimator of velocity from positions."""

    def update(self, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Add a position and return the velocity estimate [m/s]."""


class Velocimeter:
    """Adaptive-windowing estimator of stylus velocity.

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
        """Add a position and return the velocity estimate.

        Parameters
        ----------
        stamp_ns : int
            Time of the position; one not later than the newest replaces it [ns].
        x, y, z : float
            Position [m].

        Returns
        -------
        tuple of float
            Velocity x, y, z; 0 until the second position [m/s].
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
"""Constructor of each kind of estimator, called with the encoder step [m]."""


def make(kind: str, resolution: float) -> Estimator | None:
    """Create the estimator that the configuration names.

    Parameters
    ----------
    kind : str
        Value of ``agents.<side>.velocity``.
    resolution : float
        Size of one encoder step, 0 for none [m].

    Returns
    -------
    Estimator or None
        None for ``device``, which uses the device's own estimate.
    """
    return None if kind == "device" else KINDS[kind](resolution)
