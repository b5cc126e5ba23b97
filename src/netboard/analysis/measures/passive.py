"""Passive-partner control: how much of an effect of haptic feedback is mechanics rather than communication.

A rendered force also pushes. When one side goes up, the board's spring and the virtual couplings push the other hand
down: 1.5 mm for every 10 mm, for a hand of 150 N/m in the paper's scene. That is movement in opposite directions, and
the paper's rule calls it cooperative. Before such movement is taken for communication, compare it with that of a
passive partner: a mass, a damper and a spring.

Rule 1: the scene's action on a hand enters only as gains or as a callable.
Rule 2: the passive part is not the whole effect of touch on a movement; it is the part that needs no perception.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import cont2discrete, lfilter

from netboard.base.compiled import kernel

MAX_STEP = 0.25e-3
"""Largest integration step for a hand with friction, the same as for simulated participants [s]."""

LARGEST_STEP = 1e-3
"""Largest integration step for arms that yield: shares of a trial's time change by less than 0.001 from 0.25 ms [s]."""

SLIDING = 0.003
"""Recorded speed from which the friction of a stylus is full; below, it is proportional: the hand may be at rest [m/s].

The paper's limit between moving and still."""


@dataclass(frozen=True, slots=True)
class PassiveHand:
    """Passive hand: it holds a stylus and never acts.

    Attributes
    ----------
    mass : float
        Mass of arm and device [kg].
    damping : float
        Damping of arm and device [N s/m].
    stiffness : float
        Stiffness towards the held position [N/m].
    friction : float
        Coulomb friction of the device [N].
    """

    mass: float = 0.5
    damping: float = 8.0
    stiffness: float = 150.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        if not (self.mass > 0.0 and min(self.damping, self.stiffness, self.friction) >= 0.0):
            raise ValueError(f"expected a mass above 0, and damping, stiffness and friction of 0 or more; found {self}")

    def holding(self, mass: float, damping: float, friction: float) -> "PassiveHand":
        """Return the same arm holding a device.

        Parameters
        ----------
        mass : float
            Apparent mass of the device [kg].
        damping : float
            Viscous damping of the device [N s/m].
        friction : float
            Coulomb friction of the device [N].
        """
        return PassiveHand(self.mass + mass, self.damping + damping, self.stiffness, self.friction + friction)


class Gains(NamedTuple):
    """Gains of the static force of one hand on the board, as in `netboard.physics.scene.rendering.GAINS`.

    Attributes
    ----------
    own, partner : float
        Gain of the height of the hand's own stylus and of the partner's [N/m].
    ball : float
        Gain of the ball position along the board [N/m].
    """

    own: float
    partner: float
    ball: float


class Yielding(NamedTuple):
    """Displacement of two arms by haptic forces.

    Attributes
    ----------
    z, vz : ndarray of float64, shape (2, n)
        Displacement of the left and the right stylus, and its rate [m, m/s].
    """

    z: NDArray[np.float64]
    vz: NDArray[np.float64]


def driven(force: ArrayLike, rate: float, hand: PassiveHand) -> NDArray[np.float64]:
    """Return a passive hand's height relative to its start: ``m z'' + b z' + k z + friction = F - F(0)`` [m].

    For the rendered force the result is the passive part of the recorded movement. The rest is voluntary, as far as the
    arm is linear and its stiffness known. Part of the rendered force answers the hand's own movement; `passive_partner`
    includes only the force from elsewhere.

    Parameters
    ----------
    force : array_like, shape (n,)
        Force on the hand, + = up; linear between samples [N].
    """
    f = np.asarray(force, dtype=float)
    if not len(f):
        return f
    if hand.friction > 0.0:
        parts = max(1, ceil(1.0 / (rate * MAX_STEP)))
        step = 1.0 / (rate * parts)
        return np.asarray(_rubbed(f - f[0], parts, step, hand.mass, hand.damping, hand.stiffness, hand.friction))
    above, below = _discretised(hand, rate)
    return np.asarray(lfilter(above, below, f - f[0]))


@kernel
def _rubbed(
    force: NDArray[np.float64], parts: int, step: float, mass: float, damping: float, stiffness: float, friction: float
) -> NDArray[np.float64]:
    """Integrate a hand with Coulomb friction; damping and friction are implicit (Moreau), so a held hand is at rest.

    `netboard.participants.body.stylus` has the same rule. After a missing sample all values are NaN.
    """
    heights = np.zeros(len(force))
    z, v = 0.0, 0.0
    grip = step * friction / mass
    for i in range(1, len(force)):
        if not np.isfinite(force[i]) or not np.isfinite(force[i - 1]):
            heights[i:] = np.nan
            return heights
        for part in range(1, parts + 1):
            push = force[i - 1] + (force[i] - force[i - 1]) * part / parts - stiffness * z
            v += step * push / mass
            v = max(v - grip, 0.0) if v > 0.0 else min(v + grip, 0.0)
            v /= 1.0 + step * damping / mass
            z += step * v
        heights[i] = z
    return heights


