"""Game: a robot that plays a linear-quadratic game with its partner, whose gains it estimates (Li et al. 2019).

Ball and hands are ``e'' = a_robot + a_partner`` with the distance e to the target. Each player minimises the integral
of ``q1 e^2 + q2 e'^2 + a^2`` of its own, given what the other does: a Nash equilibrium. With
the partner's gains l1 and l2 (``a_partner = -l1 e - l2 e' + push``) its Riccati equation has a closed form::

    k1 = sqrt(l1^2 + q1) - l1        k2 = sqrt(l2^2 + q2 + 2 k1) - l2

The robot estimates the partner's gains and its constant push from the height of its hand, by a normalised gradient. It
also infers the partner's costs, ``l1^2 + 2 l1 k1`` and ``l2^2 + 2 l2 k2 - 2 l1``, and takes upon itself what remains of
the cost of the task, at least the share `least`. So it does little beside a partner who does much, and all beside one
who does nothing. The cost of the task is that of a robot alone with the gains `kp` and `kd`.

Li, Carboni, Gonzalez, Campolo and Burdet, Nat. Mach. Intell. 1:36, 2019.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Annotated, Any, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError
from netboard.base.settings import about
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
)

PUSH = 0.1
"""Unit of a constant push in the estimation, about the size of distances and velocities [m]."""


@dataclass(frozen=True, slots=True)
class GameParameters(SteeringParameters):
    """Parameters of the game."""

    learning: Annotated[
        float, about("share of the error of an estimated acceleration that a view corrects", "1", ge=0, le=1)
    ] = 0.02
    most_gain: Annotated[float, about("largest gain that the partner is believed to have", "1/s2", gt=0, le=100)] = 8.0
    least: Annotated[float, about("smallest share of the cost of the task that is the robot's", "1", gt=0, le=1)] = 0.1


_OWN = ("learning", "most_gain", "least")
_CONSTANTS = np.dtype([("steering", STEERING), *((name, "<f8") for name in (*_OWN, "q1", "q2"))])
_STATE = np.dtype(
    [
        ("sight", SIGHT),
        ("target", "<f8"),
        ("partner", "<f8", (3,)),  # estimated gains of the partner, and its push over `PUSH` [1/s2, 1/s, 1/s2]
        ("gains", "<f8", (2,)),  # of the robot [1/s2, 1/s]
    ]
)


@inlined
def best_response(l1: float, l2: float, q1: float, q2: float) -> tuple[float, float]:
    """Return the gains of a player with these costs, beside one with the gains l1 and l2 [1/s2, 1/s]."""
    k1 = sqrt(l1 * l1 + q1) - l1
    return k1, sqrt(l2 * l2 + q2 + 2.0 * k1) - l2


@inlined
def costs_of(l1: float, l2: float, k1: float, k2: float) -> tuple[float, float]:
    """Return the costs of a player with the gains l1 and l2, beside one with k1 and k2 [1/s4, 1/s2]."""
    return l1 * l1 + 2.0 * l1 * k1, l2 * l2 + 2.0 * l2 * k2 - 2.0 * l1


@inlined
def _estimate(state: np.void, k: np.void, load: float) -> None:
    """Correct the estimate of the partner's gains by a new view."""
    c, sight, partner = k["steering"], state["sight"], state["partner"]
    board, e, v = c["board"], sight["ball_now"] - sight["target"], sight["ball_rate_now"]
    pull = board["slope"] * partner_height(sight, board, load) / (2.0 * board["l"])
    most = board["max_tilt"] * abs(board["slope"])
    error = clipped(pull, most) + partner[0] * e + partner[1] * v - PUSH * partner[2]
    step = k["learning"] * error / (e * e + v * v + PUSH * PUSH)
    partner[0] = min(max(partner[0] - step * e, 0.0), k["most_gain"])
    partner[1] = min(max(partner[1] - step * v, 0.0), k["most_gain"])
    partner[2] = clipped(partner[2] + step * PUSH, most / PUSH)


@inlined
def _respond(state: np.void, k: np.void) -> None:
    """Update the robot's gains: what remains of the cost of the task, and the best response with it."""
    partner, gains = state["partner"], state["gains"]
    theirs1, theirs2 = costs_of(partner[0], partner[1], gains[0], gains[1])
    q1, q2 = max(k["q1"] - theirs1, k["least"] * k["q1"]), max(k["q2"] - theirs2, k["least"] * k["q2"])
    gains[0], gains[1] = best_response(partner[0], partner[1], q1, q2)


@inlined
def _played(state: np.void, k: np.void) -> float:
    """Return the height of the hand by which the robot's part tilts the board, without the ball's weight [m]."""
    c, sight, gains = k["steering"], state["sight"], state["gains"]
    board, e = c["board"], sight["ball_now"] - sight["target"]
    pull = gains[0] * e + gains[1] * sight["ball_rate_now"] + PUSH * state["partner"][2]
    height = 2.0 * board["l"] * clipped(pull / board["slope"], board["max_tilt"])
    return float(height + board["ball_weight"] * sight["ball_now"] / (board["k_h"] * board["l"]))


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Estimate the partner, and respond."""
    c, sight, speed = k["steering"], state["sight"], 0.0
    if look(sight, c["board"], observation):
        load = load_on_hand(c, sight, observation)
        if sight["free"] and c["board"]["slope"] != 0.0 and c["board"]["k_h"] > 0.0:
            if sight["fresh"] and abs(load) < np.inf:
                _estimate(state, k, load)
                _respond(state, k)
            speed = c["lead"] * (_played(state, k) - state["target"])
        else:
            speed = speed_of(c, sight, 1.0, 0.0, 0.0)
    state["target"] = move_hand(c["hand"], observation, state["target"], speed, actions)


@final
class Game(SteeringPolicy):
    """A robot that plays a game with its partner."""

    kind = "linear-quadratic game"
    decide = staticmethod(decide)
    Parameters = GameParameters
    State = _STATE
    sources = STEERING_SOURCES | {
        "learning": "by hand: a time constant of some fifty views, half a second",
        "most_gain": "twice the gain of a robot alone",
        "least": "assumed; without it, a robot beside a strong partner would do nothing at all",
    }
    parameters: GameParameters

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        p = self.parameters
        if p.kd**2 <= 2.0 * p.kp:
            raise ConfigError(
                f"[partners.{side}] kd: found {p.kd:g}, expected more than {sqrt(2.0 * p.kp):.3g}, the square root of "
                "2 kp: no quadratic cost has these gains as its optimum"
            )
        packed = np.zeros(1, _CONSTANTS)
        packed["steering"] = pack_steering(config, p, side)[0]
        packed["q1"], packed["q2"] = p.kp**2, p.kd**2 - 2.0 * p.kp
        for name in _OWN:
            packed[name] = getattr(p, name)
        return packed

    def initial(self, seed: tuple[int, ...]) -> NDArray[Any]:
        """Return its state at the start: the partner is believed to do nothing [SI]."""
        state = np.zeros(1, _STATE)
        state["gains"] = self.parameters.kp, self.parameters.kd
        return state
