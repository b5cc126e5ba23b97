"""Implicit one-step methods: in the velocities (Verlet), or in the whole state (midpoint rule).

Both solve a nonlinear equation for the velocities by a simplified Newton iteration. Its matrix has inertia, damping and
stiffness of board and couplings at the present tilt: two equations, solved in closed form. The neglected terms
(weights, squares of velocities, friction of balls) change little in a step, so each iteration removes most of the
error.
"""

from math import sqrt

import numpy as np

from netboard.base.compiled import inlined
from netboard.physics.arithmetic.vectors import State, affine, alike, dot, joined, plus, speeds
from netboard.physics.hands.extrapolation import drives
from netboard.physics.methods.one_step import moved
from netboard.physics.scene.models import inertia, rates, solved, turned
from netboard.physics.scene.parameters import Parts

MAX_ITERATIONS = 50
"""Largest number of iterations; three to eight are usual."""

TOLERANCE = 1e-16
"""The iteration ends when it moves the board by no more than this in a step [m]."""

MIN_ITERATIONS = 2
"""After this many iterations it also ends when the change no longer decreases."""


@inlined
def _inertia(y: State, s: float, c: float, parts: Parts, scene: np.void) -> tuple[float, float, float]:
    """Return the inertia against heave, heave with tilt, and tilt [kg, kg m, kg m2]."""
    if parts.lagrangian:
        return inertia(y, s, c, parts, scene)
    return scene["M"], 0.0, scene["I"]


@inlined
def _corrected(
    y: State, residual_z: float, residual_o: float, t: float, reach: float, parts: Parts, scene: np.void
) -> tuple[float, float]:
    """Return the Newton steps of the velocities of heave and tilt, from the residuals of their equations."""
    s, c = turned(y[2], parts)
    a11, a12, a22 = _inertia(y, s, c, parts, scene)
    force, torque = a11 * residual_z + a12 * residual_o, a12 * residual_z + a22 * residual_o
    arm, sweep = scene["l"] * c, t * reach
    both = t * (scene["c_left"] + scene["c_right"]) + sweep * (scene["k_left"] + scene["k_right"])
    a11 += both + t * scene["b_z"] + sweep * scene["k_s"]
    a22 += both * (arm * arm) + t * scene["b_theta"]
    if not parts.even:
        uneven = t * (scene["c_right"] - scene["c_left"]) + sweep * (scene["k_right"] - scene["k_left"])
        a12 += uneven * arm
    return solved(a11, a12, a22, force, torque, parts)


@inlined
def _swept(
    x: State, y: State, t: float, reach: float, left: float, right: float, parts: Parts, scene: np.void
) -> tuple[State, float]:
    """Return the next iterate, and its change, as a speed of control points and balls [m/s]."""
    k = rates(y, left, right, parts, scene)
    residual_z, residual_o = y[1] - x[1] - t * k[1], y[3] - x[3] - t * k[3]
    step_z, step_o = _corrected(y, residual_z, residual_o, t, reach, parts, scene)
    vp = plus(speeds(x), t, speeds(k))
    if parts.lagrangian and parts.free:
        # The accelerations of the balls depend on those of the board.
        s, _ = turned(y[2], parts)
        change = scene["ball_height"] * (residual_o - step_o) - scene["mass_ratio"] * s * (residual_z - step_z)
        vp = affine(change, 1.0, vp)
    guess = joined(0.0, y[1] - step_z, 0.0, y[3] - step_o, alike(0.0, vp), vp)
    change = abs(step_z) + scene["l"] * abs(step_o)
    if parts.resisted:
        slowed = plus(vp, -1.0, speeds(y))
        change += sqrt(dot(slowed, slowed))
    return moved(x, reach, guess, parts), change


@inlined
def _settled(
    x: State, t: float, reach: float, left: float, right: float, straight: bool, parts: Parts, scene: np.void
) -> State:
    """Return the state y whose velocities are those of x plus t times the accelerations of y.

    Its positions are those of x plus `reach` times the velocities of y. If the accelerations are `straight` (linear) in
    the velocities, one iteration suffices.
    """
    y = moved(x, reach, x, parts)
    last = 0.0
    for sweep in range(1 if (straight or not parts.tilts) and not parts.resisted else MAX_ITERATIONS):
        y, change = _swept(x, y, t, reach, left, right, parts, scene)
        if t * change <= TOLERANCE or (sweep > MIN_ITERATIONS and not change < last):
            break
        last = change
    return y


@inlined
def verlet(x: State, h: float, hands: np.void, tables: object, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of Verlet's method, with the midpoint rule for the velocities (order 2).

    Half a step of the positions, a step of the velocities at fixed positions, half a step of the positions (Hairer,
    Lubich and Wanner, Acta Numerica 12, 2003, position Verlet). Damping does not limit the step size; stiffness limits
    it to two over the fastest frequency. Velocity Verlet has the same limit, but its explicit first half step is
    inaccurate under strong damping.
    """
    half = 0.5 * h
    left, right = drives(hands, 0, half)
    x = moved(x, half, x, parts)
    y = _settled(x, half, 0.0, left, right, not parts.lagrangian, parts, scene)
    return moved(x, half, plus(plus(y, 1.0, y), -1.0, x), parts)


@inlined
def midpoint(x: State, h: float, hands: np.void, tables: object, parts: Parts, scene: np.void) -> State:
    """Return the state after one step of the implicit midpoint rule (order 2).

    It is A-stable, and conserves the energy of linear oscillations (Hairer, Lubich and Wanner, Geometric Numerical
    Integration, II.1).
    """
    half = 0.5 * h
    left, right = drives(hands, 0, half)
    y = _settled(x, half, half, left, right, False, parts, scene)
    return plus(plus(y, 1.0, y), -1.0, x)