@lru_cache(maxsize=256)
def _discretised(hand: PassiveHand, rate: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the filter from force to height; cached, because its design takes longer than filtering a trial."""
    above, below, _ = cont2discrete(([1.0], [hand.mass, hand.damping, hand.stiffness]), 1.0 / rate, method="foh")
    above, below = np.ravel(above), np.asarray(below)
    above.flags.writeable = below.flags.writeable = False
    return above, below


def passive_partner(
    active: ArrayLike, p: ArrayLike, rate: float, hand: PassiveHand, gains: Gains
) -> NDArray[np.float64]:
    """Return the height of a passive hand relative to its start, moved by partner and ball through haptic feedback [m].

    The board is taken to be in static equilibrium between the hands, which it reaches within about 10 ms. A hand
    without friction gives an upper bound: device friction (0.26 N for a Touch) suppresses most of this movement.

    Parameters
    ----------
    active : array_like, shape (n,)
        Height of the partner's stylus [m].
    gains : Gains
        Gains of the haptic feedback on the passive hand.
    """
    push = -gains.partner * np.asarray(active, dtype=float) - gains.ball * np.asarray(p, dtype=float)
    return driven(push, rate, replace(hand, stiffness=hand.stiffness + gains.own))


def yielding(
    forces: ArrayLike,
    rates: ArrayLike,
    rate: float,
    hands: tuple[PassiveHand | None, PassiveHand | None],
    gains: tuple[Gains, Gains],
) -> Yielding:
    """Return how far forces would displace two arms that otherwise move as recorded.

    Each arm keeps its recorded drive. The haptic force F displaces it by r, as ``m r'' + b r' + k r = F - F(0) + change
    of the friction``, where the force changes with the displacements of both, ``-own r - partner r_other``. Coulomb
    friction opposes the whole velocity of the stylus: a moving hand slides, so friction does not hold it against a
    further force; a hand at rest sticks.

    Parameters
    ----------
    forces : array_like, shape (2, n)
        Haptic forces on the left and the right hand at their recorded places, + = up; linear between samples [N].
    rates : array_like, shape (2, n)
        Recorded vertical velocities of both styluses; the velocity is held between samples [m/s].
    hands : tuple of PassiveHand or None
        Arm at each side, with its device; None for a side that is moved as recorded, whatever the force.
    gains : tuple of Gains
        Gains of the board that each hand feels; the one of the ball is not used.

    References
    ----------
    Moreau's time stepping, as in `driven`; the board is taken to be in static equilibrium between the hands.
    """
    push, own = np.ascontiguousarray(forces, dtype=float), np.ascontiguousarray(rates, dtype=float)
    if push.ndim != 2 or push.shape[0] != 2 or push.shape != own.shape:
        raise ValueError(f"expected forces and rates of two sides and equal shape, found {push.shape} and {own.shape}")
    parts = max(1, ceil(1.0 / (rate * LARGEST_STEP)))
    arms = np.array([(np.inf, 0.0, 0.0, 0.0) if one is None else _constants(one) for one in hands])
    springs = np.array([(one.own, one.partner) for one in gains])
    whole = np.isfinite(push).all(axis=0) & np.isfinite(own).all(axis=0)
    known = push.shape[1] if whole.all() else int(np.argmin(whole))
    found = np.full((2, 2, push.shape[1]), np.nan)
    _yield(push[:, :known], own[:, :known], parts, 1.0 / (rate * parts), arms, springs, found)
    return Yielding(found[0], found[1])


def _constants(hand: PassiveHand) -> tuple[float, float, float, float]:
    return hand.mass, hand.damping, hand.stiffness, hand.friction


@kernel
def _yield(
    force: NDArray[np.float64],
    rates: NDArray[np.float64],
    parts: int,
    step: float,
    arms: NDArray[np.float64],
    springs: NDArray[np.float64],
    found: NDArray[np.float64],
) -> None:
    """Write displacements and their rates at the known samples. An infinite mass does not move."""
    z, v = np.zeros(2), np.zeros(2)
    found[:, :, : min(1, force.shape[1])] = 0.0
    for i in range(1, force.shape[1]):
        for part in range(1, parts + 1):
            left, right = z[0], z[1]
            for side in range(2):
                mass, damping, stiffness, friction = arms[side, 0], arms[side, 1], arms[side, 2], arms[side, 3]
                here, there = (left, right) if side == 0 else (right, left)
                push = force[side, i - 1] + (force[side, i] - force[side, i - 1]) * part / parts - force[side, 0]
                push -= (stiffness + springs[side, 0]) * here + springs[side, 1] * there
                recorded = rates[side, i]
                push += friction * max(-1.0, min(1.0, recorded / SLIDING))
                slower = 1.0 + step * damping / mass
                whole, grip = recorded + (v[side] + step * push / mass) / slower, step * friction / mass / slower
                whole = max(whole - grip, 0.0) if whole > 0.0 else min(whole + grip, 0.0)
                v[side] = whole - recorded
                z[side] += step * v[side]
        for side in range(2):
            found[0, side, i], found[1, side, i] = z[side], v[side]
