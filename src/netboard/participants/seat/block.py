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

from netboard.base.compiled import Numbers, Records, Words, borrowed, compiler_words, composed, inlined, machine_code
from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.tables.experiment import PERSON, Block
from netboard.base.tables.simulated import Participant
from netboard.base.tick import START_NS, TICK, TICK_NS, TICK_SECONDS, TICK_WORDS
from netboard.participants.body.stylus import ACTION
from netboard.participants.policy import Decide, Nobody
from netboard.participants.seat.body import BODY, LEAD_NS, READINGS, advance, apply_force, pack_body, read
from netboard.participants.seat.closed_loop import Seat, kernels_of, make_seat, policy_at, seats_of
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause, Phase

PIECE = 10_000
"""Default number of ticks in a piece [1]."""

START_TICK = 500
"""Tick at which a block starts: a live server waits for this time after everything is ready [1]."""

MAX_MEAN_TRIAL = 120.0
"""A block is stopped after this time for each planned trial: its participants cannot do it [s]."""

_FINISHED, _NONE, _STOP = int(Phase.FINISHED), int(Cause.NONE), int(Cause.STOP)
_TICK, _TIME, _LATE, _COMMAND, _EVENT = (
    TICK_WORDS[name] for name in ("tick", "time_ns", "late_ns", "command", "event")
)


def _ticks(state: Records, rows: Records, first: int, count: int, book: Records, tables: NDArray[np.float64]) -> None:
    """Placeholder for the ticks of a stage, which `composed` replaces."""
    raise NotImplementedError


def _begin(seat: Seat, bodies: Records, actions: Records) -> None:
    """Placeholder for how a seat begins, which `composed` replaces, as those below."""
    raise NotImplementedError


_begin_other = _begin


def _attend(
    seat: Seat,
    bodies: Records,
    actions: Records,
    words: Words,
    numbers: Numbers,
    words_before: Words,
    numbers_before: Numbers,
) -> None:
    """Placeholder for how a seat attends to a tick."""
    raise NotImplementedError


_attend_other = _attend


def _watch(watched: tuple[object, ...], rows: Records, words: Words, numbers: Numbers, place: int, before: int) -> bool:
    """Placeholder for what watches each tick."""
    raise NotImplementedError


@inlined
def _look_away(
    watched: tuple[object, ...], rows: Records, words: Words, numbers: Numbers, place: int, before: int
) -> bool:
    """Watch nothing."""
    return False


class Watcher(NamedTuple):
    """A kernel that gets each tick at once, while its row is in the processor's cache.

    Its arguments are `data`; a ring of rows, as records, as words and as numbers; and the places of the tick and of the
    one before. It returns whether the loop is to stop there, so that Python can look at the data.
    """

    kernel: Callable[..., bool]
    data: tuple[object, ...]


UNWATCHED = Watcher(_look_away, ())


class TickRing(NamedTuple):
    """Room for the newest ticks of a block, two or more: policies see the one before a tick."""

    rows: Any
    words: NDArray[np.int64]  # the same memory as words
    numbers: NDArray[np.float64]  # and as numbers

    @classmethod
    def of(cls, size: int) -> "TickRing":
        """Return room for some ticks."""
        rows = np.zeros(size, TICK)
        return cls(rows, rows.view(np.int64).reshape(size, -1), rows.view(np.float64).reshape(size, -1))


class Devices(NamedTuple):
    """Both devices, and what the hands on them do."""

    bodies: Any
    actions: Any
    readings: Any
    force_queue: NDArray[np.float64]


def _loop(
    state: Records,
    ring: TickRing,
    commands: Words,
    number: int,
    book: Records,
    tables: NDArray[np.float64],
    devices: Devices,
    one: Seat,
    other: Seat,
    completions: NDArray[np.float64],
    watched: tuple[object, ...],
) -> int:
    """Run ticks with both devices and both seats, until the block ends or what watches them says so.

    ``commands``: of the new ticks; ``number``: number of the first of them; ``completions``: completion time of the
    last trial, by the number of successful ones [s]. Returns how many ticks were run.
    """
    state, book, tables, completions = borrowed(state), borrowed(book), borrowed(tables), borrowed(completions)
    rows, words, numbers = borrowed(ring)
    commands, watched = borrowed(commands), borrowed(watched)
    bodies, actions, readings, force_queue = borrowed(devices)
    one, other = borrowed(one), borrowed(other)
    if number == 0:
        _begin(one, bodies, actions)
        _begin_other(other, bodies, actions)
    place = number % len(rows)
    before = place - 1 if place > 0 else len(rows) - 1
    for k in range(len(commands)):
        tick, row, values = number + k, words[place], numbers[place]
        row[_TICK], row[_TIME], row[_LATE] = tick, START_NS + tick * TICK_NS, -LEAD_NS
        row[_COMMAND] = commands[k]
        advance(bodies, actions, 0, 2, row, values)
        read(bodies, 0, 2, readings[0], row, values)
        _ticks(state, rows, place, 1, book, tables)
        for side in range(2):
            apply_force(bodies, side, force_queue, book[0]["rendering"]["catch"], row, values)
        _attend(one, bodies, actions, row, values, words[before], numbers[before])
        _attend_other(other, bodies, actions, row, values, words[before], numbers[before])
        if state[0]["successes"] < len(completions):  # an operator may have trials repeated, beyond the planned ones
            completions[state[0]["successes"]] = state[0]["completion"]
        stop = _watch(watched, rows, words, numbers, place, before)
        if stop or state[0]["phase"] == _FINISHED:
            return k + 1
        before, place = place, place + 1 if place + 1 < len(rows) else 0
    return len(commands)


