"""More ways to velocity from encoder positions, beside adaptive windowing: what other systems do, to compare with.

A difference is quick and rough. CHAI3D's window of 15 ms is smooth and 7.5 ms late; who repeats an experiment that was
made with CHAI3D damps with it. An alpha-beta filter forgets by the sample instead, and a Kalman filter with constant
acceleration has no lag where the speed changes evenly. What each costs and gains: docs/explanation/velocity.md.

Rule 1: the first position gives no velocity, the second one the slope between the two.
Rule 2: a position whose stamp is not later than that of the newest takes its place.
Rule 3: after a gap longer than `GAP_NS` a filter starts anew, from the slope over the gap.
"""

from typing import final

import numba
import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import TICK_SECONDS

WINDOW_NS = 15_000_000
"""CHAI3D's window [ns]."""

CAPACITY = 64
"""Positions a window can hold: enough for a reading every 0.25 ms [1]."""

GAP_NS = 20_000_000
"""A longer time between two positions is too long for a filter to predict over [ns]."""

SHORTEST = 0.5 * TICK_SECONDS
"""Two positions that are closer together correct a filter as if they were so far apart: an encoder step within a few
microseconds is no speed [s]."""

FORGET = 0.6
"""What an alpha-beta filter leaves of an error from one sample to the next, in position and in velocity [1]."""

JERK = 100.0
"""Spectral density of a hand's jerk that the Kalman filter reckons with: some 20 m/s3 for 0.1 s [m2/s5]."""

FINEST = 1e-6
"""Smallest encoder step that the Kalman filter reckons with [m]."""

_MOTION = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
"""A tick of movement with constant acceleration: position, velocity and acceleration, all in metres per tick."""

_STIR = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
"""Covariance of what white jerk of density 1 makes of that in a tick."""


