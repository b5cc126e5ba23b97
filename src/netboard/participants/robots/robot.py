"""What all robots share: a hand of constant impedance whose force is bounded, and the parameters of hand and sight.

The hand pulls the stylus to an equilibrium point with a spring and a damper, and compensates most of the device's
friction, as a robot with a friction model does. The equilibrium point never leads the stylus by more than the largest
force over the stiffness. With the speed of the equilibrium point as feed-forward, the hand follows it without the lag
of its damper.

Rule 1: an observation that is not finite moves nothing, and a hand that cannot be read exerts no force.
Rule 2: a hand whose virtual coupling is unstable at the delay of its loop is refused (`require_stable`).
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import ceil
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.base.tick import TICK_SECONDS
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import HandMechanics
from netboard.participants.policy import Policy, identity_of, parameters_of
from netboard.physics.stability.delayed_coupling import FIXED, LONGEST, Loop, Mechanism, ends_of, largest_round_trip

MARGIN = 2.0
"""Largest stable latency of a robot's virtual coupling over that of its loop, at least [1]."""


@dataclass(frozen=True, slots=True)
class HandParameters:
    """Parameters of the hand, which each robot has."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    hand_mass: Annotated[float, about("mass of the robot's hand", "kg", gt=0, le=5)] = 0.3
    hand_stiffness: Annotated[
        float, about("stiffness of the hand towards its equilibrium point", "N/m", gt=0, le=2000)
    ] = 300.0
    hand_damping: Annotated[float, about("damping of the hand", "N s/m", ge=0, le=200)] = 15.0
    friction_skill: Annotated[
        float, about("share of the device's friction that the hand compensates", "1", ge=0, le=1)
    ] = 0.8
    max_force: Annotated[
        float, about("largest force of the hand; that of [safety] applies if it is smaller", "N", gt=0, le=40)
    ] = 3.0
    max_speed: Annotated[float, about("largest speed of the equilibrium point", "m/s", gt=0, le=2)] = 0.2
    stale: Annotated[float, about("age of the newest view beyond which the robot stops its hand", "s", gt=0, le=10)] = (
        0.25
    )
    loop_latency_ms: Annotated[
        float, about("sample-to-force latency of the hand's loop, for the check of its stability", "ms", ge=0, le=60)
    ] = 2.0


@dataclass(frozen=True, slots=True)
class RobotParameters(HandParameters):
    """Parameters of hand and sight, which each robot has that steers."""

    max_tilt_deg: Annotated[float, about("largest tilt that the robot wants", "deg", gt=0, le=20)] = 3.0
    view_delay: Annotated[float, about("time from a tick to the view of it", "s", ge=0, le=0.1)] = 0.001
    ball_noise: Annotated[
        float,
        about("standard deviation of the ball's unmodelled acceleration, in its Kalman filter", "m/s2", gt=0, le=100),
    ] = 0.5
    sight_noise: Annotated[
        float, about("standard deviation of a seen position, in its Kalman filter", "m", gt=0, le=0.1)
    ] = 0.0003


_HAND = "assumed: the mass of a light robot's end, a stiffness within the 100 to 500 N/m of arms, damped to 0.7"
_LOOP = "measured: 1 ms at most in 99.9 % of the ticks of a rig (latency and jitter of the loop), doubled"
HAND_SOURCES = {
    "hand_mass": _HAND,
    "hand_stiffness": _HAND,
    "hand_damping": _HAND,
    "friction_skill": "as a simulated participant",
    "max_force": "the safety limit of the agent",
    "max_speed": "assumed: about the peak speed of a minimum-jerk movement of 30 mm in 0.3 s",
    "stale": "thirty views",
    "loop_latency_ms": _LOOP,
}
"""Source of the default of each parameter of the hand."""

SOURCES = HAND_SOURCES | {
    "max_tilt_deg": "the largest tilt of a simulated participant, rounded",
    "view_delay": "a tick, as in a rehearsal",
    "ball_noise": "the acceleration of a ball by a tilt of 3 deg",
    "sight_noise": "half a pixel of the display",
}
"""Source of the default of each parameter of hand and sight."""

HAND = np.dtype(
    [
        ("side", "<i8"),  # 0: left, 1: right
        ("stiffness", "<f8"),  # [N/m]
        ("damping", "<f8"),  # [N s/m]
        ("max_force", "<f8"),  # [N]
        ("max_speed", "<f8"),  # [m/s]
        ("reach", "<f8"),  # largest height of the equilibrium point [m]
    ]
)
"""A robot's hand."""


