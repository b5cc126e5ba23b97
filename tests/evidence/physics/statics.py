"""Closed forms of a scene: static equilibrium, and poles of the balls near it.

Tests and other evidence compare the kernels with them. All results follow from the
equations in docs/explanation/physics.md, without approximation unless a docstring says "linear". Balls are at given
positions: fixed, or just released (`Parts.free`).
"""

import cmath
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from netboard.physics.scene.parameters import Parts, load_mass


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """Static equilibrium of the board between two styluses at rest.

    Attributes
    ----------
    z : float
        Height of the board's centre [m].
    theta : float
        Tilt, + = right end up [rad].
    left, right : float
        Forces of the hands on the board, + = up [N].
    """

    z: float
    theta: float
    left: float
    right: float


_NO_TILT = "without springs to both hands, or to one and to the origin, the tilt has no static equilibrium"


class _Springs(NamedTuple):
    """Sum and difference (right - left) of the stiffnesses of the couplings and of their drives [N/m, N]."""

    k: float
    odd: float
    pull: float
    turn: float


def _springs(left_z: float, right_z: float, scene: np.void) -> _Springs:
    left, right = float(scene["k_left"]), float(scene["k_right"])
    return _Springs(left + right, right - left, left * left_z + right * right_z, right * right_z - left * left_z)


def _heights(springs: _Springs, balls: int, parts: Parts, scene: np.void) -> tuple[float, float, float]:
    """Return the equilibrium height as a polynomial in the sine of the tilt [m]."""
    if not parts.heaves:
        return 0.0, 0.0, 0.0
    g, stiffness = float(scene["g"]), springs.k + float(scene["k_s"])
    if stiffness <= 0:
        raise ValueError("without a spring to the hands or to the origin the board has no static equilibrium of height")
    weight = balls * load_mass(parts, scene) * g
    # The board carries only part of the weight of a free ball on a slope.
    spared = weight * (float(scene["mass_ratio"]) if parts.free else 0.0) if parts.lagrangian else weight
    rise = springs.pull - float(scene["M"]) * g - weight
    return rise / stiffness, -springs.odd * float(scene["l"]) / stiffness, spared / stiffness


def _level_sine(a: float, b: float, q: float, e: float) -> float:
    """Return the stable root s of ``a - b s + q s^2 + e s / c``, where it decreases with the tilt."""
    if e > 0:
        # It decreases only between the tilts at which its slope -b c + e / c^2 vanishes.
        edge = math.acos(math.cbrt(e / b)) if e < b else 0.0

        def torque(theta: float) -> float:
            return a - b * math.sin(theta) + e * math.tan(theta)

        if torque(-edge) > 0 > torque(edge):
            return math.sin(brentq(torque, -edge, edge, xtol=1e-16, rtol=1e-15))
        raise ValueError("no tilt balances the torques: the balls tip the board over")
    square = b * b - 4 * q * a
    sine = 2 * a / (b + math.sqrt(square)) if square >= 0 else math.inf
    if not abs(sine) < 1:
        raise ValueError(f"no tilt balances the torques: sin(theta) would be {sine:.3g}")
    return sine


def _sine(
    heights: tuple[float, float, float], springs: _Springs, p: tuple[float, ...], parts: Parts, scene: np.void
) -> float:
    """Return the sine of the tilt at which the torque vanishes [1]."""
    if not parts.tilts:
        return 0.0
    arm, weight = float(scene["l"]), load_mass(parts, scene) * float(scene["g"])
    rise, slope, bend = heights
    stiffness = springs.k * arm + springs.odd * slope
    if stiffness <= 1e-12 * springs.k * arm:
        raise ValueError(_NO_TILT)
    above = float(scene["ball_height"]) if parts.lagrangian and not parts.free else 0.0
    return _level_sine(
        springs.turn - springs.odd * rise - weight * sum(p) / arm,
        stiffness,
        -springs.odd * bend,
        len(p) * weight * above / arm,
    )


def equilibrium(left_z: float, right_z: float, p: tuple[float, ...], parts: Parts, scene: np.void) -> Equilibrium:
    """Return the static equilibrium of the board with styluses and balls at rest.

    A hinged board is at height 0, a level one at tilt 0. Zero force gives the height as a polynomial of the sine of the
    tilt, of degree 0 to 2; with that, zero torque is a quadratic equation of the sine. Only fixed balls above the board
    (in the Lagrangian model) need a search, between bounds that hold one root.

    Parameters
    ----------
    p : tuple of float
        Positions of the balls along the board [m].

    Raises
    ------
    ValueError
        If no height or no tilt balances forces and torques, or none to which the board would return.
    """
    springs = _springs(left_z, right_z, scene)
    heights = _heights(springs, len(p), parts, scene)
    sine = _sine(heights, springs, p, parts, scene)
    z = heights[0] + sine * (heights[1] + sine * heights[2])
    arm = float(scene["l"]) * sine
    left, right = float(scene["k_left"]) * (left_z - z + arm), float(scene["k_right"]) * (right_z - z - arm)
    return Equilibrium(z, math.asin(sine), left, right)


def _poles(inertia: float, damping: float, stiffness: float) -> tuple[complex, complex]:
    """Return both roots of ``inertia x^2 + damping x + stiffness``, the one of larger modulus first."""
    middle = -damping / (2 * inertia)
    root = cmath.sqrt(complex(middle * middle - stiffness / inertia))
    fast = middle - root
    # The product of the roots is exact where their sum cancels.
    slow = stiffness / inertia / fast if fast else 0j
    return fast, slow


def ball_poles(balls: int, parts: Parts, scene: np.void) -> tuple[complex, complex]:
    """Return both poles of the balls rolling together, with still hands and a board that follows at once, linear [1/s].

    The weight of a ball at p tilts the board by ``-m g p`` over its stiffness: downhill is away from the centre, and
    the ball a saddle. (With the printed sign of its equation it is a slow oscillator.)

    Parameters
    ----------
    balls : int
        Number of balls, all in one place [1].

    Raises
    ------
    ValueError
        If no spring holds the tilt of the board.
    """
    if not parts.tilts:
        return 0j, 0j
    arm, springs = float(scene["l"]), _springs(0.0, 0.0, scene)
    stiffness = arm * (springs.k * arm + springs.odd * _heights(springs, balls, parts, scene)[1])
    if stiffness <= 0:
        raise ValueError(_NO_TILT)
    tilt_per_metre = -balls * float(scene["m"]) * float(scene["g"]) / stiffness
    if not parts.lagrangian:
        return _poles(1.0, 0.0, -float(scene["ball_gravity"]) * tilt_per_metre)
    inertia = 1.0 - float(scene["ball_height"]) * tilt_per_metre
    return _poles(inertia, 0.0, float(scene["mass_ratio"]) * float(scene["g"]) * tilt_per_metre)
