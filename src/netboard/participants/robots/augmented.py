"""Sensory augmentation: a robot that infers its partner's goal from the force, as another sense of the target.

The partner's hand is taken for a mass with a damper and a spring to an aim, which changes at random. Its height follows
from the force on the robot's hand and from the board seen. A Kalman filter estimates hand and aim at each tick. If both
tilt the board alike, the partner's aim a wants the tilt ``-a / l``. The robot wants the mean of this tilt and its own,
each weighted with the inverse of its variance::

    wanted = (own / own_sd^2 + partner / partner_sd^2) / (1 / own_sd^2 + 1 / partner_sd^2)

The partner's variance is that of the stationary filter. So two partners share what they know of the goal without saying
so (Takagi, Ganesh, Yoshioka, Kawato and Burdet, Nat. Hum. Behav. 1:0054, 2017; Li, Eden, Carboni and Burdet, Improving
tracking through human-robot sensory augmentation, arXiv:2002.07293, 2020).
"""

from dataclasses import dataclass
from typing import Annotated, Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.settings import about
from netboard.base.tick import TICK_SECONDS
from netboard.participants.robots.robot import move_hand
from netboard.participants.robots.sight import SIGHT, look
from netboard.participants.robots.steering import (
    STEERING,
    STEERING_SOURCES,
    SteeringParameters,
    SteeringPolicy,
    clipped,
    load_on_hand,
    pack_steering,
    partner_height,
    speed_of,
    wanted_tilt,
)


@dataclass(frozen=True, slots=True)
class AugmentedParameters(SteeringParameters):
    """Parameters of sensory augmentation."""

    partner_mass: Annotated[float, about("mass of the partner's hand and arm", "kg", gt=0, le=10)] = 0.5
    partner_stiffness: Annotated[float, about("stiffness of the partner's hand", "N/m", gt=0, le=2000)] = 150.0
    partner_damping: Annotated[float, about("damping of the partner's hand", "N s/m", ge=0, le=200)] = 8.0
    aim_time: Annotated[float, about("time after which the partner's aim is forgotten", "s", gt=0, le=100)] = 0.5
    aim_sd: Annotated[float, about("standard deviation of the partner's aim", "m", gt=0, le=1)] = 0.01
    force_noise: Annotated[
        float, about("standard deviation of the force on the hand, in the filter", "N", gt=0, le=10)
    ] = 0.05
    own_tilt_deg: Annotated[
        float, about("standard deviation of the tilt that the robot itself wants", "deg", gt=0, le=45)
    ] = 0.5


_ARM = "the arm of a simulated participant"
_STATES = 3
_OWN_CONSTANTS = np.dtype(
    [
        ("advance", "<f8", (_STATES, _STATES)),  # of height, speed and aim of the partner's hand in a tick
        ("gains", "<f8", (_STATES,)),  # by a measured height
        ("weight", "<f8"),  # of the tilt that the robot itself wants [1]
    ]
)
_CONSTANTS = np.dtype([("steering", STEERING), ("partner", _OWN_CONSTANTS)])
_STATE = np.dtype([("sight", SIGHT), ("target", "<f8"), ("partner", "<f8", (_STATES,))])


def partner_filter(parameters: AugmentedParameters, k_h: float) -> tuple[NDArray[Any], NDArray[Any], float]:
    """Return the step of the partner's hand, the gains of its stationary filter, and the variance of its aim [SI]."""
    p = parameters
    rates = np.zeros((_STATES, _STATES))
    rates[0, 1] = 1.0
    rates[1] = np.array([-p.partner_stiffness, -p.partner_damping, p.partner_stiffness]) / p.partner_mass
    rates[2, 2] = -1.0 / p.aim_time
    advance = expm(rates * TICK_SECONDS)
    noise = np.zeros((_STATES, _STATES))
    noise[2, 2] = p.aim_sd**2 * (1.0 - advance[2, 2] ** 2)
    seen = np.array([[1.0, 0.0, 0.0]])
    error = np.array([[(p.force_noise / max(k_h, 1.0)) ** 2 + p.sight_noise**2]])
    spread = solve_discrete_are(advance.T, seen.T, noise, error)
    gains = (spread @ seen.T / (seen @ spread @ seen.T + error))[:, 0]
    after = spread - np.outer(gains, seen @ spread)
    return advance, gains, float(after[2, 2])


@inlined
def _infer(partner: NDArray[np.float64], c: np.void, height: float) -> None:
    """Advance the filter of the partner's hand by a tick, and take in its height."""
    a, gains = c["advance"], c["gains"]
    h = a[0, 0] * partner[0] + a[0, 1] * partner[1] + a[0, 2] * partner[2]
    v = a[1, 0] * partner[0] + a[1, 1] * partner[1] + a[1, 2] * partner[2]
    goal = a[2, 2] * partner[2]
    error = height - h
    partner[0], partner[1], partner[2] = h + gains[0] * error, v + gains[1] * error, goal + gains[2] * error


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Infer the partner's goal, and steer to the mean of both."""
    c, sight, speed, own = k["steering"], state["sight"], 0.0, k["partner"]["weight"]
    if look(sight, c["board"], observation):
        board, partner = c["board"], state["partner"]
        height = partner_height(sight, board, load_on_hand(c, sight, observation))
        if abs(height) < board["l"]:
            _infer(partner, k["partner"], height)
        wanted = wanted_tilt(c, sight, sight["target"], 0.0, 0.0)
        theirs = clipped(-partner[2] / board["l"], board["max_tilt"]) if sight["free"] else 0.0
        speed = speed_of(c, sight, 1.0, own * wanted + (1.0 - own) * theirs, 0.0)
    state["target"] = move_hand(c["hand"], observation, state["target"], speed, actions)


@final
class Augmented(SteeringPolicy):
    """A robot that infers its partner's goal."""

    kind = "sensory augmentation"
    decide = staticmethod(decide)
    Parameters = AugmentedParameters
    State = _STATE
    sources = STEERING_SOURCES | {
        "partner_mass": _ARM,
        "partner_stiffness": _ARM,
        "partner_damping": _ARM,
        "aim_time": "about two submovements",
        "aim_sd": "the height of a hand that tilts the board by 2 deg with the other one",
        "force_noise": "assumed: a fifth of the friction of a Touch",
        "own_tilt_deg": "by hand: the robot's own tilt weighs about twice the partner's",
    }
    parameters: AugmentedParameters

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        packed = np.zeros(1, _CONSTANTS)
        packed["steering"] = pack_steering(config, self.parameters, side)[0]
        one = packed["partner"][0]
        one["advance"], one["gains"], variance = partner_filter(self.parameters, config.physics.k_h)
        theirs = variance / config.physics.l**2
        one["weight"] = theirs / (theirs + np.radians(self.parameters.own_tilt_deg) ** 2)
        return packed
