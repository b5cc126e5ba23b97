"""What an agent does and observes in an environment, and what it is rewarded for: tables of numbers with their scales.

An agent gets what the curtain lets its seat see, as late as the server shows it, and its own styluses and forces. The
true state is added only with `SceneOptions.truth`.
"""

from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.base.tick import TICK_SECONDS
from netboard.participants.robots.learned import INPUTS, PERIOD, SPEED


class Quantity(NamedTuple):
    """One number of an action or an observation: an action of 1, or an observed 1, is ``scale`` in ``unit``."""

    name: str
    scale: float
    unit: str
    offset: float = 0.0


ACTIONS = (
    Quantity("target", 0.075, "m"),  # equilibrium height of the hand
    Quantity("stiffness", 300.0, "N/m", 300.0),  # -1: none, 1: 600 N/m
    Quantity("damping", 10.0, "N s/m", 10.0),  # -1: none, 1: 20 N s/m
    Quantity("force", 3.0, "N"),  # force of the hand besides
)
"""What an agent may do with each of its hands, from -1 to 1; those of `SceneOptions.act`, in this order."""

SPEED_ACTION = Quantity("speed", SPEED, "m/s")
"""What an agent decides with the hand of a learned partner: the speed of the equilibrium point."""

VIEW = (
    Quantity("levelling", 1.0, "1"),  # 1 in this phase
    Quantity("running", 1.0, "1"),
    Quantity("holding", 1.0, "1"),
    Quantity("z", 0.05, "m"),
    Quantity("theta", 0.2, "rad"),
    Quantity("p", 0.35, "m"),
    Quantity("target", 0.1, "m"),
    Quantity("age", 0.1, "s"),
)
"""What each view shows; all 0 before the first."""

HAND = (Quantity("stylus_z", 0.075, "m"), Quantity("stylus_vz", 0.5, "m/s"), Quantity("force", 3.0, "N"))
"""What each own hand feels: height and velocity as its encoder reads them, and the vertical motor force."""

TRUTH = (
    Quantity("true_z", 0.05, "m"),
    Quantity("true_vz", 0.5, "m/s"),
    Quantity("true_theta", 0.2, "rad"),
    Quantity("true_omega", 2.0, "rad/s"),
    Quantity("true_p", 0.35, "m"),
    Quantity("true_vp", 0.5, "m/s"),
    Quantity("left_z", 0.075, "m"),
    Quantity("left_vz", 0.5, "m/s"),
    Quantity("right_z", 0.075, "m"),
    Quantity("right_vz", 0.5, "m/s"),
)
"""The true state, which no participant sees."""

STRICT, REDUCED = "strict", "reduced"
"""Fidelities of a simulation: that of the server, to the bit; and a faster one that differs from it."""

BOUND = 10.0
"""Observed numbers are clipped to this magnitude [1]."""


@dataclass(frozen=True, slots=True)
class RewardWeights:
    """Weights of the reward, which all agents of a scene share.

    A step gives ``-time dt + progress (potential - potential before)``, and the last one ``+ success`` if the ball
    has stayed in the target. The potential rises from -2 with a tilted board, over -1 when the ball is released, to 0
    in the centre of the target: no cycle gains anything. A failure takes the progress back, costs the rest of the time
    at once, and ``failure`` besides: so it never pays to drop the ball, nor to drop it soon.
    """

    time: float = 0.1  # [1/s]
    progress: float = 1.0
    success: float = 5.0
    failure: float = 5.0


@dataclass(frozen=True, slots=True)
class SceneOptions:
    """Options that all environments have.

    ``ticks``: ticks of 1 ms in a step. ``max_seconds``: length of an episode, after which it is truncated [s].
    ``views``: newest views in an observation. ``truth``: whether observations contain the true state. ``act``: what an
    agent decides of `ACTIONS`; the rest is that of the arm in ``[participant]``. ``record``: whether the rows of each
    episode are kept. ``learned_hand``: whether the one agent has the hand and the inputs of a learned partner
    (`netboard.participants.robots.learned`), and decides the speed of its equilibrium point; ``ticks`` is its period.
    ``fidelity``: ``strict``, the arithmetic and devices of the server, or ``reduced``, faster and not exactly the same
    (`netboard.participants.batch.reduced`).
    """

    ticks: int = 10
    max_seconds: float = 20.0
    views: int = 2
    truth: bool = False
    act: tuple[str, ...] = ("target",)
    record: bool = False
    learned_hand: bool = False
    fidelity: str = STRICT
    reward: RewardWeights = field(default_factory=RewardWeights)

    def __post_init__(self) -> None:
        """Refuse what no environment can be."""
        known = tuple(action.name for action in ACTIONS)
        if not self.act or not set(self.act) <= set(known) or len(set(self.act)) != len(self.act):
            raise ConfigError(f"act: found {self.act}, expected some of {', '.join(known)}")
        for name, least in (("ticks", 1), ("views", 1)):
            if getattr(self, name) < least:
                raise ConfigError(f"{name}: found {getattr(self, name)}, expected at least {least}")
        if not 0.0 < self.max_seconds <= 3600.0:
            raise ConfigError(f"max_seconds: found {self.max_seconds:g}, expected more than 0 and at most 3600")
        if self.learned_hand and self.ticks != PERIOD:
            raise ConfigError(f"ticks: found {self.ticks}, expected {PERIOD} with learned_hand")
        if self.fidelity not in (STRICT, REDUCED):
            raise ConfigError(f'fidelity: found {self.fidelity!r}, expected "strict" or "reduced"')
        if self.fidelity == REDUCED and (self.record or self.learned_hand):
            raise ConfigError(
                "fidelity: found reduced with record or learned_hand, expected strict: a recording of reduced scenes "
                "would not verify, and a learned partner needs a partner beside it"
            )
        for name in ("time", "progress", "success", "failure"):
            if not 0.0 <= getattr(self.reward, name) < inf:
                raise ConfigError(f"reward: found {name} {getattr(self.reward, name)}, expected a number from 0")

    @property
    def actions(self) -> tuple[Quantity, ...]:
        """What an agent decides for each of its hands."""
        if self.learned_hand:
            return (SPEED_ACTION,)
        return tuple(action for action in ACTIONS if action.name in self.act)

    def observed(self, hands: int) -> tuple[Quantity, ...]:
        """Return what an agent with one hand or two observes, in order: views from the newest, hands, true state."""
        if self.learned_hand:
            return tuple(Quantity(*one) for one in INPUTS)
        return VIEW * self.views + HAND * hands + (TRUTH if self.truth else ())


def scales_of(quantities: tuple[Quantity, ...]) -> NDArray[np.float64]:
    """Return the scales of some quantities, in their units."""
    return np.array([one.scale for one in quantities])


def weights_of(options: SceneOptions) -> NDArray[np.float64]:
    """Return what a reward is made of: costs of a tick and of a step, and weights of progress, success and failure."""
    weights, tick = options.reward, options.reward.time * TICK_SECONDS
    return np.array([tick, tick * options.ticks, weights.progress, weights.success, weights.failure])
