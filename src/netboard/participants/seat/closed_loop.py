"""A simulated participant behind the curtain: sees its station's views, feels its own hand, and decides.

Rule 1: `netboard.stage.curtain.glimpse` says what it sees, at the server's view rate and one tick late. Rule 2: it
infers the partner's height from the force only where the force determines that height: with the full force of the
board. Any other force pushes the hand, but carries no information. Rule 3: time is that of the ticks; randomness comes
from the given generator.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import ceil, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined, machine_code
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.base.tick import TICK_NS, TICK_SECONDS, TICK_WORDS
from netboard.participants.people.controller import MOVE, decide, initial_state, pack_constants
from netboard.participants.people.senses import DECISION_INTERVAL, SEEN
from netboard.stage.curtain import glimpse, make_curtain
from netboard.task.trials.state_machine import is_active

DECISION_TICKS = round(DECISION_INTERVAL / TICK_SECONDS)
"""A participant decides after each tick whose number is a multiple of this [1]."""

_TIME, _PHASE, _TRIAL = (TICK_WORDS[name] for name in ("time_ns", "phase", "trial"))


class ParticipantParts(NamedTuple):
    """A participant as the kernels see it."""

    state: Any  # of the controller, as its constants
    constants: Any
    curtain: Any
    shown: Any  # the newest view
    timing: Any  # ticks between two views, and the first of them [1]
    scales: Any  # factors of the force, by trial [1]
    catch: Any  # catch trials
    moves: NDArray[Any]  # room for new movements


class SimulatedParticipant:
    """Perception and controller of one participant."""

    def __init__(
        self, config: Config, person: Participant, station: Side, sides: tuple[Side, ...], rng: np.random.Generator
    ) -> None:
        block = config.block
        constants = pack_constants(person, config.physics, config.task, config.virtual, sides)
        seen = replace(block, left="person", right="person")  # a robot also sees the board
        curtain = make_curtain(replace(config, block=seen)).stations[station]
        view_ticks = ceil(1.0 / (TICK_SECONDS * config.network.view_rate_hz))
        timing = np.array([view_ticks, view_ticks // 2 if station == "right" else 0])
        scales = (block.trial_scales or (block.force_scale,)) if block.force == "full" and len(sides) == 1 else ()
        shown = np.zeros(1, SEEN)
        shown["time"] = nan
        state, catch, moves = initial_state(constants, rng), np.array(block.catch, np.int64), np.zeros(2, MOVE)
        self.parts = ParticipantParts(state, constants, curtain, shown, timing, np.array(scales, float), catch, moves)
        self._decide = decide_in_tick

    def warm(self) -> None:
        """Compile or load `decide_in_tick`: its look-up by the types of its arguments takes longer than a decision."""
        self._decide = machine_code(decide_in_tick, self.parts, np.zeros(len(TICK_WORDS), np.int64), 0.0)

    def shown(self, tick: int) -> int:
        """Return the newest tick that has been seen when a tick is done; negative before the first view."""
        return int(newest_seen(self.parts, tick))

    def see(self, words: NDArray[np.int64]) -> None:
        """Take the view of a tick."""
        see(self.parts, words, words.view(np.float64))

    def decide(self, words: NDArray[np.int64], force: float) -> NDArray[Any]:
        """Decide, at a multiple of `DECISION_TICKS`; return the new movements, an array of `MOVE`.

        ``force``: vertical force that acts on this participant's hand from now on [N].
        """
        return self.parts.moves[: self._decide(self.parts, words, force)]


@inlined
def newest_seen(parts: ParticipantParts, tick: int) -> int:
    """Return the newest tick that has been seen when a tick is done; see `SimulatedParticipant.shown`."""
    return int(tick - 1 - (tick - 1 - parts.timing[1]) % parts.timing[0])


@inlined
def see(parts: ParticipantParts, words: NDArray[np.int64], numbers: NDArray[np.float64]) -> None:
    """Take the view of a tick, given as words and as numbers of the same memory."""
    glimpse(parts.curtain[0], words, numbers, (words[_TIME] + TICK_NS) * 1e-9, parts.shown[0])


@inlined
def decide_in_tick(parts: ParticipantParts, words: NDArray[np.int64], force: float) -> int:
    """Decide after a tick; return the number of new movements, which are in ``parts.moves``."""
    scale = scale_in(parts, words)
    felt = force / scale if scale != 0.0 else nan
    return decide(parts.state[0], parts.constants[0], words[_TIME] * 1e-9, parts.shown[0], felt, parts.moves)


@inlined
def scale_in(parts: ParticipantParts, words: NDArray[np.int64]) -> float:
    """Return the factor of the force on the hand; 0 if the force carries no information on the partner [1]."""
    scales, catch, trial = parts.scales, parts.catch, words[_TRIAL]
    if len(scales) == 0 or not is_active(words[_PHASE]):
        return 0.0
    for k in range(len(catch)):
        if catch[k] == trial:
            return 0.0
    return float(scales[(trial - 1) % len(scales)])


def seats_of(config: Config) -> tuple[tuple[Side, tuple[Side, ...]], ...]:
    """Return who decides in a block: at which station, with which hands.

    One for each participant; a hand that is held still has none.
    """
    block = config.block
    if block.configuration == "bimanual":
        return ((block.station, SIDES),)
    moved = {"left": block.left, "right": block.right}
    return tuple((side, (side,)) for side in SIDES if moved[side] != "still")


def person_at(config: Config, side: Side, people: Mapping[str, Participant]) -> Participant | None:
    """Return the participant that moves a hand: of people, or a robot; None for a hand that is held still."""
    block = config.block
    match block.left if side == "left" else block.right:
        case "still":
            return None
        case "robot":
            return config.participant
        case "person":
            pass
        case other:
            raise ConfigError(f'[block] {side}: found "{other}", expected person, still or robot')
    if block.configuration == "bimanual":
        return people[block.performer]
    return people["A" if config.session.seat_a == side else "B"]
