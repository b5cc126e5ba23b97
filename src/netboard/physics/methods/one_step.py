"""Explicit one-step methods.

Every method is a function ``step(x, h, hands, tables, parts, scene)`` of the same arguments, which the docstrings of
`netboard.physics` describe. `netboard.physics.methods.catalogue` lists the methods with their orders and nodes.
"""

import numpy as np

from netboard.base.compiled import inlined
from netboard.physics.arithmetic.vectors import State, blend, joined, places, plus, speeds
from netboard.physics.hands.extrapolation import drives
from netboard.physics.scene.models import rates
from netboard.physics.scene.parameters import Parts


@inlined
def moved(x: State, t: float, y: State, parts: Parts) -> State:
    """Advance the positions of a state by the velocities of another, and take over these velocities.

    Parameters
    ----------
    x : tuple of float
        State with the positions [SI].
    t : float
        Duration of the movement with these velocities [s].
    y : tuple of float
        State with the velocities [SI].
    """
    p = plus(places(x), t, speeds(y)) if parts.free else places(x)
    return joined(x[0] + t * y[1], y[1], x[2] + t * y[3], y[3], p, speeds(y))


@inlined
def euler(x: State, h: float, hands: np.void, tables: object, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of Euler's explicit method (order 1)."""
    left, right = drives(hands, 0, 0.0)
    return plus(x, h, rates(x, left, right, parts, scene))


@inlined
def semi_implicit(x: State, h: float, hands: np.void, tables: object, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of the semi-implicit method of Euler (order 1).

    First the velocities, then the positions with the new velocities (Hairer, Lubich and Wanner, Geometric Numerical
    Integration, I.1.2).
    """
    left, right = drives(hands, 0, 0.0)
    return moved(x, h, plus(x, h, rates(x, left, right, parts, scene)), parts)


@inlined
def heun(x: State, h: float, hands: np.void, tables: object, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of Heun's method, the explicit trapezoidal rule (order 2)."""
    left, right = drives(hands, 0, 0.0)
    k1 = rates(x, left, right, parts, scene)
    left, right = drives(hands, 1, h)
    k2 = rates(plus(x, h, k1), left, right, parts, scene)
    return blend(x, 0.5 * h, (1.0, 1.0), (k1, k2))


@inlined
def rk4(x: State, h: float, hands: np.void, tables: object, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of the classical Runge-Kutta method (order 4)."""
    half = 0.5 * h
    left, right = drives(hands, 0, 0.0)
    k1 = rates(x, left, right, parts, scene)
    left, right = drives(hands, 1, half)
    k2 = rates(plus(x, half, k1), left, right, parts, scene)
    k3 = rates(plus(x, half, k2), left, right, parts, scene)
    left, right = drives(hands, 2, h)
    k4 = rates(plus(x, h, k3), left, right, parts, scene)
    return blend(x, h / 6.0, (1.0, 2.0, 2.0, 1.0), (k1, k2, k3, k4))
