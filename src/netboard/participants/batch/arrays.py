"""Arrays of many scenes at full fidelity: their states, devices, views and policies, in groups of `LANES`."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Words
from netboard.base.config import SIDES, Config, Side
from netboard.base.tick import STATE, TICK, TICK_NS
from netboard.participants.batch.agents import SeatedAgent
from netboard.participants.body.device_models import resolved
from netboard.participants.body.stylus import ACTION
from netboard.participants.body.velocity_window import SAMPLES
from netboard.participants.policy import SEEN, Nobody, Policy
from netboard.participants.seat.closed_loop import Seat, make_seat

LANES = 16
"""Scenes in a group [1]. Two registers of eight: their chains of operations overlap, and both fit the registers."""

BOTH = 2 * LANES
"""Styluses of a group [1]."""


class SceneArrays(NamedTuple):
    """Many scenes; n is a multiple of `LANES`, and g the number of groups."""

    states: Any  # (n,) STATE
    ticks: NDArray[np.int64]  # (n,) ticks so far
    ended: NDArray[np.int64]  # (n,) how the trial has ended
    place: NDArray[np.float64]  # (g, 2, LANES) heights of both styluses [m]
    v: NDArray[np.float64]  # their velocities [m/s]
    motor: NDArray[np.float64]  # vertical motor forces that act [N]
    commanded: NDArray[np.float64]  # and those commanded next [N]
    smooth: NDArray[np.int64]  # (g,) 1: each stylus was used at the last tick; the next two then stand for the states
    seen_vz: NDArray[np.float64]  # (g, 2, LANES) velocities of the last samples [m/s]
    used_z: NDArray[np.float64]  # heights as last used [m]
    reading: NDArray[np.float64]  # (g, 4, LANES) heights, then velocities, as the encoders read them [m, m/s]
    doing: NDArray[np.float64]  # (g, 4, 2, LANES) what the hands do
    stamps: NDArray[np.int64]  # (g, SAMPLES) times of the positions below [ns]
    places: NDArray[np.float64]  # (g, SAMPLES, 2 LANES) newest positions [m]
    queue: NDArray[np.float64]  # (n, 2, ticks) forces for a force delay [N]
    rows: Any  # (LANES,) TICK: room for a tick of one group
    words: Words  # the same memory as words
    numbers: NDArray[np.float64]  # and as numbers
    room: NDArray[np.float64]  # (27, LANES) room for state, drives and used rates of one group
    mechanics: Any  # (2,) MECHANICS of both sides
    device: NDArray[np.float64]  # encoder step and largest force [m, N]


class Viewers(NamedTuple):
    """What the seats of some agents are shown, for each agent and scene."""

    curtain: Any  # (agents,) CURTAIN
    every: NDArray[np.int64]  # (agents,) ticks between two views
    following: NDArray[np.int64]  # (agents, n) tick of the next view
    seen: Any  # (agents, n, views + 1) SEEN, newest first; the first may be of the last tick, and not yet seen


class Partner(NamedTuple):
    """A policy in a seat of each scene: at the other seat, or the robot through which an agent acts."""

    seat: Seat  # of n scenes
    actions: Any  # (n, 2) ACTION
    following: NDArray[np.int64]  # (n,) tick of the next view


def make_arrays(config: Config, count: int, mechanics: NDArray[Any], delay: int) -> SceneArrays:
    """Make the arrays of some scenes; ``delay``: that of the forces [ticks]."""
    groups, device = count // LANES, resolved(config.virtual)
    rows = np.zeros(LANES, TICK)
    hands = (groups, len(SIDES), LANES)
    return SceneArrays(
        states=np.zeros(count, STATE),
        ticks=np.zeros(count, np.int64),
        ended=np.zeros(count, np.int64),
        place=np.zeros(hands),
        v=np.zeros(hands),
        motor=np.zeros(hands),
        commanded=np.zeros(hands),
        smooth=np.zeros(groups, np.int64),
        seen_vz=np.zeros(hands),
        used_z=np.zeros(hands),
        reading=np.zeros((groups, 2 * len(SIDES), LANES)),
        doing=np.zeros((groups, 4, len(SIDES), LANES)),
        stamps=np.tile(-TICK_NS * np.arange(SAMPLES, dtype=np.int64), (groups, 1)),
        places=np.zeros((groups, SAMPLES, len(SIDES) * LANES)),
        queue=np.zeros((count, len(SIDES), delay + 1)),
        rows=rows,
        words=rows.view(np.int64).reshape(LANES, -1),
        numbers=rows.view(np.float64).reshape(LANES, -1),
        room=np.zeros((27, LANES)),
        mechanics=mechanics,
        device=np.array([device.resolution, min(device.max_force, config.safety.max_force)]),
    )


def make_viewers(config: Config, agents: Sequence[SeatedAgent], count: int, views: int) -> Viewers:
    """Make what the seats of agents are shown."""
    seats = [make_seat(config, Nobody(), agent.station, (0,)) for agent in agents]
    return Viewers(
        np.concatenate([seat.curtain for seat in seats]),
        np.array([seat.timing[0] for seat in seats]),
        np.zeros((len(agents), count), np.int64),
        np.zeros((len(agents), count, views + 1), SEEN),
    )


def make_partner(config: Config, policy: Policy, station: Side, count: int) -> Partner:
    """Put a policy into its seat in each scene."""
    seat = make_seat(config, policy, station, (0,))
    repeated = {name: np.repeat(getattr(seat, name), count) for name in ("state", "observation")}
    return Partner(seat._replace(**repeated), np.zeros((count, len(SIDES)), ACTION), np.zeros(count, np.int64))
