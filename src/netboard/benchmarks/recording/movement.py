"""Movements of two hands that carry the ball from one target to the other, simulated tick by tick."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config
from netboard.base.tick import TICK, TICK_NS, TICK_SECONDS
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import BALL_FREE, Cause

Rows = NDArray[Any]


@dataclass(frozen=True)
class RecordedMovement:
    """A movement of two hands that moves the ball from one target to the other.

    - `sway`: amplitude of the common up-and-down movement [m].
    - `rate`: its frequency [Hz].
    - `duration`: duration of the ball's movement [s].
    """

    share: float
    sway: float
    rate: float
    duration: float


FIRST_MOVEMENT, SECOND_MOVEMENT = RecordedMovement(0.7, 0.008, 0.45, 2.4), RecordedMovement(0.4, -0.012, 0.7, 1.7)


def record(config: Config, movement: RecordedMovement, count: int) -> Rows:
    """Simulate a movement of two hands, and return its ticks.

    The hands tilt the board as the path of the ball requires, plus feedback of its deviation, because the equilibrium
    of the ball is unstable.
    """
    physics, distance = config.physics, config.geometry.target_distance
    stage, rows = make_stage(config), _rows(count)
    state = stage.initial()
    before, released = (0.0, 0.0), count
    for i in range(count):
        s = state[0]
        if s["phase"] in BALL_FREE:
            released = min(released, i)
        t = (i - released) * TICK_SECONDS
        p, vp, ap = _path(t / movement.duration, movement.duration, distance)
        tilt = -(ap + 6.0 * (p - s["p"]) + 4.0 * (vp - s["vp"])) / physics.g if t >= 0.0 else 0.0
        # The board gives way to the ball's weight.
        rise = 2 * physics.l * tilt + s["p"] * physics.m * physics.g / (physics.k_h * physics.l)
        begun = min(max(t, 0.0) / 0.5, 1.0)
        sway = movement.sway * begun**2 * (3 - 2 * begun) * np.sin(2 * np.pi * movement.rate * t)
        now = sway - (1.0 - movement.share) * rise, sway + movement.share * rise
        for side, height, last in zip(SIDES, now, before, strict=True):
            rows[f"{side}_sent_z"][i] = height
            rows[f"{side}_sent_vz"][i] = (height - last) / TICK_SECONDS if i > 0 else 0.0
        before = now
        stage.advance(state, rows, i)
    return rows


def _path(share: float, duration: float, distance: float) -> tuple[float, float, float]:
    """Return position, velocity and acceleration of a minimum-snap path, which needs smooth hands."""
    x = min(max(share, 0.0), 1.0)
    place = x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)
    rate = 140 * (x * (1 - x)) ** 3 / duration
    acceleration = 420 * (x * (1 - x)) ** 2 * (1 - 2 * x) / duration**2
    return distance * (2 * place - 1), 2 * distance * rate, 2 * distance * acceleration


def _rows(count: int) -> Rows:
    """Return input rows with new samples at rest, of which the first starts the block."""
    rows = np.zeros(count, TICK)
    rows["tick"] = np.arange(count)
    rows["time_ns"] = (1 + rows["tick"]) * TICK_NS
    for side in SIDES:
        rows[f"{side}_live"], rows[f"{side}_stamp_ns"] = 1, rows["time_ns"]
    rows["command"][0] = Cause.START
    return rows
