"""A seat: a policy behind the curtain, which sees its station's views, feels its own hands, and acts.

Rule 1: `netboard.stage.curtain.glimpse` says what it sees, at the server's view rate and one tick late. Rule 2: the
force tells something of the partner only where it determines the partner's height: with the full force of the board.
Any other force pushes the hand, but carries no information. Rule 3: time is that of the ticks; randomness comes from
the given seed.
"""

from collections.abc import Callable, Mapping
from functools import cache
from math import ceil, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Numbers, Records, Words, composed, inlined
from netboard.base.config import SIDES, Config, Side
from netboard.base.tables.simulated import Participant
from netboard.base.tick import START_NS, TICK_NS, TICK_SECONDS, TICK_WORDS
from netboard.participants.body.stylus import let_go_unless_possible
from netboard.participants.people.person import ParticipantPolicy
from netboard.participants.policy import OBSERVATION, TRUTH, Decide, Policy
from netboard.participants.seat.body import LEAD_NS
from netboard.participants.seat.partners import make_partner
from netboard.stage.curtain import glimpse, make_curtain
from netboard.task.trials.state_machine import is_active

_TICK, _TIME, _PHASE, _TRIAL = (TICK_WORDS[name] for name in ("tick", "time_ns", "phase", "trial"))
_SCENE = tuple(TICK_WORDS[name] for name in ("z", "vz", "theta", "omega", "p", "vp"))


class Seat(NamedTuple):
    """A policy in its seat, as the kernels see it."""

    state: NDArray[Any]  # of the policy, as its constants
    constants: NDArray[Any]
    observation: NDArray[Any]
    curtain: NDArray[Any]
    timing: NDArray[np.int64]  # ticks between two views, the first of them, and the next one [1]
    hands: NDArray[np.int64]  # 1 for each side that it moves
    scales: NDArray[np.float64]  # factors of the force, by trial; none if the force tells nothing [1]
    catch: NDArray[np.int64]  # catch trials
    flags: NDArray[np.int64]  # whether it sees the true state, and whether its actions are checked


def force_scales(config: Config) -> tuple[float, ...]:
    """Return the factors of the force of the board on a hand, by trial; none if the force is another one [1]."""
    block = config.block
    return (block.trial_scales or (block.force_scale,)) if block.force == "full" else ()


def make_seat(config: Config, policy: Policy, station: Side, seed: tuple[int, ...]) -> Seat:
    """Put a policy into a seat: it sees the views of a station."""
    block = config.block
    every = make_curtain(config)
    curtain = every.partners.get(station, every.stations[station])
    view_ticks = ceil(1.0 / (TICK_SECONDS * config.network.view_rate_hz))
    first = view_ticks // 2 if station == "right" else 0
    timing = np.array([view_ticks, first, first])
    scales = np.array(force_scales(config) if len(policy.sides) == 1 else (), float)
    hands = np.array([side in policy.sides for side in SIDES], np.int64)
    observation = np.zeros(1, OBSERVATION)
    observation["seen"]["time"] = nan
    for name in TRUTH.names or ():
        observation["truth"][name] = nan
    catch, flags = np.array(block.catch, np.int64), np.array([policy.sees_truth, policy.checked], np.int64)
    return Seat(policy.initial(seed), policy.constants, observation, curtain, timing, hands, scales, catch, flags)


def _decide(state: np.void, constants: np.void, observation: np.void, actions: Records) -> None:
    """Placeholder for the kernel of a policy, which `composed` replaces."""
    raise NotImplementedError


def _begin(seat: Seat, bodies: Records, actions: Records) -> None:
    """Let the policy act before the first tick."""
    _feel(seat, bodies, -1, START_NS - TICK_NS)
    _decide(seat.state[0], seat.constants[0], seat.observation[0], actions)


def _attend(
    seat: Seat,
    bodies: Records,
    actions: Records,
    words: Words,
    numbers: Numbers,
    words_before: Words,
    numbers_before: Numbers,
) -> None:
    """Let the policy see, feel and act after a tick.

    ``words``, ``numbers``: the row of the tick, as words and as numbers of the same memory; the others: of the tick
    before.
    """
    tick, time_ns = words[_TICK], words[_TIME]
    if tick - 1 == seat.timing[2]:  # as `is_shown` says; its remainder takes long
        seat.timing[2] += seat.timing[0]
        when = (words_before[_TIME] + TICK_NS) * 1e-9
        glimpse(seat.curtain[0], words_before, numbers_before, when, seat.observation[0]["seen"])
    _feel(seat, bodies, tick, time_ns)
    seat.observation[0]["felt"] = felt(seat, bodies, words)
    if seat.flags[0]:
        _see_truth(seat.observation[0]["truth"], bodies, numbers)
    _decide(seat.state[0], seat.constants[0], seat.observation[0], actions)
    if seat.flags[1]:
        for side in range(2):
            if seat.hands[side]:
                let_go_unless_possible(actions[side])


