"""LQG: a robot that controls the whole board, from a Kalman filter on its views and a linear-quadratic regulator.

The filter follows `netboard.participants.robots.board_model` a tick at a time, driven by the reading of its hand.
Each view corrects it: the difference of what is shown and of what the filter had expected for the tick shown changes
the present state by ``A^d L``, with the delay d and the gains L of the stationary filter. The regulator moves the
equilibrium point of the hand with the speed ``-K (x - rest)``, where `rest` is the balance of the board with the ball
in the target and the partner's hand where the filter believes it. While the ball is fixed, another filter and another
regulator level the board.
"""

from dataclasses import replace
from functools import cache
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.tables.forces import Force
from netboard.base.tables.scene import Physics
from netboard.base.tables.simulated import VirtualDevice
from netboard.base.tick import TICK_SECONDS
from netboard.participants.robots.board_model import (
    BOARD_SOURCES,
    SEEN,
    WATCHED,
    BoardParameters,
    X,
    board_model,
    design,
    kalman_gains,
    loop_growth,
    lqr_gains,
)
from netboard.participants.robots.robot import HAND, RobotPolicy, move_hand, pack_hand, view_ticks
from netboard.participants.robots.sight import BOARD, PLAUSIBLE, SIGHT, look, pack_board
from netboard.physics.stability.delayed_coupling import ROUNDING, furthest

MEMORY = 128
"""Ticks for which what was expected to be seen is kept [1]."""

LONGEST_SIGHT = 40
"""Longest latency of a view that is considered [ms]."""

_Z, _TILT, _P, _PARTNER, _AIM = (X[name] for name in ("z", "tilt", "p", "partner", "aim"))

FILTER = np.dtype(
    [
        ("delay", "<i8"),  # from a tick to the view of it, in ticks [1]
        # With the ball fixed and free:
        ("advance", "<f8", (2, WATCHED, WATCHED + 3)),  # by the states, own height and speed, and gravity
        ("gains", "<f8", (2, WATCHED, len(SEEN))),  # of the present state by what is seen
    ]
)
"""Constants of a filter of the board [SI]."""

FILTERED = np.dtype(
    [
        ("x", "<f8", (WATCHED,)),
        ("ahead", "<f8", (WATCHED,)),  # of the tick that is computed
        ("expected", "<f8", (MEMORY, len(SEEN))),  # what was expected to be seen of the last ticks
        ("ticks", "<i8"),  # since the filter began [1]
    ]
)
"""State of a filter of the board."""

REGULATOR = np.dtype([("k", "<f8", (2, len(X))), ("rest", "<f8", (2, 3)), ("largest_error", "<f8")])
"""Constants of a regulator, with the ball fixed and free: gains, and the speed by 1, by the ball or target, by the aim
[SI]."""


def pack_filter(config: Config, parameters: BoardParameters, side: Side) -> NDArray[Any]:
    """Return the constants of a filter, packed for the kernels: ndarray of FILTER, shape (1,) [SI]."""
    packed = np.zeros(1, FILTER)
    delay = round(parameters.view_delay / TICK_SECONDS)
    packed["delay"] = delay
    for free in (False, True):
        model = board_model(config, parameters, side, free)
        late = np.linalg.matrix_power(model.watched[:, :WATCHED], delay)
        packed["advance"][0, int(free)] = model.watched
        packed["gains"][0, int(free)] = late @ kalman_gains(config, parameters, model)
    return packed


def pack_regulator(config: Config, parameters: BoardParameters, side: Side) -> NDArray[Any]:
    """Return the constants of a regulator, packed for the kernels: ndarray of REGULATOR, shape (1,) [SI]."""
    packed = np.zeros(1, REGULATOR)
    packed["largest_error"] = parameters.largest_error
    for free in (False, True):
        model = board_model(config, parameters, side, free)
        gains = lqr_gains(parameters, model, free)
        packed["k"][0, int(free)], packed["rest"][0, int(free)] = gains, gains @ model.rest
    return packed


@inlined
def follow(f: np.void, c: np.void, sight: np.void, board: np.void, observation: np.void, side: int) -> None:
    """Advance a filter by a tick, and take in a view that came in this tick."""
    x, ahead, mode, seen = f["x"], f["ahead"], sight["free"], observation["seen"]
    if f["ticks"] == 0:
        _begin(x, sight, board)
    a, own, rate = c["advance"][mode], observation["z"][side], observation["vz"][side]
    if not (abs(own) < PLAUSIBLE and abs(rate) < PLAUSIBLE):
        own = rate = 0.0
    for i in range(WATCHED):
        ahead[i] = a[i, WATCHED] * own + a[i, WATCHED + 1] * rate + a[i, WATCHED + 2]
        for j in range(WATCHED):
            ahead[i] += a[i, j] * x[j]
    expected = f["expected"][f["ticks"] % MEMORY]
    expected[0], expected[1], expected[2] = ahead[SEEN[0]], ahead[SEEN[1]], ahead[SEEN[2]]
    if sight["fresh"]:
        late, gains = f["expected"][max(f["ticks"] - c["delay"], 0) % MEMORY], c["gains"][mode]
        ball = board["sign"] * seen["p"] - late[2] if abs(seen["p"]) < PLAUSIBLE else 0.0
        z, tilt = seen["z"] - late[0], board["sign"] * seen["theta"] - late[1]
        for i in range(WATCHED):
            ahead[i] += gains[i, 0] * z + gains[i, 1] * tilt + gains[i, 2] * ball
    for i in range(WATCHED):
        x[i] = ahead[i]
    f["ticks"] += 1
    if not (abs(x[_P]) < PLAUSIBLE and abs(x[_Z]) < PLAUSIBLE and abs(x[_AIM]) < PLAUSIBLE):
        f["ticks"] = 0


