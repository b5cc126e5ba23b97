"""Learned partner: a robot whose hand moves as a small neural network says, which was trained in simulation.

Every `PERIOD` ticks the network decides at what speed the equilibrium point of the hand moves, from what the robot sees
and feels at that tick (`INPUTS`). Its answer applies from the next tick on. Hand and sight are those of the other
robots, and all is in coordinates of its own side, so one network plays both sides.

Rule 1: a `Trainee` has the same hand and the same inputs, to the bit, but its speed is set from outside: the network
that is trained with it does the same as a `Learned` partner.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files
from typing import Annotated, Any, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.base.files.text import read_text
from netboard.base.settings import about
from netboard.base.tick import TICK_SECONDS
from netboard.participants.policy import identity_of, parameters_of
from netboard.participants.robots.network import (
    Input,
    TrainedNetwork,
    pack_network,
    packed_as,
    parse_network,
    run,
    sha256_of,
    units_of,
)
from netboard.participants.robots.network_stability import NetworkGains, largest_view_latency, resting_boards
from netboard.participants.robots.robot import HAND, SOURCES, RobotParameters, RobotPolicy, move_hand, pack_hand
from netboard.participants.robots.sight import BOARD, SIGHT, look, pack_board
from netboard.participants.robots.steering import load_on_hand
from netboard.physics.stability.delayed_coupling import LONGEST

PERIOD = 20
"""Ticks between two decisions of the network [1]."""

SPEED = 0.2
"""Speed of the equilibrium point for an output of 1 [m/s]."""

STALL_SPEED = 0.03
"""Velocity of the ball below which the integral of its error grows, as in the other robots [m/s]."""

MOST_STALL = 0.3
"""Largest integral of the error [m s]."""

INPUT_BOUND = 10.0
"""Inputs are limited to this magnitude [1]."""

PACKAGED = "learned"
"""Name of the weights that come with netboard."""

INPUTS = (
    Input("active", 1.0, "1"),  # 1: a trial is under way
    Input("free", 1.0, "1"),  # 1: the ball is free
    Input("error", 0.15, "m"),  # position of the ball relative to the target
    Input("ball", 0.15, "m"),
    Input("ball_rate", 0.2, "m/s"),
    Input("tilt", 0.03, "rad"),
    Input("tilt_rate", 0.15, "rad/s"),
    Input("z", 0.01, "m"),  # height of the board relative to that at rest
    Input("z_rate", 0.05, "m/s"),
    Input("stylus_z", 0.02, "m"),
    Input("stylus_vz", 0.1, "m/s"),
    Input("lead", 0.01, "m"),  # equilibrium point relative to the stylus
    Input("load", 1.0, "N"),  # force of the board on the hand beyond that at rest
    Input("speed", SPEED, "m/s"),  # of the equilibrium point, as last decided
    Input("stall", 0.1, "m s"),  # integral of the error while the ball hardly moves, since its release
)
"""What the network gets at a decision, in coordinates of the robot's side, from `netboard.participants.robots.sight`.
All are 0 if no trial is under way, and those of the ball while it is fixed."""

_RATES = tuple(1.0 / one.scale for one in INPUTS)


@dataclass(frozen=True, slots=True)
class LearnedParameters(RobotParameters):
    """Parameters of a learned partner."""

    weights: Annotated[str, about("file of weights, from netboard train; learned: the one that comes with it")] = (
        PACKAGED
    )


# What a `Learned` partner has besides goes before these: a record that begins like another one is its subtype to Numba,
# which warns of it, and compiles a kernel for one of them only.
_COMMON = [("hand", HAND), ("board", BOARD)]
_STATE = [("sight", SIGHT), ("target", "<f8"), ("speed", "<f8"), ("stall", "<f8")]


@inlined
def _sense(state: np.void, k: np.void, observation: np.void, active: bool, x: NDArray[np.float64]) -> None:
    """Write the inputs of a decision."""
    board, sight, side = k["board"], state["sight"], k["hand"]["side"]
    height = observation["z"][side]
    x[0], x[1] = 1.0, sight["free"]
    x[2], x[3], x[4] = sight["ball_now"] - sight["target"], sight["ball_now"], sight["ball_rate_now"]
    x[5], x[6] = sight["tilt_now"], sight["tilt_rate"]
    x[7], x[8] = sight["z_now"] - board["rest"], sight["z_rate"]
    x[9], x[10] = height, observation["vz"][side]
    x[11], x[12], x[13] = state["target"] - height, load_on_hand(k, sight, observation), state["speed"]
    x[14] = state["stall"]
    if sight["free"] == 0:
        x[2] = x[3] = x[4] = 0.0
    for i, rate in enumerate(_RATES):
        value = x[i] * rate
        x[i] = min(max(value, -INPUT_BOUND), INPUT_BOUND) if active and abs(value) < np.inf else 0.0


@inlined
def _move(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> bool:
    """Look, and move the hand at the speed that was decided; return whether a trial is under way."""
    hand = k["hand"]
    active = look(state["sight"], k["board"], observation)
    if active:
        _note_stall(state)
    state["target"] = move_hand(hand, observation, state["target"], state["speed"] if active else 0.0, actions)
    return bool(active)


@inlined
def _note_stall(state: np.void) -> None:
    """Integrate the error while the ball hardly moves; begin anew with each release."""
    sight = state["sight"]
    if sight["free"] == 0:
        state["stall"] = 0.0
    elif abs(sight["ball_rate_now"]) < STALL_SPEED:
        grown = state["stall"] + TICK_SECONDS * (sight["ball_now"] - sight["target"])
        state["stall"] = min(max(grown, -MOST_STALL), MOST_STALL)


@inlined
def _is_decision(tick: int) -> bool:
    """Return whether the network decides at a tick: at -1, and then in every `PERIOD` ticks."""
    return (tick + 1) % PERIOD == 0


@inlined
def decide(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Move the hand, and let the network decide in each period."""
    active = _move(state, k, observation, actions)
    if _is_decision(observation["tick"]):
        _sense(state, k, observation, active, state["units"]["units_0"])
        state["speed"] = SPEED * min(max(run(k["network"], state["units"]), -1.0), 1.0)


