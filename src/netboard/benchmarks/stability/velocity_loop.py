"""The sampled loop with a velocity estimator: a free mass, a spring-damper to a fixed point, a delayed force.

Each millisecond the position is read, the velocity estimated, and the force ``-k x - c v`` computed. The force acts for
one millisecond, after a delay of whole milliseconds. The mass is stepped exactly. Linear estimators are written as
linear systems, so that the whole loop is one matrix; runs use the estimators themselves.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import TICK_NS, TICK_SECONDS
from netboard.devices.contract.estimators import WINDOW_NS, alpha_beta_gains, kalman_gains
from netboard.devices.contract.velocity import KINDS
from netboard.participants.device_models import MODELS

Array = NDArray[np.float64]

IDEAL = "ideal"
"""Name of an estimator that knows the true velocity."""

TOUCH = MODELS["touch"]
"""The device."""

START = 0.01
"""Distance of the mass from its equilibrium at the release [m]."""

LARGEST = 60
"""Largest delay tried [ms]."""


@dataclass(frozen=True)
class Loop:
    """A mass on a virtual coupling.

    - `mass`: the mass [kg].
    - `b`: damping of the device [N s/m].
    - `stiffness`: stiffness of the coupling [N/m].
    - `damping`: damping of the coupling [N s/m].
    """

    mass: float
    b: float
    stiffness: float
    damping: float

    def step(self) -> tuple[Array, Array]:
        """Return the matrices of a tick for position and velocity, and for a constant force."""
        t, m, b = TICK_SECONDS, self.mass, self.b
        if b == 0.0:
            return np.array([[1.0, t], [0.0, 1.0]]), np.array([t * t / (2.0 * m), t / m])
        left = float(np.exp(-b * t / m))
        gone = m / b * (1.0 - left)
        return np.array([[1.0, gone], [0.0, left]]), np.array([(t - gone) / b, (1.0 - left) / b])


def linear_estimator(kind: str) -> tuple[Array, Array, Array, float]:
    """Return an estimator as a linear system: next state = A state + B position, velocity = C state + D position."""
    if kind in ("difference", "chai3d"):
        n = 1 if kind == "difference" else WINDOW_NS // TICK_NS
        span = n * TICK_SECONDS
        return np.eye(n, k=-1), np.eye(n)[0], -np.eye(n)[-1] / span, 1.0 / span
    if kind not in ("alpha_beta", "kalman"):
        raise ValueError(f"the estimator {kind} is not linear")
    order = 2 if kind == "alpha_beta" else 3
    gains = np.array(alpha_beta_gains() if kind == "alpha_beta" else kalman_gains(TOUCH.resolution))[:order]
    motion = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])[:order, :order]
    closed = motion - np.outer(gains, motion[0])
    return closed, gains, closed[1] / TICK_SECONDS, float(gains[1]) / TICK_SECONDS


def radius_of(loop: Loop, kind: str, delay: int) -> float:
    """Return the spectral radius of the whole loop, which is stable below 1."""
    by_itself, by_force = loop.step()
    a, b, c, d = linear_estimator(kind) if kind != IDEAL else (np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0)
    inner = len(b)
    size = 2 + inner + delay
    force = np.zeros(size)
    force[0] = -loop.stiffness - loop.damping * d
    force[1] = -loop.damping if kind == IDEAL else 0.0
    force[2 : 2 + inner] = -loop.damping * c
    whole = np.zeros((size, size))
    whole[:2, :2] = by_itself
    whole[2 : 2 + inner, 2 : 2 + inner] = a
    whole[2 : 2 + inner, 0] = b
    if delay == 0:
        whole[:2] += np.outer(by_force, force)
    else:
        whole[:2, -1] += by_force
        whole[2 + inner] = force
        whole[3 + inner :, 2 + inner : -1] = np.eye(delay - 1)
    return float(np.abs(np.linalg.eigvals(whole)).max())


def settles(loop: Loop, kind: str, delay: int, seconds: float) -> bool:
    """Return whether the released mass swings less in the last quarter, in a run with encoder steps."""
    meter = KINDS[kind](TOUCH.resolution) if kind != IDEAL else None
    ((_, xv), (_, vv)), (xf, vf) = (part.tolist() for part in loop.step())
    x, v, largest = START, 0.0, 0.0
    coming = [0.0] * delay
    ticks = round(seconds / TICK_SECONDS)
    for k in range(ticks):
        seen = round(x / TOUCH.resolution) * TOUCH.resolution
        rate = v if meter is None else meter.update(k * TICK_NS, 0.0, 0.0, seen)[2]
        coming.append(-loop.stiffness * seen - loop.damping * rate)
        force = coming.pop(0)
        x, v = x + xv * v + xf * force, vv * v + vf * force
        if abs(x) > 10.0 * START:
            return False
        if k > 3 * ticks // 4:
            largest = max(largest, abs(x))
    return largest < START


def largest_delay(loop: Loop, kind: str) -> int:
    """Return the largest delay at which the loop is stable, by its eigenvalues."""
    return _largest(lambda delay: radius_of(loop, kind, delay) < 1.0)


def largest_played(loop: Loop, kind: str, seconds: float) -> int:
    """Return the largest delay at which a run settles."""
    return _largest(lambda delay: settles(loop, kind, delay, seconds))


def _largest(holds: Callable[[int], bool]) -> int:
    """Return the last stable delay before the first unstable one [ms]."""
    delay = -1
    while delay < LARGEST and holds(delay + 1):
        delay += 1
    return delay
