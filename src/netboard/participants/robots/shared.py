"""Shared control: a robot that leads a passive partner and follows an active one.

The effort E of the partner is the mechanical power that its hand exerts on the board, low-passed. Its force comes from
the balance of the light board, its speed from the end of the board that it holds. The share of leading follows it::

    role' = (least + (most - least) half / (half + E) - role) / role_time

so that both exchange their roles without a switch, as in continuous role adaptation (Li, Tee, Chan, Yan, Chua and
Limbu, IEEE Trans. Robot. 31:672, 2015; Mortl et al., Int. J. Robot. Res. 31:1656, 2012). Leading is that of
`netboard.participants.robots.leader`, following that of `netboard.participants.robots.follower`.
"""

from dataclasses import dataclass
from typing import Annotated, Any, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.settings import about
from netboard.base.tick import TICK_SECONDS
from netboard.participants.robots.leader import (
    LEADER_SOURCES,
    LEADING,
    PATH,
    LeaderParameters,
    led_tilt,
    pack_leading,
)
from netboard.participants.robots.robot import move_hand
from netboard.participants.robots.sight import SIGHT, look
from netboard.participants.robots.steering import (
    STEERING,
    STEERING_SOURCES,
    SteeringPolicy,
    load_on_hand,
    pack_steering,
    partner_force,
    speed_of,
)


@dataclass(frozen=True, slots=True)
class SharedParameters(LeaderParameters):
    """Parameters of shared control."""

    least: Annotated[float, about("smallest share of leading", "1", ge=0, le=1)] = 0.3
    most: Annotated[float, about("largest share of leading", "1", ge=0, le=1)] = 1.0
    half_effort: Annotated[
        float, about("effort of the partner at which the share is halfway between both", "W", gt=0, le=10)
    ] = 0.005
    effort_time: Annotated[float, about("time over which the effort is averaged", "s", gt=0, le=10)] = 0.5
    role_time: Annotated[float, about("time in which the share follows the effort", "s", gt=0, le=10)] = 0.5


_OWN = ("least", "most", "half_effort", "effort_time", "role_time")
_CONSTANTS = np.dtype([("steering", STEERING), ("leading", LEADING), *((name, "<f8") for name in _OWN)])
_STATE = np.dtype([("sight", SIGHT), ("target", "<f8"), ("path", PATH), ("effort", "<f8"), ("role", "<f8")])


@inlined
def _adapt(state: np.void, k: np.void, load: float) -> None:
    """Update the partner's effort and the share of leading by a tick."""
    sight, board = state["sight"], k["steering"]["board"]
    force = board["carried"] - 0.5 * board["ball_weight"] * sight["ball_now"] / board["l"]
    force += partner_force(sight, board, load)
    speed = sight["z_rate"] - board["l"] * sight["tilt_rate"]
    state["effort"] += TICK_SECONDS / k["effort_time"] * (abs(force * speed) - state["effort"])
    passive = k["half_effort"] / (k["half_effort"] + state["effort"])
    role = k["least"] + (k["most"] - k["least"]) * passive
    state["role"] += TICK_SECONDS / k["role_time"] * (role - state["role"])


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Take the ball along its path as far as the partner does not."""
    c, sight, speed = k["steering"], state["sight"], 0.0
    if look(sight, c["board"], observation):
        load = load_on_hand(c, sight, observation)
        _adapt(state, k, load)
        wanted = led_tilt(c, k["leading"], state["path"], sight, observation["time"])
        speed = speed_of(c, sight, state["role"], wanted, load)
    state["target"] = move_hand(c["hand"], observation, state["target"], speed, actions)


@final
class Shared(SteeringPolicy):
    """A robot that changes between leading and following."""

    kind = "shared control"
    decide = staticmethod(decide)
    Parameters = SharedParameters
    State = _STATE
    sources = (
        STEERING_SOURCES
        | LEADER_SOURCES
        | {
            "least": "the initiative of the follower",
            "most": "a leader",
            "half_effort": "by hand: between that of a hand that is held still and that of a simulated participant",
            "effort_time": "about two submovements",
            "role_time": "the same",
        }
    )
    parameters: SharedParameters

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        packed = np.zeros(1, _CONSTANTS)
        packed["steering"] = pack_steering(config, self.parameters, side)[0]
        packed["leading"] = pack_leading(self.parameters, float(packed["steering"]["board"]["slope"][0]))[0]
        for name in _OWN:
            packed[name] = getattr(self.parameters, name)
        return packed