class SeatKernels(NamedTuple):
    """The kernels of a seat around what its policy does."""

    begin: Callable[[Seat, Records, Records], None]
    attend: Callable[..., None]


@cache
def kernels_of(decide: Decide) -> SeatKernels:
    """Compile a seat around the kernel of its policy."""
    return SeatKernels(composed(_begin, inlined, _decide=decide), composed(_attend, inlined, _decide=decide))


@inlined
def is_shown(timing: NDArray[np.int64], tick: int) -> bool:
    """Return whether a tick is shown in a view, which is seen one tick later."""
    return bool((tick - timing[1]) % timing[0] == 0)


@inlined
def _feel(seat: Seat, bodies: Records, tick: int, time_ns: int) -> None:
    """Observe its own styluses and the forces on them."""
    o = seat.observation[0]
    o["tick"], o["time"], o["start"] = tick, time_ns * 1e-9, (time_ns - LEAD_NS) * 1e-9
    for side in range(2):
        if seat.hands[side]:
            d = bodies[side]["device"]
            o["height"][side], o["z"][side], o["vz"][side] = bodies[side]["stylus"]["place"][2], d["z"], d["vz"]
            o["force"][side] = d["fz"]


@inlined
def felt(seat: Seat, bodies: Records, words: Words) -> float:
    """Return the force of the board on the one hand of a policy, without its factor; else NaN [N]."""
    return felt_of(seat, bodies[seat.hands[1]]["device"]["commanded"], words[_TRIAL], words[_PHASE])


@inlined
def felt_of(seat: Seat, commanded: float, trial: int, phase: int) -> float:
    """Return `felt` for the commanded force on the hand, in a trial and a phase [N]."""
    scale = scale_in(seat, trial, phase)
    return nan if scale == 0.0 else commanded / scale


@inlined
def scale_in(seat: Seat, trial: int, phase: int) -> float:
    """Return the factor of the force on the hand; 0 if the force carries no information on the partner [1]."""
    scales, catch = seat.scales, seat.catch
    if len(scales) == 0 or not is_active(phase):
        return 0.0
    for k in range(len(catch)):
        if catch[k] == trial:
            return 0.0
    return float(scales[(trial - 1) % len(scales)] if len(scales) > 1 else scales[0])  # a remainder takes long


@inlined
def _see_truth(truth: np.void, bodies: Records, numbers: Numbers) -> None:
    """Observe the true state of board, ball and both styluses."""
    truth["z"], truth["vz"], truth["theta"] = numbers[_SCENE[0]], numbers[_SCENE[1]], numbers[_SCENE[2]]
    truth["omega"], truth["p"], truth["vp"] = numbers[_SCENE[3]], numbers[_SCENE[4]], numbers[_SCENE[5]]
    left, right = bodies[0]["stylus"], bodies[1]["stylus"]
    truth["left_z"], truth["left_vz"] = left["place"][2], left["v"][2]
    truth["right_z"], truth["right_vz"] = right["place"][2], right["v"][2]


def seats_of(config: Config) -> tuple[tuple[Side, tuple[Side, ...]], ...]:
    """Return who decides in a block: at which station, with which hands.

    One for each policy; a hand that is held still has none.
    """
    block = config.block
    if block.configuration == "bimanual":
        return ((block.station, SIDES),)
    moved = {"left": block.left, "right": block.right}
    return tuple((side, (side,)) for side in SIDES if moved[side] != "still")


def policy_at(config: Config, sides: tuple[Side, ...], people: Mapping[str, Participant]) -> Policy:
    """Return the policy that moves some hands: one of people, or a robot partner."""
    block = config.block
    mover = block.left if sides[0] == "left" else block.right
    if mover != "person":
        return make_partner(mover, config, sides[0])
    if block.configuration == "bimanual":
        return ParticipantPolicy(config, people[block.performer], sides)
    return ParticipantPolicy(config, people["A" if config.session.seat_a == sides[0] else "B"], sides)
