"""Equations of motion of the scene: the paper's and the full Lagrangian ones, in strict arithmetic.

docs/explanation/physics.md derives them. Rule 1: the results are the same to the bit on every machine, and in plain
Python (``NUMBA_DISABLE_JIT=1``): no ``fastmath``, no fused multiply-add, no math library, one order of operations. Rule
2: mirror images agree to the bit: exchanging left and right and the signs of tilt and balls changes only sides and
signs of the results. Rule 3: nothing raises; non-finite inputs give non-finite results. Rule 4: terms that a scene does
not need are not computed, because `parts` is a compile-time constant.

Symbols: a state x is ``(z, vz, theta, omega)`` and ``(p, vp)`` of each ball: height of the board's centre, tilt (+ =
right end up), ball position along the board (+ = right), and their rates; s and c are sine and cosine of the tilt. A
hand enters only by its drive ``u = k z_s + c vz_s``, the force of its virtual coupling on a board at rest at the
origin. This module is independent of trials, samples and steps.
"""

from typing import Any

import numpy as np
from numba import types

from netboard.base.compiled import inlined, specialised
from netboard.base.tables.scene import FRICTION
from netboard.physics.arithmetic.trig import sincos
from netboard.physics.arithmetic.vectors import State, affine, alike, dot, joined, places, plus, replaced, speeds, total
from netboard.physics.scene.parameters import Parts


@inlined
def turned(theta: float, parts: Parts) -> tuple[float, float]:
    """Return sine and cosine of the tilt: 0 and 1 for a board that cannot tilt [1]."""
    return sincos(theta) if parts.tilts else (0.0, 1.0)


@inlined
def coupling(x: State, left: float, right: float, parts: Parts, scene: np.void) -> tuple[float, float]:
    """Return the forces of the left and the right virtual coupling on the board, + = up (paper eq. 1-2) [N].

    The hands feel the reactions.
    """
    s, c = turned(x[2], parts)
    arm, arm_rate = scene["l"] * s, scene["l"] * x[3] * c
    return (
        left - (scene["k_left"] * (x[0] - arm) + scene["c_left"] * (x[1] - arm_rate)),
        right - (scene["k_right"] * (x[0] + arm) + scene["c_right"] * (x[1] + arm_rate)),
    )


def friction(vp: State, load: float, parts: Parts, scene: np.void) -> State:
    """Return the force of friction on each ball, the sum of all laws, against its motion along the board [N].

    Parameters
    ----------
    vp : tuple of float
        Speed of each ball along the board [m/s].
    load : float
        Normal force of a ball on the board [N].
    """
    return tuple([_resistance(v, load, parts, scene) for v in vp])


def _resistance(vp: float, load: float, parts: Parts, scene: np.void) -> float:
    """Return the force of friction on one ball [N]."""
    force = 0.0
    for (key, law), there in zip(FRICTION.items(), parts.friction, strict=True):
        if there:  # no `sum`, which rounds in another way than kernels do
            force += law.force(scene[key], vp, load)
    return force


_LAWS = {f"law{i}": inlined(law.force) for i, law in enumerate(FRICTION.values())}


@specialised(friction)
def _friction(vp: types.UniTuple, load: types.Type, parts: types.Type, scene: types.Type) -> Any:
    """Write the sum of all laws; the compiler removes those that the scene lacks."""
    terms = [f'(law{i}(scene["{key}"], vp[#], load) if parts.friction[{i}] else 0.0)' for i, key in enumerate(FRICTION)]
    sums = "".join(f"0.0 + {' + '.join(terms)}, ".replace("#", str(ball)) for ball in range(vp.count))
    return eval(f"lambda vp, load, parts, scene: ({sums})", _LAWS)


@inlined
def _board_load(
    x: State, left: float, right: float, s: float, c: float, parts: Parts, scene: np.void
) -> tuple[float, float]:
    """Return the upward force on a board without balls, and the difference of the hands' forces, right - left [N]."""
    arm, arm_rate = scene["l"] * s, scene["l"] * x[3] * c
    k, d = scene["k_left"] + scene["k_right"], scene["c_left"] + scene["c_right"]
    force = (left + right) - scene["M"] * scene["g"] - (k + scene["k_s"]) * x[0] - (d + scene["b_z"]) * x[1]
    turn = (right - left) - k * arm - d * arm_rate
    if not parts.even:
        k, d = scene["k_right"] - scene["k_left"], scene["c_right"] - scene["c_left"]
        force -= k * arm + d * arm_rate
        turn -= k * x[0] + d * x[1]
    return force, turn


