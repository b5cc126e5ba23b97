"""Random scenes and hands for the soak: a thousand dyads in a batch (`evidence.physics.batch`).

Scenes are drawn from all valid configurations, and kept if the automatic choice is RK4 with one step per tick. Hands
rest, oscillate, jump, tremble, are quantised or freeze, with every kind of extrapolation between samples.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.physics.batch import LANES, numbers_at
from netboard.base.compiled import fast
from netboard.base.errors import ConfigError
from netboard.base.tables.scene import Physics
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.stability.maps import board_matrix
from netboard.physics.stability.method_choice import choose
from netboard.physics.stability.step_matrix import stiffness

Array = NDArray[np.float64]

KINDS = {
    "paper": Physics(),
    "paper, no ball": Physics(balls=0),
    "paper, one hand": Physics(coupling="left", b_z=0.1, b_theta=0.01),
    "lagrangian": Physics(model="lagrangian"),
    "lagrangian, two balls that roll": Physics(model="lagrangian", balls=2, ball_inertia=0.4, ball_height=0.02),
    "lagrangian, stops": Physics(model="lagrangian", ball_stop=0.35),
}

DYADS = 16 * LANES
"""Simulations in a batch [1]."""

RANGE = 0.075
"""Styluses stay within +- this [m]."""

MAX_ACCELERATION = 50.0
"""As in the live tick [m/s2]."""

# Parameters of a hand: a wave and a tremor about a position, and its sampling and extrapolation.
PLACE, SIZE, RATE, COS, SIN, TURN_COS, TURN_SIN, TREMOR, SHAKE_COS, SHAKE_SIN = range(10)
QUANTUM, FROZEN, GOES_ON, BENDS, LAST_Z, LAST_VZ = range(10, 16)
HAND = 16

SHAKE = 2.0 * math.pi * 100.0
_SHAKE_COS, _SHAKE_SIN = math.cos(SHAKE * TICK_SECONDS), math.sin(SHAKE * TICK_SECONDS)


def _spread(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number in a range, log-uniformly."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def draw_scene(rng: np.random.Generator, kind: Physics) -> Physics:
    """Draw a scene for which the automatic choice is RK4 with one step per tick."""
    while True:
        physics = replace(
            kind,
            M=_spread(rng, 1e-3, 3.0),
            m=_spread(rng, 1e-3, 1.0),
            g=rng.uniform(0.0, 20.0),
            k_h=_spread(rng, 10.0, 1e4),
            c_h=_spread(rng, 0.01, 50.0),
            k_s=_spread(rng, 0.1, 1e3),
            l=_spread(rng, 0.05, 1.0),
            I=_spread(rng, 1e-5, 1.0),
            ball_height=rng.uniform(0.0, 0.2) if kind.ball_height > 0.0 else 0.0,
            restitution=rng.uniform(0.0, 1.0) if kind.ball_stop > 0.0 else 0.0,
            b_z=_spread(rng, 1e-3, 5.0) if kind.b_z > 0.0 else 0.0,
            b_theta=_spread(rng, 1e-5, 0.5) if kind.b_theta > 0.0 else 0.0,
        )
        if stiffness(board_matrix(physics), TICK_SECONDS) < 1.0 and _is_chosen(physics):
            return physics


def _is_chosen(physics: Physics) -> bool:
    """Return whether the automatic choice for a scene is RK4 with one step per tick."""
    try:
        choice = choose(physics, TICK_SECONDS)
    except ConfigError:
        return False
    return (choice.method, choice.substeps) == ("rk4", 1)


def draw_hands(rng: np.random.Generator, hand: Array, share: float) -> None:
    """Change the behaviour of some hands; those that change position jump."""
    shape = (len(hand), LANES)
    rate, phase = 2.0 * np.pi * rng.uniform(0.2, 5.0, shape), rng.uniform(0.0, 2.0 * np.pi, (2, *shape))
    hold = rng.integers(0, 3, shape)
    drawn = np.zeros((len(hand), LAST_Z, LANES))
    drawn[:, PLACE] = rng.uniform(-RANGE, RANGE, shape)
    drawn[:, SIZE] = rng.uniform(0.0, 0.05, shape) * (rng.random(shape) < 0.8)
    drawn[:, RATE] = rate
    drawn[:, COS], drawn[:, SIN] = np.cos(phase[0]), np.sin(phase[0])
    drawn[:, TURN_COS], drawn[:, TURN_SIN] = np.cos(rate * TICK_SECONDS), np.sin(rate * TICK_SECONDS)
    drawn[:, TREMOR] = rng.uniform(0.0, 0.002, shape) * (rng.random(shape) < 0.2)
    drawn[:, SHAKE_COS], drawn[:, SHAKE_SIN] = np.cos(phase[1]), np.sin(phase[1])
    drawn[:, QUANTUM] = np.exp(rng.uniform(math.log(2e-5), math.log(2e-3), shape)) * (rng.random(shape) < 0.25)
    drawn[:, FROZEN] = rng.random(shape) < 0.05
    drawn[:, GOES_ON], drawn[:, BENDS] = hold > 0, hold > 1
    renewed = (rng.random(shape) < share)[:, None, :]
    hand[:, :LAST_Z] = np.where(renewed, drawn, hand[:, :LAST_Z])


@fast
def move_hands(hand: Any, side: int, scenes: Any, out: Any) -> None:
    """Advance one hand of every dyad by a tick, and write the polynomials of its drive.

    - `side`: 0 for the left one, 1 for the right one [1].
    """
    h, done = TICK_SECONDS, np.empty((9, LANES))
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
            az = MAX_ACCELERATION if az > MAX_ACCELERATION else az
            az = -MAX_ACCELERATION if az < -MAX_ACCELERATION else az
            az *= hand[b, BENDS, j]
            goes_on = hand[b, GOES_ON, j]
            done[0, j], done[1, j], done[2, j], done[3, j] = cos, sin, shake_cos, shake_sin
            done[4, j], done[5, j] = z, vz
            done[6, j] = k * z + c * vz
            done[7, j] = goes_on * (k * vz + c * az)
            done[8, j] = goes_on * (0.5 * k * az)
        for j in range(LANES):
            hand[b, COS, j], hand[b, SIN, j] = done[0, j], done[1, j]
            hand[b, SHAKE_COS, j], hand[b, SHAKE_SIN, j] = done[2, j], done[3, j]
            hand[b, LAST_Z, j], hand[b, LAST_VZ, j] = done[4, j], done[5, j]
            for n in range(3):
                out[b, 4 * side + n, j] = done[6 + n, j]
