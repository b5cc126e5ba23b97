"""A thousand million steps through random scenes with random hands: nothing may turn infinite, no energy come from nowhere.

Scenes are drawn from all that a configuration may say, and kept if the automatic choice steps them by RK4, once a tick.
Hands rest, wave, jump, tremble, are quantised and freeze, and are held between samples in any of the ways there are. A
thousand dyads go on at once (`netboard.methods.batch`).

After every step the energy of what the hands do not hold, with the couplings' springs as if from the board to the
ground, must have changed by the work of the drives u through the board's ends, less what the dampers take: ``E' = u vz
- c vz^2 + ...``. That can be at most ``u^2 / 4c`` for each hand, whatever the board does: the bound on what hands put in.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.compiled import fast, inlined, loosened
from netboard.config import Physics
from netboard.errors import ConfigError
from netboard.methods.batch import LANES, anywhere, column_at, in_blocks, make_batch, numbers_at, scene_blocks
from netboard.methods.choice import choose
from netboard.physics.energy import flows, stored
from netboard.physics.models import rates, turned
from netboard.physics.scene import Parts, pack_scene, parts_of, state_length
from netboard.physics.trig import sincos
from netboard.physics.vectors import plus
from netboard.studies.results import Part, Value, Verdict
from netboard.studies.stability_maps import Tell
from netboard.tick import TICK_SECONDS

Array = NDArray[np.float64]

KINDS = {
    "paper": Physics(),
    "paper, no ball": Physics(balls=0),
    "paper, one hand": Physics(coupling="left"),
    "lagrangian": Physics(model="lagrangian"),
    "lagrangian, two balls that roll": Physics(model="lagrangian", balls=2, ball_inertia=0.4),
    "lagrangian, stops": Physics(model="lagrangian", ball_stop=0.35),
}

DYADS = 16 * LANES
"""Simulations at once [1]."""

BETWEEN = 100
"""Ticks from check to check [1]."""

RUN_AWAY = 0.5
"""A ball farther than this from the centre is put back there [m]."""

RANGE = 0.075
"""Styluses stay within +- this [m]."""

LARGEST_ACCELERATION = 50.0
"""As in the live tick [m/s2]."""

_rates, _flows, _stored = (loosened(text, {sincos: anywhere}) for text in (rates, flows, stored))
_turned, _plus = loosened(turned, {sincos: anywhere}), loosened(plus, {})

# What a hand is made of: a wave and a tremor round a place, and how it is sampled and held.
PLACE, SIZE, RATE, COS, SIN, TURN_COS, TURN_SIN, TREMOR, SHAKE_COS, SHAKE_SIN = range(10)
QUANTUM, FROZEN, GOES_ON, BENDS, LAST_Z, LAST_VZ = range(10, 16)
HAND = 16

SHAKE = 2.0 * math.pi * 100.0
_SHAKE_COS, _SHAKE_SIN = math.cos(SHAKE * TICK_SECONDS), math.sin(SHAKE * TICK_SECONDS)

WORK, THROUGH, SUPPLY, GROWTH, WRONG = range(5)
SUMS = 5
"""Work by the flows, their magnitudes, the bound on what hands put in, growth, growth that is not work [J]."""


@fast
def move_hands(hand: Any, side: int, scenes: Any, out: Any) -> None:
    """Move one hand of every dyad on by a tick, and write the polynomials of its drive.

    Parameters
    ----------
    hand : ndarray of float64, shape (blocks, HAND, LANES)
        The hands; moved on in place [SI].
    side : int
        0 for the left one, 1 for the right one [1].
    scenes : ndarray of float64, shape (blocks, numbers, LANES)
        The scenes [SI].
    out : ndarray of float64, shape (blocks, 8, LANES)
        The polynomials [N, N/s, N/s2, N/s3].
    """
    h = TICK_SECONDS
    for b in range(len(hand)):
        for j in range(LANES):
            scene = numbers_at(scenes, b, j)
            k = scene["k_left"] if side == 0 else scene["k_right"]
            c = scene["c_left"] if side == 0 else scene["c_right"]
            cos, sin = hand[b, COS, j], hand[b, SIN, j]
            turn_cos, turn_sin = hand[b, TURN_COS, j], hand[b, TURN_SIN, j]
            cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
            shake_cos, shake_sin = hand[b, SHAKE_COS, j], hand[b, SHAKE_SIN, j]
            shake_cos, shake_sin = (
                shake_cos * _SHAKE_COS - shake_sin * _SHAKE_SIN,
                shake_sin * _SHAKE_COS + shake_cos * _SHAKE_SIN,
            )
            size, tremor = hand[b, SIZE, j], hand[b, TREMOR, j]
            z = hand[b, PLACE, j] + size * sin + tremor * shake_sin
            vz = size * hand[b, RATE, j] * cos + tremor * SHAKE * shake_cos
            beyond = abs(z) > RANGE
            z = (RANGE if z > 0.0 else -RANGE) if beyond else z
            vz = 0.0 if beyond else vz
            last_z, last_vz, quantum = hand[b, LAST_Z, j], hand[b, LAST_VZ, j], hand[b, QUANTUM, j]
            coarse = np.floor(z / (quantum if quantum > 0.0 else 1.0) + 0.5) * quantum
            vz = (coarse - last_z) / h if quantum > 0.0 else vz
            z = coarse if quantum > 0.0 else z
            frozen = hand[b, FROZEN, j] > 0.0
            z, vz = last_z if frozen else z, 0.0 if frozen else vz
            az = (vz - last_vz) / h
            az = LARGEST_ACCELERATION if az > LARGEST_ACCELERATION else az
            az = -LARGEST_ACCELERATION if az < -LARGEST_ACCELERATION else az
            az *= hand[b, BENDS, j]
            goes_on = hand[b, GOES_ON, j]
            hand[b, COS, j], hand[b, SIN, j] = cos, sin
            hand[b, SHAKE_COS, j], hand[b, SHAKE_SIN, j] = shake_cos, shake_sin
            hand[b, LAST_Z, j], hand[b, LAST_VZ, j] = z, vz
            out[b, 4 * side, j] = k * z + c * vz
            out[b, 4 * side + 1, j] = goes_on * (k * vz + c * az)
            out[b, 4 * side + 2, j] = goes_on * (0.5 * k * az)


@inlined
def _middle(u: Any, t: float) -> tuple[float, float]:
    """Return both drives at a time."""
    return u[0] + t * (u[1] + t * u[2]), u[4] + t * (u[5] + t * u[6])


@inlined
def _held(x: Any, parts: Parts, scene: Any) -> float:
    """Return the energy, with the couplings' springs to the ground."""
    kept = _stored(x, 0.0, 0.0, parts, scene)
    return kept[0] + kept[1] + kept[2] + kept[3] + kept[4]