@inlined
def _paper(x: State, left: float, right: float, parts: Parts, scene: np.void) -> State:
    """Return the rate of the state by the paper's equations (3-5), where balls act on the board by weight alone."""
    s, c = turned(x[2], parts)
    force, turn = _board_load(x, left, right, s, c, parts, scene)
    torque = scene["l"] * turn
    p = places(x)
    if parts.loaded:
        weight = scene["m"] * scene["g"]
        if not parts.free:
            weight *= scene["fixed_load"]
        force -= len(p) * weight * (c * c)
        torque -= weight * total(p)
    # Reciprocals are available long before sine and cosine; a division would lengthen the dependency chain.
    az = force * (1.0 / scene["M"]) if parts.heaves else 0.0
    ao = torque * c * (1.0 / scene["I"]) if parts.tilts else 0.0
    if parts.damped:
        ao -= scene["b_theta"] * x[3] * (1.0 / scene["I"])
    if parts.free:
        ap = alike(scene["ball_gravity"] * s, p)
        if parts.resisted:
            drag = friction(speeds(x), scene["m"] * scene["g"] * abs(c), parts, scene)
            ap = plus(ap, -scene["mass_ratio"] * (1.0 / scene["m"]), drag)
        return joined(x[1], az, x[3], ao, speeds(x), ap)
    return joined(x[1], az, x[3], ao, alike(0.0, p), alike(0.0, p))


@inlined
def inertia(x: State, s: float, c: float, parts: Parts, scene: np.void) -> tuple[float, float, float]:
    """Return the inertia a11, a12, a22 of board and balls by Lagrange's equations [kg, kg m, kg m2].

    The coordinates of free balls are eliminated.
    """
    p = places(x)
    n = len(p)
    if not parts.loaded:
        return scene["M"], 0.0, scene["I"]
    if parts.free:
        m = scene["m"]
        return scene["M"] + n * m * (1.0 - scene["mass_ratio"] * (s * s)), m * c * total(p), scene["I"] + m * dot(p, p)
    m, r = scene["m"] * scene["fixed_load"], scene["ball_height"]
    return (
        scene["M"] + n * m,
        m * (c * total(p) - n * r * s),
        scene["I"] + m * (dot(p, p) + n * (r * r) * (1.0 / scene["mass_ratio"])),
    )


@inlined
def solved(a11: float, a12: float, a22: float, force: float, torque: float, parts: Parts) -> tuple[float, float]:
    """Return the accelerations of heave and tilt, 0 for a degree of freedom that is fixed [m/s2, rad/s2].

    Parameters
    ----------
    force, torque : float
        Force on the heave and torque on the tilt [N, N m].
    """
    if not parts.tilts:
        return force / a11, 0.0
    if not parts.heaves:
        return 0.0, torque / a22
    inverse = 1.0 / (a11 * a22 - a12 * a12)
    return (a22 * force - a12 * torque) * inverse, (a11 * torque - a12 * force) * inverse


@inlined
def _lagrangian(x: State, left: float, right: float, parts: Parts, scene: np.void) -> State:
    """Return the rate of the state by Lagrange's equations of the same scene (docs/explanation/physics.md)."""
    s, c = turned(x[2], parts)
    omega, g, r = x[3], scene["g"], scene["ball_height"]
    force, turn = _board_load(x, left, right, s, c, parts, scene)
    torque = scene["l"] * turn * c
    if parts.damped:
        torque -= scene["b_theta"] * omega
    p, vp = places(x), speeds(x)
    n, spin = len(p), omega * omega
    if parts.loaded and parts.free:
        m, mass_ratio = scene["m"], scene["mass_ratio"]
        along = (1.0 - mass_ratio) * spin * total(p) + n * mass_ratio * g * s
        force -= m * (n * g + (2.0 * total(vp) - n * r * omega) * omega * c - s * along)
        torque -= m * (g * c * total(p) + 2.0 * omega * dot(p, vp) - r * spin * total(p))
        if parts.resisted:
            drag = friction(vp, scene["m"] * g * abs(c), parts, scene)
            force += mass_ratio * s * total(drag)
            torque -= r * total(drag)
    elif parts.loaded:
        m = scene["m"] * scene["fixed_load"]
        force -= m * (n * g - spin * (s * total(p) + n * r * c))
        torque -= m * g * (c * total(p) - n * r * s)
    a11, a12, a22 = inertia(x, s, c, parts, scene)
    az, ao = solved(a11, a12, a22, force, torque, parts)
    if parts.free:
        mass_ratio = scene["mass_ratio"]
        ap = affine(r * ao - mass_ratio * s * (g + az), mass_ratio * spin, p)
        if parts.resisted:
            ap = plus(ap, -mass_ratio * (1.0 / scene["m"]), friction(vp, scene["m"] * g * abs(c), parts, scene))
        return joined(x[1], az, omega, ao, vp, ap)
    return joined(x[1], az, omega, ao, alike(0.0, p), alike(0.0, p))


