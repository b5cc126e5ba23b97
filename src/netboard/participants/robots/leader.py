"""Leader: a robot that brings the ball to the target along a minimum-jerk path.

At the release it plans a path of the ball to the target: the polynomial of fifth order that begins with the position
and velocity of the ball and ends at rest (Flash and Hogan, J. Neurosci. 5:1688, 1985). In its duration the largest tilt
of a path from rest is `path_tilt_deg`. The acceleration on the path is the feed-forward of a PD law, whose wanted tilt
the hand brings about alone (`netboard.participants.robots.steering`). If the ball is farther from the path
than `replan`, a new path begins.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Annotated, Any, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.settings import about
from netboard.participants.robots.robot import move_hand
from netboard.participants.robots.sight import SIGHT, look
from netboard.participants.robots.steering import (
    STEERING,
    STEERING_SOURCES,
    SteeringParameters,
    SteeringPolicy,
    pack_steering,
    speed_of,
    wanted_tilt,
)

PEAK = 10.0 / sqrt(3.0)
"""Largest acceleration of a minimum-jerk movement, times its squared duration over its distance [1]."""


@dataclass(frozen=True, slots=True)
class LeaderParameters(SteeringParameters):
    """Parameters of a leader."""

    path_tilt_deg: Annotated[float, about("largest tilt of a path from rest", "deg", gt=0, le=20)] = 2.0
    replan: Annotated[float, about("distance from the path at which a new one begins", "m", gt=0, le=1)] = 0.08
    shortest: Annotated[float, about("shortest duration of a path", "s", gt=0, le=10)] = 0.5


LEADER_SOURCES = {
    "path_tilt_deg": "by hand: two thirds of the largest tilt, so that a third remains for feedback",
    "replan": "about the width of the target",
    "shortest": "about the time in which the hand settles",
}

PATH = np.dtype([("start", "<f8"), ("duration", "<f8"), ("target", "<f8"), ("c", "<f8", (6,)), ("planned", "<i8")])
"""A path of the ball: begin, duration, target, and the coefficients of its polynomial in time [SI]."""

LEADING = np.dtype([("slope", "<f8"), ("path_tilt", "<f8"), ("replan", "<f8"), ("shortest", "<f8")])
"""Constants of the paths."""


def pack_leading(parameters: LeaderParameters, slope: float) -> NDArray[Any]:
    """Return the constants of the paths, packed for the kernels: ndarray of LEADING, shape (1,) [SI]."""
    packed = np.zeros(1, LEADING)
    packed["slope"], packed["path_tilt"] = slope, np.radians(parameters.path_tilt_deg)
    packed["replan"], packed["shortest"] = parameters.replan, parameters.shortest
    return packed


@inlined
def plan(path: np.void, leading: np.void, sight: np.void, now: float) -> None:
    """Plan a path from the present ball to the target."""
    distance, v, c = sight["target"] - sight["ball_now"], sight["ball_rate_now"], path["c"]
    duration = max(sqrt(PEAK * abs(distance / (leading["slope"] * leading["path_tilt"]))), leading["shortest"])
    path["start"], path["duration"], path["target"], path["planned"] = now, duration, sight["target"], 1
    c[0], c[1], c[2] = sight["ball_now"], v, 0.0
    c[3] = (10.0 * distance - 6.0 * v * duration) / duration**3
    c[4] = (-15.0 * distance + 8.0 * v * duration) / duration**4
    c[5] = (6.0 * distance - 3.0 * v * duration) / duration**5


@inlined
def along(path: np.void, now: float) -> tuple[float, float, float]:
    """Return position, velocity and acceleration of the ball on its path [m, m/s, m/s2]."""
    t, c = now - path["start"], path["c"]
    if t >= path["duration"]:
        return path["target"], 0.0, 0.0
    place = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
    rate = c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5])))
    return place, rate, 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5]))


@inlined
def led_tilt(c: np.void, leading: np.void, path: np.void, sight: np.void, now: float) -> float:
    """Return the tilt that takes the ball along its path, which is planned first where there is none [rad]."""
    if sight["free"] == 0 or leading["slope"] == 0.0:
        path["planned"] = 0
        return 0.0
    if path["planned"] == 0 or path["target"] != sight["target"]:
        plan(path, leading, sight, now)
    place, rate, pull = along(path, now)
    if abs(sight["ball_now"] - place) > leading["replan"]:
        plan(path, leading, sight, now)
        place, rate, pull = along(path, now)
    return wanted_tilt(c, sight, place, rate, pull)


_CONSTANTS = np.dtype([("steering", STEERING), ("leading", LEADING)])
_STATE = np.dtype([("sight", SIGHT), ("target", "<f8"), ("path", PATH)])


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Take the ball along its path."""
    c, sight, speed = k["steering"], state["sight"], 0.0
    if look(sight, c["board"], observation):
        wanted = led_tilt(c, k["leading"], state["path"], sight, observation["time"])
        speed = speed_of(c, sight, 1.0, wanted, 0.0)
    state["target"] = move_hand(c["hand"], observation, state["target"], speed, actions)


@final
class Leader(SteeringPolicy):
    """A robot that leads its partner."""

    kind = "leader"
    decide = staticmethod(decide)
    Parameters = LeaderParameters
    State = _STATE
    sources = STEERING_SOURCES | LEADER_SOURCES
    parameters: LeaderParameters

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        packed = np.zeros(1, _CONSTANTS)
        packed["steering"] = pack_steering(config, self.parameters, side)[0]
        packed["leading"] = pack_leading(self.parameters, float(packed["steering"]["board"]["slope"][0]))[0]
        return packed
