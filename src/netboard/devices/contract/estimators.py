"""Velocity estimators of other systems, for comparison with adaptive windowing.

A first difference is fast and noisy. CHAI3D's window of 15 ms is smooth but 7.5 ms late; choose it to reproduce an
experiment that used CHAI3D. An alpha-beta filter has exponential memory, and a Kalman filter with constant acceleration
has no lag while the acceleration is constant. docs/explanation/velocity.md compares their costs and benefits.

Rule 1: the first position gives zero velocity, the second one the slope between the two.
Rule 2: a position whose time stamp is not later than the newest one replaces it.
Rule 3: after a gap longer than `GAP_NS` a filter restarts from the slope over the gap.
Rule 4: after a position that is not finite a filter restarts at zero velocity.
"""

from collections.abc import Callable
from math import isfinite
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, kernel, machine_code
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


SLOPE = np.dtype(
    [
        ("span_ns", "<i8"),  # length of the window [ns]
        ("count", "<i8"),  # positions so far [1]
        ("stamps", "<i8", (CAPACITY,)),  # times of the last ones, a ring buffer [ns]
        ("places", "<f8", (CAPACITY, 3)),  # these positions [m]
    ]
)
"""State of a window."""


@kernel
def slope_velocity(state: Records, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Add a position to an array of one `SLOPE`, and return the slope along each axis [m/s]."""
    s = state[0]
    stamps, places = s["stamps"], s["places"]
    size = len(stamps)
    last = (s["count"] - 1) % size
    if s["count"] == 0 or stamp_ns > stamps[last]:
        s["count"] += 1
        last = (s["count"] - 1) % size
        stamps[last] = stamp_ns
    places[last, 0], places[last, 1], places[last, 2] = x, y, z
    if s["count"] == 1:
        return 0.0, 0.0, 0.0
    back = 1
    while back < min(s["count"], size) - 1 and stamps[last] - stamps[(last - back) % size] < s["span_ns"]:
        back += 1
    newest, oldest = places[last], places[(last - back) % size]
    dt = (stamps[last] - stamps[(last - back) % size]) * 1e-9
    return (newest[0] - oldest[0]) / dt, (newest[1] - oldest[1]) / dt, (newest[2] - oldest[2]) / dt


FILTER = np.dtype(
    [
        ("gains", "<f8", (3,)),  # shares of an error of prediction [1]
        ("count", "<i8"),  # positions so far [1]
        ("stamps", "<i8", (2,)),  # times of the previous position and of the newest [ns]
        ("states", "<f8", (2, 3, 3)),  # their position, velocity and acceleration along each axis
    ]
)
"""State of an alpha-beta-gamma filter."""


@kernel
def filtered_velocity(state: Records, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Predict from the previous state, correct by a position; an array of one `FILTER`; return the velocity [m/s]."""
    f = state[0]
    stamps, states, gains = f["stamps"], f["states"], f["gains"]
    if f["count"] == 0 or stamp_ns > stamps[1]:
        stamps[0] = stamps[1]
        for axis in range(3):
            for order in range(3):
                states[0, axis, order] = states[1, axis, order]
        stamps[1] = stamp_ns
        f["count"] += 1
    count, since_ns, place = f["count"], stamps[1] - stamps[0], (x, y, z)
    dt = since_ns * 1e-9
    span = max(dt, MIN_INTERVAL)
    for axis in range(3):
        p, v, a = states[0, axis, 0], states[0, axis, 1], states[0, axis, 2]
        if count == 1 or not isfinite(p):
            p, v, a = place[axis], 0.0, 0.0
        elif count == 2 or since_ns > GAP_NS:
            p, v, a = place[axis], (place[axis] - p) / dt, 0.0
        else:
            p, v = p + dt * (v + 0.5 * dt * a), v + dt * a
            error = place[axis] - p
            p, v, a = p + gains[0] * error, v + gains[1] * error / span, a + gains[2] * error / (span * span)
        states[1, axis, 0], states[1, axis, 1], states[1, axis, 2] = p, v, a
    return states[1, 0, 1], states[1, 1, 1], states[1, 2, 1]


class Estimator:
    """Estimator of velocity from positions.

    ``kernel``: adds a position to the ``state``, an array of one record, and returns the velocity.
    """

    def __init__(self, kernel: Callable[..., tuple[float, float, float]], state: NDArray[Any]) -> None:
        self.kernel, self.state = kernel, state
        self._update = machine_code(kernel, state, 0, 0.0, 0.0, 0.0)

    @final
    def update(self, stamp_ns: int, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Add a position [m] and return the velocity estimate [m/s]; one not later than the newest replaces it."""
        return self._update(self.state, stamp_ns, x, y, z)


@final
class WindowEstimator(Estimator):
    """Slope over a fixed window, from its oldest position to the newest.

    The window starts at the newest position that is at least `span_ns` older than the latest, or at the oldest stored
    one. With a span of 0 it starts at the previous position, which gives a first difference.

    ``span_ns``: length of the window [ns].
    """

    def __init__(self, span_ns: int) -> None:
        state = np.zeros(1, SLOPE)
        state["span_ns"] = span_ns
        super().__init__(slope_velocity, state)


@final
class Observer(Estimator):
    """Alpha-beta-gamma filter: predicts with constant acceleration and corrects by fixed gains.

    Its memory is a number of samples, not a duration: the gains do not depend on the sample interval.

    ``gains``: fractions of the prediction error added to position, velocity and acceleration; the last two are divided
    by the sample interval and its square. The last gain may be 0, for constant velocity.
    """

    def __init__(self, gains: tuple[float, float, float]) -> None:
        state = np.zeros(1, FILTER)
        state["gains"] = gains
        super().__init__(filtered_velocity, state)


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


def difference() -> WindowEstimator:
    """Return a first-difference estimator: the slope between the last two positions."""
    return WindowEstimator(0)


def chai3d() -> WindowEstimator:
    """Return CHAI3D's estimator."""
    return WindowEstimator(WINDOW_NS)


def alpha_beta() -> Observer:
    """Return an alpha-beta filter."""
    return Observer(alpha_beta_gains())


def kalman(resolution: float) -> Observer:
    """Return the steady-state Kalman filter for a device."""
    return Observer(kalman_gains(resolution))
