"""Velocity estimators of other systems, for comparison with adaptive windowing.

A first difference is fast and noisy. CHAI3D's window of 15 ms is smooth but 7.5 ms late; choose it to reproduce an
experiment that used CHAI3D. An alpha-beta filter has exponential memory, and a Kalman filter with constant acceleration
has no lag while the acceleration is constant. docs/explanation/velocity.md compares their costs and benefits.

Rule 1: the first position gives zero velocity, the second one the slope between the two.
Rule 2: a position whose time stamp is not later than the newest one replaces it.
Rule 3: after a gap longer than `GAP_NS` a filter restarts from the slope over the gap.
Rule 4: after a position that is not finite a filter restarts at zero velocity.
"""

from math import isfinite
from typing import final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import kernel
from netboard.base.tick import TICK_SECONDS

WINDOW_NS = 15_000_000
"""CHAI3D's window [ns]."""

CAPACITY = 64
"""Capacity of the window in positions: enough for a reading every 0.25 ms [1]."""

GAP_NS = 20_000_000
"""Longest gap over which a filter predicts [ns]."""

MIN_INTERVAL = 0.5 * TICK_SECONDS
"""Shortest sample interval in a filter's correction [s].

An encoder step within a few microseconds is not a velocity.
"""

FORGET = 0.6
"""Fraction of an error that an alpha-beta filter keeps from one sample to the next, in position and velocity [1]."""

JERK = 100.0
"""Spectral density of the hand's jerk in the Kalman filter: about 20 m/s3 for 0.1 s [m2/s5]."""

MIN_RESOLUTION = 1e-6
"""Smallest encoder step that the Kalman filter assumes [m]."""

_MOTION = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
"""State transition of one tick at constant acceleration, with all states in metres per tick."""

_JERK_NOISE = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
"""Process noise covariance of one tick for white jerk of density 1."""


@final
class Window:
    """Slope over a fixed window, from its oldest position to the newest.

    The window starts at the newest position that is at least `span_ns` older than the latest, or at the oldest stored
    one. With a span of 0 it starts at the previous position, which gives a first difference.

    ``span_ns``: length of the window [ns].
    """

    def __init__(self, span_ns: int) -> None:
        self._span_ns = span_ns
        self._stamps_ns = np.zeros(CAPACITY, np.int64)
        self._places = np.zeros((CAPACITY, 3))
        self._count = 0

    def update(self, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Add a position and return the velocity estimate; one not later than the newest replaces it."""
        self._count, vx, vy, vz = _windowed(
            self._stamps_ns, self._places, self._count, self._span_ns, stamp_ns, (x, y, z)
        )
        return vx, vy, vz


@kernel
def _windowed(
    stamps: NDArray[np.int64],
    places: NDArray[np.float64],
    count: int,
    span_ns: int,
    stamp_ns: int,
    place: tuple[float, ...],
) -> tuple[int, float, float, float]:
    """Add a position to the ring buffer; return the number of positions and the slope along each axis."""
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
    newest, oldest = places[last], places[(last - back) % size]
    dt = (stamps[last] - stamps[(last - back) % size]) * 1e-9
    return count, (newest[0] - oldest[0]) / dt, (newest[1] - oldest[1]) / dt, (newest[2] - oldest[2]) / dt


@final
class Observer:
    """Alpha-beta-gamma filter: predicts with constant acceleration and corrects by fixed gains.

    Its memory is a number of samples, not a duration: the gains do not depend on the sample interval.

    ``gains``: fractions of the prediction error added to position, velocity and acceleration; the last two are divided
    by the sample interval and its square. The last gain may be 0, for constant velocity.
    """

    def __init__(self, gains: tuple[float, float, float]) -> None:
        self._gains = gains
        self._stamps_ns = np.zeros(2, np.int64)
        self._states = np.zeros((2, 3, 3))
        self._count = 0

    def update(self, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Add a position and return the velocity estimate; one not later than the newest replaces it."""
        self._count, vx, vy, vz = _observed(
            self._stamps_ns, self._states, self._count, self._gains, stamp_ns, (x, y, z)
        )
        return vx, vy, vz


@kernel
def _observed(
    stamps: NDArray[np.int64],
    states: NDArray[np.float64],
    count: int,
    gains: tuple[float, float, float],
    stamp_ns: int,
    place: tuple[float, ...],
) -> tuple[int, float, float, float]:
    """Predict from the previous state (row 0), correct into the current one (row 1); return the count and velocity."""
    if count == 0 or stamp_ns > stamps[1]:
        stamps[0], states[0] = stamps[1], states[1]
        stamps[1] = stamp_ns
        count += 1
    since_ns = stamps[1] - stamps[0]
    dt = since_ns * 1e-9
    span = max(dt, MIN_INTERVAL)
    for axis in range(3):
        x, v, a = states[0, axis, 0], states[0, axis, 1], states[0, axis, 2]
        if count == 1 or not isfinite(x):
            x, v, a = place[axis], 0.0, 0.0
        elif count == 2 or since_ns > GAP_NS:
            x, v, a = place[axis], (place[axis] - x) / dt, 0.0
        else:
            x, v = x + dt * (v + 0.5 * dt * a), v + dt * a
            error = place[axis] - x
            x, v, a = x + gains[0] * error, v + gains[1] * error / span, a + gains[2] * error / (span * span)
        states[1, axis, 0], states[1, axis, 1], states[1, axis, 2] = x, v, a
    return count, states[1, 0, 1], states[1, 1, 1], states[1, 2, 1]


def alpha_beta_gains() -> tuple[float, float, float]:
    """Return the gains of a critically damped alpha-beta filter.

    Under constant acceleration its velocity estimate lags by ``alpha / beta - 1/2`` samples.
    """
    return 1.0 - FORGET * FORGET, (1.0 - FORGET) ** 2, 0.0


def kalman_gains(resolution: float) -> tuple[float, float, float]:
    """Return the steady-state gains of a Kalman filter for constant acceleration, white jerk and one reading per tick.

    Quantisation by the encoder counts as white noise of variance ``resolution**2 / 12``. The Riccati equation is
    iterated to convergence.

    ``resolution``: size of one encoder step, 0 for none; `MIN_RESOLUTION` is the lower bound [m].
    """
    variance = max(resolution, MIN_RESOLUTION) ** 2 / 12.0
    noise = JERK * TICK_SECONDS**5 / variance * _JERK_NOISE
    covariance, before = np.eye(3), np.zeros((3, 3))
    while np.abs(covariance - before).max() > 1e-13 * np.abs(covariance).max():
        before = covariance
        ahead = _MOTION @ covariance @ _MOTION.T + noise
        gains = ahead[:, 0] / (ahead[0, 0] + 1.0)
        covariance = ahead - np.outer(gains, ahead[0])
    alpha, beta, gamma = (float(gain) for gain in gains)
    return alpha, beta, gamma


def difference() -> Window:
    """Return a first-difference estimator: the slope between the last two positions."""
    return Window(0)


def chai3d() -> Window:
    """Return CHAI3D's estimator."""
    return Window(WINDOW_NS)


def alpha_beta() -> Observer:
    """Return an alpha-beta filter."""
    return Observer(alpha_beta_gains())


def kalman(resolution: float) -> Observer:
    """Return the steady-state Kalman filter for a device."""
    return Observer(kalman_gains(resolution))