def pack_hand(config: Config, parameters: HandParameters, side: Side) -> NDArray[Any]:
    """Return the constants of a hand, packed for the kernels: ndarray of HAND, shape (1,) [SI]."""
    packed = np.zeros(1, HAND)
    packed["side"] = SIDES.index(side)
    packed["stiffness"], packed["damping"] = parameters.hand_stiffness, parameters.hand_damping
    packed["max_force"] = min(parameters.max_force, config.safety.max_force)
    packed["max_speed"] = parameters.max_speed
    packed["reach"] = min(config.task.stylus_range, resolved(config.virtual).workspace)
    return packed


@inlined
def aim(hand: np.void, observation: np.void, target: float, speed: float, action: np.void) -> float:
    """Pull the hand to an equilibrium point that moves at a speed, with a bounded force; return the point [m, m/s].

    The point is limited to the reach of the hand, and to a distance from the stylus at which the force is largest.
    """
    height, limit, stiffness = observation["z"][hand["side"]], hand["max_force"], hand["stiffness"]
    place, force = action["target"], action["force"]
    place[0] = place[1] = place[2] = force[0] = force[1] = force[2] = 0.0
    if not (abs(height) < np.inf and abs(target) < np.inf and abs(speed) < np.inf):
        action["stiffness"], action["damping"] = 0.0, hand["damping"]
        return 0.0
    target = min(max(target, -hand["reach"]), hand["reach"])
    lead = min(max(target - height, -limit / stiffness), limit / stiffness)
    pull = stiffness * lead
    action["stiffness"], action["damping"] = stiffness, hand["damping"]
    place[2] = height + lead
    force[2] = min(max(hand["damping"] * speed, -limit - pull), limit - pull)
    return float(target)


@inlined
def moved(hand: np.void, target: float, speed: float) -> tuple[float, float]:
    """Move an equilibrium point for a tick, at a limited speed; return its new place and its speed [m, m/s]."""
    speed = min(max(speed, -hand["max_speed"]), hand["max_speed"])
    place = min(max(target + speed * TICK_SECONDS, -hand["reach"]), hand["reach"])
    return place, (place - target) / TICK_SECONDS


@inlined
def move_hand(hand: np.void, observation: np.void, target: float, speed: float, actions: NDArray[Any]) -> float:
    """Move an equilibrium point at a speed for a tick, and pull the hand to it; return its new place [m, m/s]."""
    target, speed = moved(hand, target, speed)
    return aim(hand, observation, target, speed, actions[hand["side"]])


def view_ticks(config: Config) -> int:
    """Return the ticks between two views [1]."""
    return ceil(1.0 / (TICK_SECONDS * config.network.view_rate_hz))


def loops_of(config: Config, parameters: HandParameters) -> list[Loop]:
    """Return the virtual-coupling loops of a robot's hand: at a board held fast, and at a free board."""
    physics, device = config.physics, resolved(config.virtual)
    if physics.coupling == "none" or physics.k_h == 0.0:
        return []
    hand = Mechanism(
        device.mass + parameters.hand_mass,
        device.damping + parameters.hand_damping,
        parameters.hand_stiffness,
        substeps=4,
    )
    plain = Loop(hand, k=physics.k_h, c=physics.c_h, hold=physics.hold, window=1)
    return [replace(plain, end=end) for end in (FIXED, *ends_of(physics).values())]


