"""One-step methods that are implicit: in the velocities (Verlet), or in everything (the midpoint rule).

Both ask for velocities that are what they make of themselves. Newton's method finds them, with the inertia, the damping
and the stiffness of the board and its couplings at the present tilt: a system of two equations, solved in closed form.
What it leaves out (weights, and what grows with the square of the velocities) changes little in a step, and every sweep
takes all but a small share of the error away.
"""

from math import sqrt
from typing import Any

from netboard.base.compiled import inlined
from netboard.physics.arithmetic.vectors import State, affine, alike, dot, joined, plus, speeds
from netboard.physics.hands.extrapolation import drives
from netboard.physics.methods.one_step import moved
from netboard.physics.scene.models import masses, rates, solved, turned
from netboard.physics.scene.parameters import Parts

SWEEPS = 50
"""At most this many; where nothing is extreme, three to eight are needed."""

CLOSE = 1e-16
"""The sweeps end when they move the board by no more than this in a step [m]."""

FIRST = 2
"""After this many sweeps those that no longer bring it closer end them too; the very first need not."""


@inlined
def _inertia(y: State, s: float, c: float, parts: Parts, scene: Any) -> tuple[float, float, float]:
    """Return the inertia against heave, heave with tilt, and tilt [kg, kg m, kg m2]."""
    if parts.lagrangian:
        return masses(y, s, c, parts, scene)
    return scene["M"], 0.0, scene["I"]


@inlined
def _corrected(
    y: State, wrong_z: float, wrong_o: float, t: float, reach: float, parts: Parts, scene: Any
) -> tuple[float, float]:
    """Return by how much the velocities of heave and tilt are wrong, by what is wrong in their equations."""
    s, c = turned(y[2], parts)
    a11, a12, a22 = _inertia(y, s, c, parts, scene)
    force, torque = a11 * wrong_z + a12 * wrong_o, a12 * wrong_z + a22 * wrong_o
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
    x: State, y: State, t: float, reach: float, left: float, right: float, parts: Parts, scene: Any
) -> tuple[State, float]:
    """Return a better guess than y, and by how much it differs, as a speed at the control points and of balls [m/s]."""
    k = rates(y, left, right, parts, scene)
    wrong_z, wrong_o = y[1] - x[1] - t * k[1], y[3] - x[3] - t * k[3]
    less_z, less_o = _corrected(y, wrong_z, wrong_o, t, reach, parts, scene)
    vp = plus(speeds(x), t, speeds(k))
    if parts.lagrangian and parts.free:
        # The balls feel how the board's accelerations change.
        s, _ = turned(y[2], parts)
        change = scene["ball_height"] * (wrong_o - less_o) - scene["ease"] * s * (wrong_z - less_z)
        vp = affine(change, 1.0, vp)
    guess = joined(0.0, y[1] - less_z, 0.0, y[3] - less_o, alike(0.0, vp), vp)
    change = abs(less_z) + scene["l"] * abs(less_o)
    if parts.resisted:
        slowed = plus(vp, -1.0, speeds(y))
        change += sqrt(dot(slowed, slowed))
    return moved(x, reach, guess, parts), change


@inlined
def _settled(
    x: State, t: float, reach: float, left: float, right: float, straight: bool, parts: Parts, scene: Any
) -> State:
    """Return the state whose velocities are those of x after a time t of its own accelerations.

    Its places are those of x after a time `reach` of its own velocities. If the accelerations are `straight` functions
    of the velocities, one sweep finds it.
    """
    y = moved(x, reach, x, parts)
    last = 0.0
    for sweep in range(1 if (straight or not parts.tilts) and not parts.resisted else SWEEPS):
        y, change = _swept(x, y, t, reach, left, right, parts, scene)
        if t * change <= CLOSE or (sweep > FIRST and not change < last):
            break
        last = change
    return y


@inlined
def verlet(x: State, h: float, hands: Any, tables: Any, parts: Parts, scene: Any) -> State:
    """Return the state after one step of Verlet's method, with the midpoint rule for the velocities (order 2).

    Half a step of the places, a step of the velocities with the places at rest, half a step of the places (Hairer,
    Lubich and Wanner, Acta Numerica 12, 2003, the variant that drifts first). No damping limits the step; stiffness
    does, to two over the fastest frequency. The variant that kicks first has the same limits, but a strong damping
    then throws the places off, for the kick before them is explicit.

    Parameters
    ----------
    x : tuple of float
        The state [SI].
    h : float
        Step size [s].
    hands : tuple
        Drives of both hands during the step, for `netboard.physics.hands.extrapolation.drives` [N].
    tables : tuple of ndarray of float64, shape (kinds, k, n, n), and int
        Unused.
    parts : Parts
        Structure of the scene; a compile-time constant.
    scene : SCENE record
        The scene.

    Returns
    -------
    tuple of float
        The state at the end of the step [SI].
    """
    half = 0.5 * h
    left, right = drives(hands, 0, half)
    x = moved(x, half, x, parts)
    y = _settled(x, half, 0.0, left, right, not parts.lagrangian, parts, scene)
    return moved(x, half, plus(plus(y, 1.0, y), -1.0, x), parts)


@inlined
def midpoint(x: State, h: float, hands: Any, tables: Any, parts: Parts, scene: Any) -> State:
    """Return the state after one step of the implicit midpoint rule (order 2).

    No step is too long for a linear scene; what oscillates keeps its energy (Hairer, Lubich and Wanner, Geometric
    Numerical Integration, II.1).

    Parameters
    ----------
    x : tuple of float
        The state [SI].
    h : float
        Step size [s].
    hands : tuple
        Drives of both hands during the step, for `netboard.physics.hands.extrapolation.drives` [N].
    tables : tuple of ndarray of float64, shape (kinds, k, n, n), and int
        Unused.
    parts : Parts
        Structure of the scene; a compile-time constant.
    scene : SCENE record
        The scene.

    Returns
    -------
    tuple of float
        The state at the end of the step [SI].
    """
    half = 0.5 * h
    left, right = drives(hands, 0, half)
    y = _settled(x, half, half, left, right, False, parts, scene)
    return plus(plus(y, 1.0, y), -1.0, x)
