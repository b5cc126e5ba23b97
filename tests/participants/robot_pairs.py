"""A block with two policies, one tick at a time, so that a test can change what the hands do.

The ticks are those of `netboard.participants.seat.block`, from the same kernels; only the loop is in Python.
"""

from collections.abc import Callable, Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, Words, composed, kernel, machine_code
from netboard.base.config import SIDES, Side, parse
from netboard.base.tables.simulated import Participant
from netboard.base.tick import START_NS, TICK, TICK_NS, TICK_WORDS
from netboard.participants.body.stylus import ACTION
from netboard.participants.policy import Nobody, Policy
from netboard.participants.seat.block import START_TICK
from netboard.participants.seat.body import BODY, LEAD_NS, READINGS, advance, apply_force, pack_body, read
from netboard.participants.seat.closed_loop import Seat, kernels_of, make_seat, policy_at
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause, Phase

PEOPLE = {"A": Participant(), "B": Participant()}
_TICK, _TIME, _LATE, _COMMAND = (TICK_WORDS[name] for name in ("tick", "time_ns", "late_ns", "command"))

Disturb = Callable[[int, NDArray[Any], NDArray[Any]], None]
"""What a test does after a tick, with its number, the actions of both hands and both bodies."""


def _ticks(*arguments: Any) -> None:
    """Placeholder for the ticks of a stage."""
    raise NotImplementedError


def _tick(
    state: Records,
    rows: Records,
    book: Records,
    tables: NDArray[np.float64],
    bodies: Records,
    actions: Records,
    readings: Records,
    queue: NDArray[np.float64],
) -> None:
    words, numbers = rows.view(np.int64).reshape(2, -1)[1], rows.view(np.float64).reshape(2, -1)[1]
    advance(bodies, actions, 0, 2, words, numbers)
    read(bodies, 0, 2, readings[0], words, numbers)
    _ticks(state, rows, 1, 1, book, tables)
    for side in range(2):
        apply_force(bodies, side, queue, book[0]["rendering"]["catch"], words, numbers)


def _attend(seat: Seat, bodies: Records, actions: Records, words: Words, before: Words) -> None:
    _see(seat, bodies, actions, words, words.view(np.float64), before, before.view(np.float64))


def _begin(seat: Seat, bodies: Records, actions: Records) -> None:
    _start(seat, bodies, actions)


def _see(*arguments: Any) -> None:
    raise NotImplementedError


_start = _see


@cache
def _ticking(ticks: Callable[..., None]) -> Any:
    return composed(_tick, kernel, _ticks=ticks)


@cache
def _seated(decide: Callable[..., None]) -> tuple[Any, Any]:
    of_seat = kernels_of(decide)
    return composed(_begin, kernel, _start=of_seat.begin), composed(_attend, kernel, _see=of_seat.attend)


class Pair:
    """Two movers in a block: a participant, a robot, or nobody for a hand that is held still."""

    def __init__(
        self,
        left: str,
        right: str,
        trials: int = 2,
        seed: int = 1,
        partners: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
        **block: Any,
    ) -> None:
        keys = {"left": left, "right": right, "trials": trials, "seed": seed, **block}
        given = [f"block.{key}={value}" for key, value in keys.items()]
        given += [f"partners.{side}.{key}={value}" for side, own in partners.items() for key, value in own.items()]
        self.config = config = parse("", overrides=given)
        self._stage = make_stage(config)
        self.state = self._stage.initial()
        self.bodies, self.actions = np.zeros(2, BODY), np.zeros(2, ACTION)
        self.policies: dict[Side, Policy] = {}
        self.seats: dict[Side, Seat] = {}
        for side, mover in zip(SIDES, (left, right), strict=True):
            policy = Nobody() if mover == "still" else policy_at(config, (side,), PEOPLE)
            seat = make_seat(config, policy, side, (seed, config.block.number))
            self.policies[side], self.seats[side] = policy, seat
            hand = None if mover == "still" else policy.hand()
            pack_body(config, hand, policy.across(seat.state, side), self.bodies[SIDES.index(side)])
        self._readings, self._queue = np.zeros(1, READINGS), np.zeros((2, config.block.force_delay_ms + 1))

    def run(self, most: int, disturb: Disturb | None = None) -> NDArray[Any]:
        """Run to the end of the block, or for a number of ticks; return their rows."""
        kept, piece = np.zeros(most, TICK), np.zeros(2, TICK)
        words, stage = piece.view(np.int64).reshape(2, -1), self._stage
        of_tick = self.state, piece, stage.book, stage.tables, self.bodies, self.actions, self._readings, self._queue
        tick = machine_code(_ticking(stage.ticks), *of_tick)
        attends = []
        for side in SIDES:
            begin, attend = _seated(self.policies[side].decide)
            begin(self.seats[side], self.bodies, self.actions)
            arguments = self.seats[side], self.bodies, self.actions, words[1], words[0]
            attends.append((machine_code(attend, *arguments), arguments))
        for number in range(most):
            words[0] = words[1]
            words[1] = 0
            row = words[1]
            row[_TICK], row[_TIME], row[_LATE] = number, START_NS + number * TICK_NS, -LEAD_NS
            row[_COMMAND] = Cause.START if number == START_TICK else Cause.NONE
            tick(*of_tick)
            for attend, arguments in attends:
                attend(*arguments)
            if disturb is not None:
                disturb(number, self.actions, self.bodies)
            kept.view(np.int64).reshape(most, -1)[number] = row
            if self.state["phase"][0] == Phase.FINISHED:
                return kept[: number + 1]
        return kept