@cache
def _loop_around(
    ticks: Callable[..., None], one: Decide, other: Decide, watch: Callable[..., bool]
) -> Callable[..., int]:
    """Compile the loop around the ticks of a stage, two policies and what watches them."""
    begin, attend = kernels_of(one)
    begin_other, attend_other = kernels_of(other)
    return composed(
        _loop,
        _ticks=ticks,
        _begin=begin,
        _attend=attend,
        _begin_other=begin_other,
        _attend_other=attend_other,
        _watch=watch,
    )


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


def _is_robot(block: Block, sides: tuple[Side, ...]) -> bool:
    """Return whether these hands are a robot partner's."""
    return len(sides) == 1 and getattr(block, sides[0]) != PERSON


class Rehearsal:
    """One block. ``people``: the participants A and B; a robot is the participant of ``[participant]``.

    ``watcher``: what gets each tick at once.
    """

    def __init__(self, config: Config, people: Mapping[str, Participant], watcher: Watcher = UNWATCHED) -> None:
        if config.block.force == "unrelated":
            raise ConfigError(
                '[block] force: found "unrelated", expected another condition: a rehearsal has no recorded forces'
            )
        self._stage = make_stage(config)
        self._state = self._stage.initial()
        self._code: Callable[..., int] | None = None
        self._block = block = config.block
        seed = (block.seed, block.number)
        taken = [(policy_at(config, sides, people), station) for station, sides in seats_of(config)]
        taken += [(Nobody(), "left")] * (len(SIDES) - len(taken))
        self._seats = tuple(make_seat(config, policy, station, seed) for policy, station in taken)
        self._decides = tuple(policy.decide for policy, _ in taken)
        self.partners: dict[str, Mapping[str, str]] = {  # identity of each robot partner, by its side
            policy.sides[0]: policy.identity for policy, _ in taken if _is_robot(block, policy.sides)
        }
        bodies = np.zeros(len(SIDES), BODY)
        for side in SIDES:
            pack_body(config, None, (0.0, 0.0), bodies[SIDES.index(side)])
        for (policy, _), seat in zip(taken, self._seats, strict=True):
            for side in policy.sides:
                pack_body(config, policy.hand(), policy.across(seat.state, side), bodies[SIDES.index(side)])
        force_queue = np.zeros((len(SIDES), block.force_delay_ms + 1))
        self._devices = Devices(bodies, np.zeros(len(SIDES), ACTION), np.zeros(1, READINGS), force_queue)
        self._last_tick = START_TICK + round(block.trials * MAX_MEAN_TRIAL / TICK_SECONDS)
        self._completions = np.zeros(1 + block.trials)
        self._watcher = watcher
        self._ticks = 0
        self.over = self._given_up = False

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
        ring = TickRing.of(max(size, 2))
        while not self.over:
            first = self._ticks % len(ring.rows)
            yield ring.rows[first : first + self.run(ring, size)]

    def run(self, ring: TickRing, most: int) -> int:
        """Run the next ticks, until the block ends or the watcher stops them; return their number [1].

        ``ring``: the same for all ticks; tick n is at place ``n % size``. ``most``: number of ticks at most.
        """
        count = self._run(ring, self._commands(most))
        self._ticks += count
        self.over = int(self._state["phase"][0]) == _FINISHED
        self._given_up = int(ring.words[(self._ticks - 1) % len(ring.words), _EVENT]) == _STOP
        return count

    def _commands(self, count: int) -> Words:
        """Return the commands of the next ticks: the block starts, and is stopped if it takes too long."""
        commands = np.full(count, _NONE, np.int64)
        if self._ticks <= START_TICK < self._ticks + count:
            commands[START_TICK - self._ticks] = Cause.START
        commands[max(self._last_tick - self._ticks, 0) :] = Cause.STOP  # the tick between two trials does not take it
        return commands

    def _run(self, ring: TickRing, commands: Words) -> int:
        """Run the next ticks, and return their number; say in words what a kernel of a robot partner raises."""
        stage = self._stage
        of_stage = self._state, ring, commands, self._ticks, stage.book, stage.tables
        arguments = *of_stage, self._devices, *self._seats, self._completions, self._watcher.data
        try:
            if self._code is None:
                loop = _loop_around(stage.ticks, *self._decides, self._watcher.kernel)
                self._code = machine_code(loop, *arguments)
            return self._code(*arguments)
        except Exception as error:  # of any type: the code of a lab
            if not self.partners:
                raise
            who = " or ".join(repr(getattr(self._block, side)) for side in self.partners)
            raise NetboardError(f"the robot partner {who} has failed: {compiler_words(error)}") from error