@inlined
def rates(x: State, left: float, right: float, parts: Parts, scene: np.void) -> State:
    """Return the rate of change of a state [SI]."""
    if parts.lagrangian:
        return _lagrangian(x, left, right, parts, scene)
    return _paper(x, left, right, parts, scene)


@inlined
def _response(x: State, parts: Parts, scene: np.void) -> tuple[float, float, float]:
    """Return what a unit impulse along the board at a ball changes in the Lagrangian model.

    That is the rates of heave and tilt, and the speed of every ball beside that of the ball itself.
    """
    s, c = turned(x[2], parts)
    r, mass_ratio = scene["ball_height"], scene["mass_ratio"]
    a11, a12, a22 = inertia(x, s, c, parts, scene)
    vz, omega = solved(a11, a12, a22, -s * mass_ratio, r, parts)
    return vz, omega, r * omega - s * mass_ratio * vz


@inlined
def _struck(x: State, i: int, blow: float, response: tuple[float, float, float], scene: np.void) -> State:
    """Return the state after an impulse along the board at ball i in the Lagrangian model [N s]."""
    vz, omega, others = response
    x = replaced(replaced(x, 1, x[1] + blow * vz), 3, x[3] + blow * omega)
    for j in range(len(places(x))):
        x = replaced(x, 5 + 2 * j, x[5 + 2 * j] + blow * others)
    return replaced(x, 5 + 2 * i, x[5 + 2 * i] + blow * (scene["mass_ratio"] / scene["m"]))


@inlined
def struck(x: State, i: int, blow: float, parts: Parts, scene: np.void) -> State:
    """Return the state after an impulse at the centre of a ball; in the Lagrangian model it acts on the board, too.

    Parameters
    ----------
    i : int
        Number of the ball, from 0 [1].
    blow : float
        Impulse along the board, + = right [N s].
    """
    if not parts.lagrangian:
        return replaced(x, 5 + 2 * i, x[5 + 2 * i] + blow * (scene["mass_ratio"] / scene["m"]))
    return _struck(x, i, blow, _response(x, parts, scene), scene)


@inlined
def _reflected(x: State, i: int, parts: Parts, scene: np.void) -> State:
    """Return the state after the impact of ball i on its stop; in the Lagrangian model it acts on the board, too."""
    back = -(1.0 + scene["restitution"]) * x[5 + 2 * i]
    if not parts.lagrangian:
        return replaced(x, 5 + 2 * i, x[5 + 2 * i] + back)
    response = _response(x, parts, scene)
    # The impulse that reverses ball i.
    blow = back / (response[2] + scene["mass_ratio"] / scene["m"])
    return _struck(x, i, blow, response, scene)


@inlined
def stopped(x: State, parts: Parts, scene: np.void) -> State:
    """Return the state after a step, with balls beyond a stop put on it and reflected (Newton's restitution).

    An impact takes effect at the end of its step.
    """
    if parts.stops:
        for i in range(len(places(x))):
            p, vp = x[4 + 2 * i], x[5 + 2 * i]
            if abs(p) > scene["stop"]:
                edge = scene["stop"] if p > 0.0 else -scene["stop"]
                x = replaced(x, 4 + 2 * i, edge)
                if p * vp > 0.0:
                    x = _reflected(x, i, parts, scene)
    return x
