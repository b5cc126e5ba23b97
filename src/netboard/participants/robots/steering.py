"""From a wanted tilt to a movement of the hand: leading, following, and what lies between.

The equilibrium point h of the hand moves with a share ``role`` of leading::

    h' = role lead (l (wanted - tilt) - centring z) + (1 - role) force / admittance

with the tilt and height z of the board. Leading is integral control of the tilt. Following is an admittance: the hand
yields to the force of the board beyond what the hand carries at rest. With the spring at the board's centre, that force
is zero where both hands are at opposite heights, so a follower mirrors its partner, which doubles the tilt. Without
haptic feedback, the force is that of the virtual coupling, computed from the view. Heights are relative to the board at
rest on two hands at height 0.
"""

from dataclasses import dataclass
from functools import cache
from math import isnan
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.settings import about
from netboard.base.tick import TICK_SECONDS
from netboard.participants.robots.robot import HAND, SOURCES, RobotParameters, RobotPolicy, pack_hand
from netboard.participants.robots.sight import BOARD, pack_board
from netboard.physics.stability.delayed_coupling import ROUNDING, furthest


@dataclass(frozen=True, slots=True)
class SteeringParameters(RobotParameters):
    """Parameters of the robots that lead or follow."""

    lead: Annotated[float, about("rate at which leading corrects the tilt", "1/s", ge=0, le=40)] = 20.0
    centring: Annotated[
        float, about("height of the hand that leading corrects per height of the board", "1", ge=0, le=2)
    ] = 0.5
    admittance: Annotated[
        float, about("force of the board over the speed with which following yields to it", "N s/m", ge=1, le=100)
    ] = 2.6
    kp: Annotated[float, about("proportional gain: ball acceleration per distance", "1/s2", ge=0, le=16)] = 4.0
    kd: Annotated[float, about("derivative gain: ball acceleration per velocity", "1/s", ge=0, le=8)] = 4.0
    ki: Annotated[float, about("integral gain, by which a ball that has stopped is moved on", "1/s3", ge=0, le=10)] = (
        1.0
    )
    stall_speed: Annotated[float, about("velocity of the ball below which the integral grows", "m/s", gt=0, le=1)] = (
        0.03
    )


STEERING_SOURCES = SOURCES | {
    "lead": "twice the rate of following, so that leading and following act equally fast beside a hand that is still",
    "centring": "that of a simulated participant, rounded",
    "admittance": "a time constant of 0.1 s: as the hand yields, the board's force falls by 26 N/m",
    "kp": "a critically damped ball with a time constant of 0.5 s",
    "kd": "the same",
    "ki": "a quarter of kp a second; without it, a robot and a participant who waits can hold each other for minutes",
    "stall_speed": "by hand: a tenth of the velocity of a ball under way",
}
"""Source of the default of each parameter of robots that lead or follow."""

_GAINS = ("lead", "centring", "admittance", "kp", "kd", "ki", "stall_speed")

STEERING = np.dtype([("hand", HAND), ("board", BOARD), *((name, "<f8") for name in _GAINS)])
"""Constants of a robot that leads or follows."""


def pack_steering(config: Config, parameters: SteeringParameters, side: Side) -> NDArray[Any]:
    """Return the constants of leading and following, for the kernels: ndarray of STEERING, shape (1,) [SI]."""
    packed = np.zeros(1, STEERING)
    packed["hand"] = pack_hand(config, parameters, side)[0]
    packed["board"] = pack_board(config, parameters, side)[0]
    for name in _GAINS:
        packed[name] = getattr(parameters, name)
    return packed


LONGEST_STEERING = 120
"""Longest latency considered for leading [ms]."""


def steering_matrix(parameters: SteeringParameters, role: float, latency: int) -> NDArray[np.float64]:
    """Return the matrix of a tick of ball and tilt under leading, shape (n, n) [SI].

    The light board is taken to follow the hands at once. The state: ball, its velocity, the acceleration that the tilt
    takes from it, and the rates of change of this one that are under way.

    Parameters
    ----------
    role : float
        Share of leading: of both hands where the partner does the same, half of it where the partner is still [1].
    latency : int
        From the motion of the board to the motion of the hand, in ticks [1].
    """
    h = TICK_SECONDS
    rate = np.zeros(3 + latency)
    rate[:3] = role * parameters.lead * np.array([parameters.kp, parameters.kd, -1.0])
    a = np.zeros((3 + latency, 3 + latency))
    a[:3, :3] = [[1.0, h, -0.5 * h * h], [0.0, 1.0, -h], [0.0, 0.0, 1.0]]
    if latency == 0:
        a[2] += h * rate
        return a
    a[2, -1], a[3] = h, rate
    a[4:, 3:-1] = np.eye(latency - 1)
    return a


