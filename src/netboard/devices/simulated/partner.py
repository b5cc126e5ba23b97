"""Backend ``partner``: a robot partner holds the stylus of a simulated device, behind the agent's safety chain.

The partner is one of `netboard.participants.seat.partners`, with the parameters of ``[partners.<side>]``. It sees the
views that the agent hands over, reads its own stylus as the encoder does, and feels what the motors render.

Options (``agents.<side>.options``): see `PartnerOptions`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from math import nan
from typing import Annotated, Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, compiler_words, composed, inlined
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.devices.simulated.device import SimulatedDevice
from netboard.participants.body.stylus import (
    ACTION,
    MAX_HAND_FORCE,
    NOT_A_NUMBER,
    TOO_SLOW,
    TOO_STRONG,
    StylusMechanics,
    hold,
    let_go,
    let_go_unless_possible,
)
from netboard.participants.policy import OBSERVATION, TRUTH, Decide, Policy
from netboard.participants.seat.partners import make_partner

BACKEND = "partner"
"""Name of this backend."""

LET_GO = {
    NOT_A_NUMBER: "commanded what is not a number",
    TOO_STRONG: f"commanded a force of more than {MAX_HAND_FORCE:g} N",
    TOO_SLOW: "takes longer to decide than the millisecond that it has",
}
"""Why a partner has let go of the stylus, in words."""


@dataclass(frozen=True, slots=True)
class PartnerOptions:
    """Options of the robot partner."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    partner: Annotated[str, about("robot partner that holds the stylus", min_length=1)] = "robot"


class SeatedPolicy(NamedTuple):
    """A policy that holds a stylus, as the kernels see it."""

    state: NDArray[Any]  # of the policy, as its constants
    constants: NDArray[Any]
    observation: NDArray[Any]
    actions: NDArray[Any]
    reading: NDArray[Any]  # record of the device, with the newest reading and the force written last
    side: NDArray[np.int64]
    scale: NDArray[np.float64]  # factor of the board's force on the hand; 0 if the force tells nothing [1]
    deciding: NDArray[np.int64]  # 1 while the policy decides


def _decide(state: np.void, constants: np.void, observation: np.void, actions: Records) -> None:
    """Placeholder for the kernel of a policy, which `composed` replaces."""
    raise NotImplementedError


def _act(holder: SeatedPolicy, stylus: np.void, force: float, when: float, action: np.void) -> None:
    """Let the policy see, feel and act, unless it has let go."""
    if holder.reading[0]["faulty"]:
        let_go(action)
        return
    o, d, side = holder.observation[0], holder.reading[0], holder.side[0]
    o["tick"] += 1
    o["time"] = o["start"] = when
    o["height"][side], o["z"][side], o["vz"][side] = stylus["place"][2], d["z"], d["vz"]
    o["force"][side] = force
    scale = holder.scale[0]
    o["felt"] = d["written"][2] / scale if scale > 0.0 else nan
    holder.deciding[0] = 1
    _decide(holder.state[0], holder.constants[0], o, holder.actions)
    holder.deciding[0] = 0
    why = let_go_unless_possible(action)
    if why != 0:  # not written otherwise: another thread may have done so meanwhile
        d["faulty"] = why


@cache
def _act_with(decide: Decide) -> Callable[..., None]:
    """Compile what a policy does at an update of its hand."""
    return composed(_act, inlined, _decide=decide)


@final
class RobotPartner(SimulatedDevice):
    """A simulated device whose stylus a robot partner holds."""

    def __init__(self, side: Side, config: Config) -> None:
        try:
            super().__init__(side, config)
        except NetboardError:
            raise
        except Exception as error:  # of any type: the code of a lab, which is compiled here
            raise ConfigError(f"the robot partner {self.partner!r} cannot be used: {compiler_words(error)}") from error

    def _held(self, config: Config) -> tuple[StylusMechanics, Callable[..., None]]:
        self.partner = self.read_options(PartnerOptions).partner
        policy, state = _seated(self.partner, config, self.side)
        place = SIDES.index(self.side)
        self._constants, self._policy_state = policy.constants.copy(), state
        self.observation = np.zeros(1, OBSERVATION)
        self._actions, self._scale = np.zeros(len(SIDES), ACTION), np.zeros(1)
        self._deciding = np.zeros(1, np.int64)
        holder = SeatedPolicy(
            state,
            self._constants,
            self.observation,
            self._actions,
            self._state,
            np.array([place]),
            self._scale,
            self._deciding,
        )
        self.identity: Mapping[str, str] = policy.identity
        held = hold(self._model, policy.hand(), self._actions[place : place + 1], holder)
        self._forget()
        acts = _act_with(policy.decide)
        stylus = StylusMechanics(held, acts)
        stylus.put(*policy.across(state, self.side), 0.0)
        return stylus, acts

    def _details(self) -> dict[str, str]:
        return {**super()._details(), "partner": self.partner}

    def play(self, policy: Policy, state: NDArray[Any]) -> None:
        """Begin a block with the same partner, as `prepared` returns it."""
        self._constants[:], self._policy_state[:] = policy.constants, state
        self._actions[:] = np.zeros(len(SIDES), ACTION)
        self.identity = policy.identity
        self._forget()

    def prepared(self, config: Config) -> tuple[Policy, NDArray[Any]]:
        """Return this partner for the block of a configuration, and its state; this may take long."""
        return _seated(self.partner, config, self.side)

    def tell(self, scale: float) -> None:
        """Tell the partner the factor of the board's force on its hand; 0 if the force tells nothing [1]."""
        self._scale[0] = scale

    def _forget(self) -> None:
        """Forget what was observed in the block before."""
        self.observation[:] = np.zeros(1, OBSERVATION)
        self.observation["tick"] = -2  # -1 at the first update
        for name in TRUTH.names or ():
            self.observation["truth"][name] = nan
        self.observation["seen"]["time"] = nan
        self._device["faulty"] = 0

    @property
    def fault(self) -> str:
        """Why the partner has let go of the stylus in this block; empty if it has not."""
        why = LET_GO.get(int(self._device["faulty"]))
        return f"the robot partner {self.partner!r} {why}, and has let go of the stylus" if why else ""

    @property
    def decision(self) -> int | None:
        """Number of the decision that the partner is taking; None if it takes none at this moment."""
        return int(self.observation[0]["tick"]) if self._deciding[0] else None

    def let_go(self) -> None:
        """Let go of the stylus until the next block, because the partner decides too slowly."""
        self._device["faulty"] = TOO_SLOW


def _seated(name: str, config: Config, side: Side) -> tuple[Policy, NDArray[Any]]:
    """Return a partner for a block, and its state."""
    policy = make_partner(name, config, side)
    if policy.sees_truth:
        raise ConfigError(
            f"the robot partner {name!r} sees the true state of the scene, which an agent does not know; expected one "
            "that sees what its display shows"
        )
    return policy, policy.initial((config.block.seed, config.block.number))
