"""The block that many scenes simulate: its agents, what else moves a hand, mechanics of hands, and what is refused."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import PERSON, STILL
from netboard.participants.batch.spaces import SceneOptions
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import MECHANICS, HandMechanics, pack_mechanics
from netboard.participants.people.muscles import hand_mechanics
from netboard.participants.policy import Nobody, Policy
from netboard.participants.robots.learned import Trainee
from netboard.participants.seat.body import refuse_flaws
from netboard.participants.seat.closed_loop import make_seat, policy_at

METHOD = "rk4"
"""The integration method of environments: the one that is compiled for lanes."""


class SeatedAgent(NamedTuple):
    """An agent: the station whose views it sees, and the hands that it moves."""

    station: Side
    sides: tuple[Side, ...]


class StepResult(NamedTuple):
    """Results of a step, for each scene; valid until the next."""

    reward: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


def block_of(config: Config, seat: str, other: str) -> tuple[Config, tuple[SeatedAgent, ...]]:
    """Return the configuration of a block of one trial, and its agents.

    Parameters
    ----------
    seat : str
        ``left`` or ``right``: one agent with one hand; ``both``: one with both hands; ``each``: two with one hand each.
    other : str
        What moves the other hand of one agent: ``person``, a simulated participant; ``still``; or a robot partner.
    """
    block = replace(config.block, trials=1, left=PERSON, right=PERSON, configuration="dyadic")
    if seat == "both":
        block = replace(block, configuration="bimanual")
        return replace(config, block=block), (SeatedAgent(block.station, SIDES),)
    if seat == "each":
        return replace(config, block=block), tuple(SeatedAgent(side, (side,)) for side in SIDES)
    if seat == "left":
        return replace(config, block=replace(block, right=other)), (SeatedAgent("left", ("left",)),)
    if seat == "right":
        return replace(config, block=replace(block, left=other)), (SeatedAgent("right", ("right",)),)
    raise ConfigError(f'seat: found {seat!r}, expected "left", "right", "both" or "each"')


def require(config: Config) -> None:
    """Refuse a block that environments do not simulate."""
    refuse_flaws(config)
    refused = {
        "[block] force": (config.block.force, config.block.force == "unrelated"),
        "[virtual] cable_stiffness": (config.virtual.cable_stiffness, resolved(config.virtual).cable_stiffness > 0.0),
        "[physics] ball_stop": (config.physics.ball_stop, config.physics.ball_stop > 0.0),
        "[physics] balls": (config.physics.balls, config.physics.balls != 1),
    }
    for key, (found, wrong) in refused.items():
        if wrong:
            raise ConfigError(f"{key}: found {found!r}, expected another value: environments do not simulate this")


def other_policy(config: Config, moved: set[Side]) -> tuple[Policy, Side]:
    """Return the policy of the hand that no agent moves, `Nobody` if it is held still, and its station."""
    for side, mover in zip(SIDES, (config.block.left, config.block.right), strict=True):
        if side not in moved and mover != STILL:
            people = {"A": config.participant, "B": config.participant}
            return policy_at(config, (side,), people), side
    return Nobody(), "left"


def robot_of(config: Config, agents: tuple[SeatedAgent, ...], options: SceneOptions) -> Policy:
    """Return the robot through which the agent acts, `Nobody` if it moves its hands itself."""
    if not options.learned_hand:
        return Nobody()
    if len(agents) != 1 or len(agents[0].sides) != 1:
        raise ConfigError("learned_hand: found with more than one hand, expected one agent with one hand")
    return Trainee(config, agents[0].sides[0])


def mechanics_of(config: Config, moved: Collection[Side], policy: Policy, robot: Policy) -> NDArray[Any]:
    """Return the mechanics of both hands, ndarray of MECHANICS, shape (2,) [SI].

    ``moved``: the hands of agents. ``policy``, ``robot``: those that move other hands, and through which an agent acts.
    """
    device = resolved(config.virtual)
    mechanics = np.zeros(len(SIDES), MECHANICS)
    for place, side in enumerate(SIDES):
        hand = HandMechanics()
        if side in robot.sides:
            hand = robot.hand()
        elif side in moved:
            hand = hand_mechanics(config.participant, device)
        elif side in policy.sides:
            hand = policy.hand()
        mechanics[place] = pack_mechanics(device, hand)[0]
    return mechanics


def timing_of(config: Config, agent: SeatedAgent) -> NDArray[np.int64]:
    """Return the ticks between two views of a station, and the first of them."""
    return make_seat(config, Nobody(), agent.station, (0,)).timing


def initial_doing(config: Config, agents: Sequence[SeatedAgent]) -> NDArray[np.float64]:
    """Return what the hands of agents do at the start, by quantity (`stepping.TARGET` and so on) and side."""
    doing, person = np.zeros((4, len(SIDES))), config.participant
    for agent in agents:
        for side in agent.sides:
            doing[1:3, SIDES.index(side)] = person.arm_stiffness, person.arm_damping
    return doing


def targets_of(config: Config, first: int, seeds: Sequence[int] | NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the side of the target in episodes with these seeds; ``first``: that of the block, unless it is random."""
    if config.block.first_target != "random":
        return np.full(len(seeds), first)
    return np.where(np.asarray(seeds) % 2 == 0, -1, 1)


def is_plain(array: NDArray[Any]) -> bool:
    """Return whether numbers of an agent are laid out as a kernel's machine code for float32 tables expects."""
    return array.dtype == np.float32 and array.ndim == 2 and bool(array.flags.carray)