@cache
def steering_latency_ms(parameters: SteeringParameters, role: float) -> int:
    """Return the largest latency with which leading is stable; -1 if it is unstable without any [ms]."""

    def is_stable(latency: int) -> bool:
        return float(np.abs(np.linalg.eigvals(steering_matrix(parameters, role, latency))).max()) <= 1.0 + ROUNDING

    return furthest(is_stable, LONGEST_STEERING)


class SteeringPolicy(RobotPolicy):
    """A robot that leads or follows."""

    parameters: SteeringParameters

    def stable_view_latency_ms(self, config: Config) -> int:
        """Return the largest latency of leading that is stable beside a partner that leads as well, or is still."""
        return min(steering_latency_ms(self.parameters, role) for role in (0.5, 1.0))


@inlined
def clipped(value: float, limit: float) -> float:
    """Limit a value in both directions."""
    return min(max(value, -limit), limit)


@inlined
def wanted_tilt(c: np.void, sight: np.void, target: float, rate: float, pull: float) -> float:
    """Return the tilt that takes the ball along a path: a PD law about a feed-forward, with an integral [rad].

    ``tilt = (kp (ball - target) + kd (ball' - rate) + integral - pull) / slope``

    The integral of ``ki`` times the distance grows only while the ball hardly moves, and begins anew with each release.

    Parameters
    ----------
    target, rate, pull : float
        Position, velocity and acceleration of the ball on the path [m, m/s, m/s2].
    """
    board = c["board"]
    if sight["free"] == 0 or board["slope"] == 0.0:
        sight["integral"] = 0.0
        return 0.0
    error, drift = sight["ball_now"] - target, sight["ball_rate_now"] - rate
    if abs(sight["ball_rate_now"]) < c["stall_speed"]:
        most = board["max_tilt"] * abs(board["slope"])
        sight["integral"] = clipped(sight["integral"] + c["ki"] * TICK_SECONDS * error, most)
    wanted = c["kp"] * error + c["kd"] * drift + sight["integral"] - pull
    return clipped(wanted / board["slope"], board["max_tilt"])


@inlined
def speed_of(c: np.void, sight: np.void, role: float, wanted: float, load: float) -> float:
    """Return the speed of the hand for a share of leading, a wanted tilt and the load on the hand [m/s]."""
    board = c["board"]
    error = board["l"] * (wanted - sight["tilt_now"]) - c["centring"] * (sight["z_now"] - board["rest"])
    return float(role * c["lead"] * error + (1.0 - role) * load / c["admittance"])


@inlined
def load_on_hand(c: np.void, sight: np.void, observation: np.void) -> float:
    """Return the force of the board on the hand beyond that at rest, + = up [N]."""
    board, felt = c["board"], observation["felt"]
    force = felt
    if isnan(felt):
        height = observation["z"][c["hand"]["side"]]
        force = board["k_h"] * (sight["z_now"] + board["l"] * sight["tilt_now"] - height)
    share = board["carried"] + 0.5 * board["ball_weight"] * sight["ball_now"] / board["l"]
    return float(force + share)


@inlined
def partner_force(sight: np.void, board: np.void, load: float) -> float:
    """Return the partner's force on the board beyond that at rest, from the balance of a light board [N]."""
    return float(load + board["k_s"] * (sight["z_now"] - board["rest"]))


@inlined
def partner_height(sight: np.void, board: np.void, load: float) -> float:
    """Return the height of the partner's hand: that of its end of the board, and the stretch of its coupling [m]."""
    end = sight["z_now"] - board["rest"] - board["l"] * sight["tilt_now"]
    if board["k_h"] == 0.0:
        return float(end)
    force = partner_force(sight, board, load) - 0.5 * board["ball_weight"] * sight["ball_now"] / board["l"]
    return float(end + force / board["k_h"])