@cache
def stable_latency_ms(loop: Loop) -> int:
    """Return the largest stable sample-to-force latency of a loop, up to `LONGEST` [ms]."""
    return largest_round_trip(loop)


class UnstableError(ConfigError):
    """A robot does not steer stably at `MARGIN` times the latency of views and loop, only up to `limit_ms`."""

    def __init__(self, side: Side, kind: str, limit_ms: int, needed_ms: float) -> None:
        self.limit_ms = limit_ms
        super().__init__(
            f"[partners.{side}] the {kind} steers stably up to a latency of {limit_ms} ms, expected at least "
            f"{needed_ms:g} ms ({MARGIN:g} times that of views and loop); smaller gains are stable for longer"
        )


def require_stable(config: Config, parameters: HandParameters, side: Side) -> None:
    """Refuse a hand whose loop is not stable at `MARGIN` times its latency.

    The latency is that of the loop, and the delay that the block adds to the force.

    Raises
    ------
    ConfigError
        If the hand is refused.
    """
    if not config.block.haptics:
        return
    needed = min(MARGIN * parameters.loop_latency_ms + config.block.force_delay_ms, LONGEST)
    limit = min((stable_latency_ms(loop) for loop in loops_of(config, parameters)), default=LONGEST)
    if limit < needed:
        raise ConfigError(
            f"[partners.{side}] hand_mass, hand_stiffness, hand_damping: this hand on the virtual coupling is stable "
            f"up to a latency of {limit} ms, expected at least {needed:g} ms ({MARGIN:g} times loop_latency_ms, and "
            "[block] force_delay_ms); a hand that is stiffer, or has more damping, is stable for longer"
        )


class HandPolicy(Policy):
    """A robot that holds one stylus; a partner says its parameters, its records and its kernel."""

    sources: ClassVar[Mapping[str, str]]
    Parameters: ClassVar[type[HandParameters]]
    State: ClassVar["np.dtype[Any]"]

    def __init__(self, config: Config, side: Side) -> None:
        self.sides = (side,)
        self.parameters = parameters_of(self.Parameters, config, side)
        self.require_stable(config, side)
        self._device = resolved(config.virtual)
        self.constants = self.pack(config, side)

    def require_stable(self, config: Config, side: Side) -> None:
        """Refuse parameters with which a loop is not stable at `MARGIN` times its latency."""
        require_stable(config, self.parameters, side)

    @abstractmethod
    def pack(self, config: Config, side: Side) -> NDArray[Any]:
        """Return its constants for the kernel [SI]."""

    def initial(self, seed: tuple[int, ...]) -> NDArray[Any]:
        """Return its state at the start; nothing in it is random [SI]."""
        return np.zeros(1, self.State)

    def hand(self) -> HandMechanics:
        """Return what its hand adds to the mechanics of a device."""
        p = self.parameters
        friction = p.friction_skill * self._device.friction
        return HandMechanics(p.hand_mass, friction, None)

    @property
    def identity(self) -> Mapping[str, str]:
        """What is recorded of it."""
        return identity_of(self.kind, self.parameters)


class RobotPolicy(HandPolicy):
    """A robot that steers by what it sees."""

    Parameters: ClassVar[type[RobotParameters]]
    parameters: RobotParameters

    @abstractmethod
    def stable_view_latency_ms(self, config: Config) -> int:
        """Return the largest latency from the board to its hand with which it steers stably; -1 if with none [ms]."""

    def require_stable(self, config: Config, side: Side) -> None:
        """Refuse parameters that do not steer stably at `MARGIN` times the latency of views and loop, either."""
        super().require_stable(config, side)
        seen = 1e3 * (self.parameters.view_delay + view_ticks(config) * TICK_SECONDS)
        needed = MARGIN * (seen + self.parameters.loop_latency_ms)
        limit = self.stable_view_latency_ms(config)
        if limit < needed:
            raise UnstableError(side, self.kind, limit, needed)