@inlined
def _begin(x: NDArray[np.float64], sight: np.void, board: np.void) -> None:
    """Begin at rest, with the partner's hand at its end of the board."""
    for i in range(WATCHED):
        x[i] = 0.0
    x[_Z], x[_TILT], x[_P] = sight["z_now"], sight["tilt_now"], sight["ball_now"]
    x[_PARTNER] = x[_AIM] = sight["z_now"] - board["l"] * sight["tilt_now"]


@inlined
def regulated(f: np.void, r: np.void, sight: np.void, observation: np.void, side: int, point: float) -> float:
    """Return the speed of the equilibrium point by the regulator; ``point``: where it is now [m/s]."""
    x, mode, own = f["x"], sight["free"], observation["z"][side]
    k, rest, most = r["k"][mode], r["rest"][mode], r["largest_error"]
    goal = x[_P]
    if mode:
        goal += min(max(sight["target"] - x[_P], -most), most)
    speed = rest[0] + rest[1] * goal + rest[2] * x[_AIM]
    for i in range(WATCHED):
        speed -= k[i] * x[i]
    return float(speed - k[WATCHED] * own - k[WATCHED + 1] * observation["vz"][side] - k[WATCHED + 2] * point)


_CONSTANTS = np.dtype([("hand", HAND), ("board", BOARD), ("filter", FILTER), ("regulator", REGULATOR)])
_STATE = np.dtype([("sight", SIGHT), ("target", "<f8"), ("filter", FILTERED)])


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Estimate the board, and move the hand as the regulator says."""
    hand, sight, f, speed = k["hand"], state["sight"], state["filter"], 0.0
    active = look(sight, k["board"], observation)
    if sight["views"] > 0:
        follow(f, k["filter"], sight, k["board"], observation, hand["side"])
    if active and f["ticks"] > 0:
        speed = regulated(f, k["regulator"], sight, observation, hand["side"], state["target"])
    state["target"] = move_hand(hand, observation, state["target"], speed, actions)


PARTNERS = {"as modelled": 1.0, "held still": 100.0, "let go": 1e-3, "twice as stiff": 2.0}
"""Stiffness of a partner's hand relative to the model for which the control is stable [1]."""


def stable_latency_ms(config: Config, parameters: BoardParameters, partner: str) -> int:
    """Return the largest latency of a view, beyond `view_delay`, with which the control is stable [ms]."""
    force = "full" if config.block.haptics else "none"
    return _stable_latency(config.physics, config.virtual, force, config.network.view_rate_hz, parameters, partner)


@cache
def _stable_latency(
    physics: Physics, virtual: VirtualDevice, force: Force, views: float, parameters: BoardParameters, partner: str
) -> int:
    """Do so, for what the control depends on."""
    plain = Config()
    block, network = replace(plain.block, force=force), replace(plain.network, view_rate_hz=views)
    config = replace(plain, physics=physics, virtual=virtual, block=block, network=network)
    stiffness = PARTNERS[partner] * parameters.partner_stiffness
    true = board_model(config, replace(parameters, partner_stiffness=stiffness), "right", True)
    believed = design(config, parameters)
    return furthest(lambda latency: loop_growth(believed, true, latency) <= 1.0 + ROUNDING, LONGEST_SIGHT)


@final
class Lqg(RobotPolicy):
    """A robot that controls the whole board."""

    kind = "LQG"
    decide = staticmethod(decide)
    Parameters = BoardParameters
    State = _STATE
    sources = BOARD_SOURCES
    parameters: BoardParameters

    def stable_view_latency_ms(self, config: Config) -> int:
        """Return the largest latency of a view that is stable beside a passive partner of any of `PARTNERS`."""
        latencies = [stable_latency_ms(config, self.parameters, partner) for partner in PARTNERS]
        return min(latencies) + round(1e3 * self.parameters.view_delay) + view_ticks(config)

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        packed = np.zeros(1, _CONSTANTS)
        packed["hand"] = pack_hand(config, self.parameters, side)[0]
        packed["board"] = pack_board(config, self.parameters, side)[0]
        packed["filter"] = pack_filter(config, self.parameters, side)[0]
        packed["regulator"] = pack_regulator(config, self.parameters, side)[0]
        return packed