@inlined
def _decide_told(state: np.void, k: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Move the hand, and write the inputs for who decides in place of a network."""
    active = _move(state, k, observation, actions)
    if _is_decision(observation["tick"]):
        _sense(state, k, observation, active, state["inputs"])


def read_weights(source: str) -> tuple[TrainedNetwork, str]:
    """Read a file of weights, or those that come with netboard, by their name; return them and the file's SHA-256.

    The file is read each time, because an agent lives longer than a session, before which it may be trained again.

    Raises
    ------
    ConfigError
        If it cannot be read, or is not one.
    """
    expected = f"expected the weights.json that netboard train writes, or {PACKAGED}"
    packaged = files(__package__) / f"{PACKAGED}.json"
    if source == PACKAGED:
        return _parsed(packaged.read_text(encoding="utf-8"), source)
    return _parsed(read_text(source, f"no such file; {expected}", expected), source)


@lru_cache(maxsize=4)
def _parsed(text: str, source: str) -> tuple[TrainedNetwork, str]:
    return parse_network(text, source, INPUTS, PERIOD), sha256_of(text)


def gains_at(network: TrainedNetwork, target: float) -> NetworkGains:
    """Return the derivatives of the decided speed where the ball rests in a target, at ``target`` times 0.15 m."""
    rest = np.zeros(len(INPUTS))
    rest[[place for place, one in enumerate(INPUTS) if one.name in ("active", "free")]] = 1.0
    rest[[one.name for one in INPUTS].index("ball")] = target
    by = {one.name: SPEED * slope / one.scale for one, slope in zip(INPUTS, network.derivatives(rest), strict=True)}
    return NetworkGains(
        ball=by["error"] + by["ball"],
        ball_rate=by["ball_rate"],
        tilt=by["tilt"],
        tilt_rate=by["tilt_rate"],
        z=by["z"],
        z_rate=by["z_rate"],
        height=by["stylus_z"],
        load=by["load"],
        speed=by["speed"] + by["stylus_vz"],
    )


class _NetworkHand(RobotPolicy):
    """A robot whose hand moves at decided speeds."""

    Parameters = LearnedParameters
    sources = SOURCES | {"weights": "by netboard train, as the card in the file says"}
    parameters: LearnedParameters

    def _pack(self, dtype: "np.dtype[Any]", config: Config, side: Side) -> NDArray[Any]:
        """Return its constants, with hand and sight filled in."""
        packed = np.zeros(1, dtype)
        packed["hand"] = pack_hand(config, self.parameters, side)[0]
        packed["board"] = pack_board(config, self.parameters, side)[0]
        return packed


@final
class Learned(_NetworkHand):
    """A robot that does what a trained network says."""

    kind = "learned"
    decide = staticmethod(decide)

    def __init__(self, config: Config, side: Side) -> None:
        weights = parameters_of(LearnedParameters, config, side).weights
        self.network, self.weights_sha256 = read_weights(weights)
        self._state = np.dtype([("units", units_of(self.network.sizes)), *_STATE])
        super().__init__(config, side)

    def stable_view_latency_ms(self, config: Config) -> int:
        """Return the largest latency with which the network, linearised at rest in either target, steers stably."""
        board = pack_board(config, self.parameters, "right")[0]
        boards = resting_boards(board["l"], board["k_h"], board["k_s"], board["slope"])
        return min(largest_view_latency(gains_at(self.network, side), boards, PERIOD) for side in (-1.0, 1.0))

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        packed = self._pack(np.dtype([("network", packed_as(self.network.sizes)), *_COMMON]), config, side)
        packed["network"] = pack_network(self.network)[0]
        return packed

    def initial(self, seed: tuple[int, ...]) -> NDArray[Any]:
        """Return its state at the start; nothing in it is random [SI]."""
        return np.zeros(1, self._state)

    @property
    def identity(self) -> Mapping[str, str]:
        """What is recorded of it: the name of the file of weights, and its SHA-256, among its parameters."""
        name = self.parameters.weights.replace("\\", "/").rsplit("/", 1)[-1]
        return identity_of(self.kind, replace(self.parameters, weights=name), weights_sha256=self.weights_sha256)


@final
class Trainee(_NetworkHand):
    """The hand and the inputs of a learned partner, for training: its speed is set from outside.

    Between two steps of `PERIOD` ticks, ``speed`` of its state is set, and ``inputs`` is read.
    """

    kind = "trainee"
    decide = staticmethod(_decide_told)
    State = np.dtype([*_STATE, ("inputs", "<f8", (len(INPUTS),))])

    def stable_view_latency_ms(self, config: Config) -> int:
        """Return `LONGEST`: what decides is not known."""
        return LONGEST

    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""
        return self._pack(np.dtype(_COMMON), config, side)
