"""One block with simulated participants, tick by tick and without a clock.

It is a closed loop of participants, hands and the stage, in one kernel. A tick runs as in the live system: both
styluses are read, the stage runs the tick, the forces act from its deadline on, and each participant sees it one tick
later. The block starts as soon as a live one would. Rests before blocks are left out, because simulated participants do
not get tired.

Rule 1: the ticks depend only on the configuration and the participants, not on how many are run in one piece.
Rule 2: the rows are those of a recording: inputs, state and outputs, and the diagnostics that a server records.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, borrowed, composed, machine_code
from netboard.base.config import SIDES, Config
from netboard.base.errors import ConfigError
from netboard.base.tables.simulated import Participant
from netboard.base.tick import START_NS, TICK, TICK_NS, TICK_SECONDS, TICK_WORDS
from netboard.participants.seat.body import BODY, LEAD_NS, READINGS, advance, apply_force, pack_body, plan, read
from netboard.participants.seat.closed_loop import (
    DECISION_TICKS,
    SimulatedParticipant,
    decide_in_tick,
    newest_seen,
    person_at,
    seats_of,
    see,
)
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause, Phase

PIECE = 10_000
"""Default number of ticks in a piece [1]."""

START_TICK = 500
"""Tick at which a block starts: a live server waits for this time after everything is ready [1]."""

MAX_MEAN_TRIAL = 120.0
"""A block is stopped after this time for each planned trial: its participants cannot do it [s]."""

KEPT = DECISION_TICKS
"""Ticks kept before a piece, for participants that see them late [1]."""

_FINISHED, _NONE, _STOP = int(Phase.FINISHED), int(Cause.NONE), int(Cause.STOP)
_TICK, _TIME, _LATE, _COMMAND, _EVENT = (
    TICK_WORDS[name] for name in ("tick", "time_ns", "late_ns", "command", "event")
)


def _ticks(state: Records, rows: Records, first: int, count: int, book: Records, tables: NDArray[np.float64]) -> None:
    """Placeholder for the ticks of a stage, which `composed` replaces."""
    raise NotImplementedError


class TickRun(NamedTuple):
    """Some ticks of a block: those before them, and room for the new ones."""

    rows: Any  # the last `KEPT` ticks, and room
    words: NDArray[np.int64]  # the same memory as words
    numbers: NDArray[np.float64]  # and as numbers
    commands: NDArray[np.int64]  # of the new ticks


class Devices(NamedTuple):
    """Both devices with their hands."""

    bodies: Any
    readings: Any
    force_queue: NDArray[np.float64]


class Participants(NamedTuple):
    """Who decides in a block."""

    parts: Any  # of each participant
    hands: NDArray[np.int64]  # for each, the hand whose force it feels: 0 left, 1 right


def _loop(
    state: Records,
    piece: TickRun,
    number: int,
    book: Records,
    tables: NDArray[np.float64],
    devices: Devices,
    participants: Participants,
    completions: NDArray[np.float64],
) -> int:
    """Run ticks with both hands and all participants, to the end of the block at most.

    ``number``: number of the first new tick; ``completions``: completion time of the last trial, by the number of
    successful ones [s]. Returns how many ticks were run.
    """
    state, book, tables, completions = borrowed(state), borrowed(book), borrowed(tables), borrowed(completions)
    rows, words, numbers, commands = borrowed(piece)
    bodies, readings, force_queue = borrowed(devices)
    everyone, hands = borrowed(participants)
    count = len(rows) - KEPT
    for k in range(count):
        place, tick = KEPT + k, number + k
        row, values = words[place], numbers[place]
        row[_TICK], row[_TIME], row[_LATE] = tick, START_NS + tick * TICK_NS, -LEAD_NS
        row[_COMMAND] = commands[k]
        advance(bodies, 0, 2, row, values)
        read(bodies, 0, 2, readings[0], row, values)
        _ticks(state, rows, place, 1, book, tables)
        for side in range(2):
            apply_force(bodies, side, force_queue, book[0]["rendering"]["catch"], row, values)
        if tick % DECISION_TICKS == 0:
            for which in range(len(hands)):
                parts = everyone[which]
                age = tick - newest_seen(parts, tick)
                if age <= min(tick, DECISION_TICKS):  # otherwise the view is not new
                    see(parts, words[place - age], numbers[place - age])
                felt = bodies[hands[which]]["device"]["commanded"]
                begun = decide_in_tick(parts, row, felt)
                plan(bodies, parts.moves, begun)
        if state[0]["successes"] < len(completions):  # an operator may have trials repeated, beyond the planned ones
            completions[state[0]["successes"]] = state[0]["completion"]
        if state[0]["phase"] == _FINISHED:
            return k + 1
    return count


@cache
def _loop_around(ticks: Callable[..., None]) -> Callable[..., int]:
    """Compile the loop around the ticks of a stage."""
    return composed(_loop, _ticks=ticks)


@dataclass(frozen=True, slots=True)
class BlockSummary:
    """Results of a block."""

    completions: tuple[float, ...]  # completion times of the successful trials [s]
    failures: int
    ticks: int
    given_up: bool

    @property
    def duration(self) -> float:
        """Simulated duration of the block [s]."""
        return self.ticks * TICK_SECONDS


class Rehearsal:
    """One block. ``people``: the participants A and B; a robot is the participant of ``[participant]``."""

    def __init__(self, config: Config, people: Mapping[str, Participant]) -> None:
        if config.block.force == "unrelated":
            raise ConfigError(
                '[block] force: found "unrelated", expected another condition: a rehearsal has no recorded forces'
            )
        self._stage = make_stage(config)
        self._state = self._stage.initial()
        self._code: Callable[..., int] | None = None
        block = config.block
        moving = {side: person_at(config, side, people) for side in SIDES}
        seed = (block.seed, block.number)
        bodies = np.zeros(len(SIDES), BODY)
        for place, side in enumerate(SIDES):
            pack_body(config, side, moving[side], np.random.default_rng((*seed, 1 + place)), bodies)
        force_queue = np.zeros((len(SIDES), block.force_delay_ms + 1))
        self._devices = Devices(bodies, np.zeros(1, READINGS), force_queue)
        participants = [
            SimulatedParticipant(
                config, who, station, sides, np.random.default_rng((*seed, 3 + SIDES.index(sides[0])))
            ).parts
            for station, sides in seats_of(config)
            if (who := moving[sides[0]]) is not None
        ]
        hands = np.array([SIDES.index(sides[0]) for _, sides in seats_of(config)], np.int64)
        nobody = SimulatedParticipant(config, config.participant, "left", ("left",), np.random.default_rng(0)).parts
        parts = tuple(participants) or (nobody,)  # a kernel cannot take an empty tuple
        self._participants = Participants(parts, hands)
        self._last_tick = START_TICK + round(block.trials * MAX_MEAN_TRIAL / TICK_SECONDS)
        self._completions = np.zeros(1 + block.trials)
        self._ticks = 0
        self._given_up = False

    @property
    def successes(self) -> int:
        """Successful trials so far [1]."""
        return int(self._state["successes"][0])

    def summary(self) -> BlockSummary:
        """Return the results so far."""
        completions = self._completions[1 : 1 + self.successes].tolist()
        return BlockSummary(tuple(completions), int(self._state["failures"][0]), self._ticks, self._given_up)

    def pieces(self, size: int = PIECE) -> Iterator[NDArray[Any]]:
        """Run the block. Yields at most `size` ticks at a time, valid until the next are asked for."""
        rows = np.zeros(KEPT + size, TICK)
        words, numbers = rows.view(np.int64).reshape(len(rows), -1), rows.view(np.float64).reshape(len(rows), -1)
        piece = TickRun(rows, words, numbers, np.zeros(size, np.int64))
        over = False
        while not over:
            words[:KEPT] = words[-KEPT:]  # as words, because NumPy copies a record field by field
            self._command(piece.commands)
            count = self._run(piece)
            self._ticks += count
            over = int(self._state["phase"][0]) == _FINISHED
            self._given_up = int(words[KEPT + count - 1, _EVENT]) == _STOP
            yield rows[KEPT : KEPT + count]

    def _command(self, commands: NDArray[np.int64]) -> None:
        """Write the commands of the next ticks: the block starts, and is stopped if it takes too long."""
        commands[:] = _NONE
        if self._ticks <= START_TICK < self._ticks + len(commands):
            commands[START_TICK - self._ticks] = Cause.START
        commands[max(self._last_tick - self._ticks, 0) :] = Cause.STOP  # the tick between two trials does not take it

    def _run(self, piece: TickRun) -> int:
        """Run the next ticks; return their number."""
        stage = self._stage
        of_stage = self._state, piece, self._ticks, stage.book, stage.tables
        arguments = *of_stage, self._devices, self._participants, self._completions
        if self._code is None:
            self._code = machine_code(_loop_around(stage.ticks), *arguments)
        return self._code(*arguments)