@final
class Window:
    """Slope over a fixed window: the newest position less the one at its far end.

    The far end is the newest position that is at least `span_ns` older, or the oldest one there is. With a span of no
    time it is the position before: a first difference.

    Parameters
    ----------
    span_ns : int
        Length of the window [ns].
    """

    def __init__(self, span_ns: int) -> None:
        self._span_ns = span_ns
        self._stamps_ns = np.zeros(CAPACITY, np.int64)
        self._places = np.zeros((CAPACITY, 3))
        self._count = 0

    def update(self, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Take a position and estimate the velocity.

        Parameters
        ----------
        stamp_ns : int
            When the position was read; one not later than the newest known replaces it [ns].
        """
        self._count, vx, vy, vz = _windowed(
            self._stamps_ns, self._places, self._count, self._span_ns, stamp_ns, (x, y, z)
        )
        return vx, vy, vz


@numba.njit(cache=True)
def _windowed(
    stamps: NDArray[np.int64],
    places: NDArray[np.float64],
    count: int,
    span_ns: int,
    stamp_ns: int,
    place: tuple[float, ...],
) -> tuple[int, float, float, float]:
    """Take a position into the ring; how many were taken, and the slope over the window along each axis."""
    size = len(stamps)
    last = (count - 1) % size
    if count == 0 or stamp_ns > stamps[last]:
        count += 1
        last = (count - 1) % size
        stamps[last] = stamp_ns
    for axis in range(3):
        places[last, axis] = place[axis]
    if count == 1:
        return count, 0.0, 0.0, 0.0
    back = 1
    while back < min(count, size) - 1 and stamps[last] - stamps[(last - back) % size] < span_ns:
        back += 1
    there, far = places[last], places[(last - back) % size]
    dt = (stamps[last] - stamps[(last - back) % size]) * 1e-9
    return count, (there[0] - far[0]) / dt, (there[1] - far[1]) / dt, (there[2] - far[2]) / dt


@final
class Observer:
    """A filter that predicts with constant acceleration and corrects by gains: alpha-beta-gamma.

    Its memory is counted in samples: gains are shares of what the prediction missed, whatever the time between two.

    Parameters
    ----------
    gains : tuple of float
        Share of what was missed that goes into position, velocity and acceleration, over one, the first and the second
        power of the time between two samples; the last may be 0, for a constant velocity [1].
    """

    def __init__(self, gains: tuple[float, float, float]) -> None:
        self._gains = gains
        self._stamps_ns = np.zeros(2, np.int64)
        self._states = np.zeros((2, 3, 3))
        self._count = 0

    def update(self, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Take a position and estimate the velocity.

        Parameters
        ----------
        stamp_ns : int
            When the position was read; one not later than the newest known replaces it [ns].
        """
        self._count, vx, vy, vz = _observed(
            self._stamps_ns, self._states, self._count, self._gains, stamp_ns, (x, y, z)
        )
        return vx, vy, vz


@numba.njit(cache=True)
def _observed(
    stamps: NDArray[np.int64],
    states: NDArray[np.float64],
    count: int,
    gains: tuple[float, float, float],
    stamp_ns: int,
    place: tuple[float, ...],
) -> tuple[int, float, float, float]:
    """Predict from the state before (row 0) and correct into the one now (row 1); how many positions there were."""
    if count == 0 or stamp_ns > stamps[1]:
        stamps[0], states[0] = stamps[1], states[1]
        stamps[1] = stamp_ns
        count += 1
    since_ns = stamps[1] - stamps[0]
    dt = since_ns * 1e-9
    apart = max(dt, SHORTEST)
    for axis in range(3):
        x, v, a = states[0, axis, 0], states[0, axis, 1], states[0, axis, 2]
        if count == 1:
            x, v, a = place[axis], 0.0, 0.0
        elif count == 2 or since_ns > GAP_NS:
            x, v, a = place[axis], (place[axis] - x) / dt, 0.0
        else:
            x, v = x + dt * (v + 0.5 * dt * a), v + dt * a
            missed = place[axis] - x
            x, v, a = x + gains[0] * missed, v + gains[1] * missed / apart, a + gains[2] * missed / (apart * apart)
        states[1, axis, 0], states[1, axis, 1], states[1, axis, 2] = x, v, a
    return count, states[1, 0, 1], states[1, 1, 1], states[1, 2, 1]


def alpha_beta_gains(forget: float = FORGET) -> tuple[float, float, float]:
    """Gains of an alpha-beta filter that forgets position and velocity alike (critically damped).

    In the steady state of a constant acceleration its velocity is ``alpha / beta - 1/2`` samples late.

    Parameters
    ----------
    forget : float
        What it leaves of an error from one sample to the next [1].
    """
    return 1.0 - forget * forget, (1.0 - forget) ** 2, 0.0


def kalman_gains(resolution: float, jerk: float = JERK) -> tuple[float, float, float]:
    """Gains of the steady Kalman filter for constant acceleration, white jerk and a reading each tick.

    What an encoder step hides counts as white noise of variance ``resolution**2 / 12``. The Riccati equation is
    iterated until it no longer moves.

    Parameters
    ----------
    resolution : float
        Size of one encoder step, 0 for none; at least `FINEST` is reckoned with [m].
    """
    hidden = max(resolution, FINEST) ** 2 / 12.0
    stir = jerk * TICK_SECONDS**5 / hidden * _STIR
    spread, before = np.eye(3), np.zeros((3, 3))
    while np.abs(spread - before).max() > 1e-13 * np.abs(spread).max():
        before = spread
        ahead = _MOTION @ spread @ _MOTION.T + stir
        gains = ahead[:, 0] / (ahead[0, 0] + 1.0)
        spread = ahead - np.outer(gains, ahead[0])
    alpha, beta, gamma = (float(gain) for gain in gains)
    return alpha, beta, gamma


def difference() -> Window:
    """First difference: the newest position less the one before."""
    return Window(0)


def chai3d() -> Window:
    """CHAI3D's estimate."""
    return Window(WINDOW_NS)


def alpha_beta() -> Observer:
    """An alpha-beta filter."""
    return Observer(alpha_beta_gains())


def kalman(resolution: float) -> Observer:
    """The steady Kalman filter of a device."""
    return Observer(kalman_gains(resolution))
