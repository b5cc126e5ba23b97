"""Follower: a robot that yields to its partner, and takes little initiative of its own.

It follows as an admittance (`netboard.participants.robots.steering`), and so mirrors the partner. With a small share
`initiative` it leads: it levels the board and steers the ball by a PD law, so that a partner who does nothing is not
left alone.
"""

from dataclasses import dataclass
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
    load_on_hand,
    pack_steering,
    speed_of,
    wanted_tilt,
)


@dataclass(frozen=True, slots=True)
class FollowerParameters(SteeringParameters):
    """Parameters of a follower."""

    initiative: Annotated[float, about("share of leading in what the robot does", "1", ge=0, le=1)] = 0.3


_CONSTANTS = np.dtype([("steering", STEERING), ("initiative", "<f8")])
_STATE = np.dtype([("sight", SIGHT), ("target", "<f8")])


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Yield to the force of the board, and steer a little."""
    c, sight, speed = k["steering"], state["sight"], 0.0
    if look(sight, c["board"], observation):
        wanted = wanted_tilt(c, sight, sight["target"], 0.0, 0.0)
        speed = speed_of(c, sight, k["initiative"], wanted, load_on_hand(c, sight, observation))
    state["target"] = move_hand(c["hand"], observation, state["target"], speed, actions)


@final
class Follower(SteeringPolicy):
    """A robot that follows its partner."""

    kind = "follower"
    decide = staticmethod(decide)
    Parameters = FollowerParameters
    State = _STATE
    sources = STEERING_SOURCES | {"initiative": "by hand: beside a hand that is held still a trial takes 6 s"}
    parameters: FollowerParameters

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        packed = np.zeros(1, _CONSTANTS)
        packed["steering"] = pack_steering(config, self.parameters, side)[0]
        packed["initiative"] = self.parameters.initiative
        return packed