@inlined
def _power(x: Any, left: float, right: float, parts: Parts, scene: Any) -> tuple[float, float, float]:
    """Return the power of all flows, the sum of their magnitudes, and the most that they can be."""
    s, c = _turned(x[2], parts)
    arm_rate = scene["l"] * x[3] * c
    pushed, turned_ = left * (x[1] - arm_rate), right * (x[1] + arm_rate)
    flow = _flows(x, 0.0, 0.0, 0.0, 0.0, parts, scene)
    lost = flow[2] + flow[3] + flow[4]
    size = abs(pushed) + abs(turned_) - lost + abs(flow[5])
    c_left, c_right = scene["c_left"], scene["c_right"]
    most = (0.25 * left * left / c_left if c_left > 0.0 else 0.0) + (
        0.25 * right * right / c_right if c_right > 0.0 else 0.0
    )
    return pushed + turned_ + lost + flow[5], size, most + flow[5]


@cache
def make_audit(PARTS: Parts, LENGTH: int) -> Callable[[Array, Array, Array, Array, Array], None]:
    """Compile the audit of a step's energy.

    Parameters
    ----------
    PARTS : Parts
        What the scenes have.
    LENGTH : int
        Length of a state [1].

    Returns
    -------
    callable
        ``audit(before, after, hands, scenes, sums)`` adds to `sums`, of shape (blocks, SUMS, LANES), what the step from
        one state to the other did. Flows are integrated by Simpson's rule, with the cubic between both states.
    """

    @fast
    def audit(before: Any, after: Any, hands: Any, scenes: Any, sums: Any) -> None:
        h, done = TICK_SECONDS, np.empty((SUMS, LANES))
        for b in range(len(before)):
            for j in range(LANES):
                scene = numbers_at(scenes, b, j)
                x0, x1, u = column_at(before, b, j, LENGTH), column_at(after, b, j, LENGTH), column_at(hands, b, j, 8)
                left, right = _middle(u, 0.5 * h)
                last_left, last_right = _middle(u, h)
                r0, r1 = _rates(x0, u[0], u[4], PARTS, scene), _rates(x1, last_left, last_right, PARTS, scene)
                middle = _plus(_plus(_plus(_plus(x0, -0.5, x0), 0.5, x1), 0.125 * h, r0), -0.125 * h, r1)
                a, a_size, a_most = _power(x0, u[0], u[4], PARTS, scene)
                m, m_size, m_most = _power(middle, left, right, PARTS, scene)
                e, e_size, e_most = _power(x1, last_left, last_right, PARTS, scene)
                work = h / 6.0 * (a + 4.0 * m + e)
                growth = _held(x1, PARTS, scene) - _held(x0, PARTS, scene)
                struck = PARTS.stops and abs(x1[4]) == scene["stop"]
                done[WORK, j] = work
                done[THROUGH, j] = h / 6.0 * (a_size + 4.0 * m_size + e_size)
                done[SUPPLY, j] = h / 6.0 * (a_most + 4.0 * m_most + e_most)
                done[GROWTH, j] = growth
                done[WRONG, j] = 0.0 if struck else growth - work
            for k in range(SUMS):
                for j in range(LANES):
                    sums[b, k, j] += done[k, j]

    return audit
