"""A recording that is ready to be played: what there is to see and to know at each position of it. Pure.

Views are made by the curtain that made them when it was live, from the same rows. Two things are not in a row and are
found here as the server had them: the best completion time so far counts a success from the tick of that success on,
and the rest before a block runs from the event that began it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, Side, parse
from netboard.base.errors import RecordingError
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord
from netboard.recording.format.summary import Attempt, find_attempts, find_gaps
from netboard.recording.replay.marks import Mark, gap_in_words, marks, seconds
from netboard.stage.curtain import PHASE_NAMES, make_curtain, view_of
from netboard.stage.view import View
from netboard.task.trials.state_machine import Cause, Phase

Row = tuple[int, int, int, str, float, str, int]
"""What has become of an attempt, as in `netboard.network.protocol.control.Outcomes`."""


@dataclass(frozen=True, slots=True)
class Material:
    """What a recording holds."""

    name: str
    config_text: str
    ticks: NDArray[Any]
    events: tuple[EventRecord, ...] = ()


class Reel:
    """A recording that is ready to be played.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Their times from the start [s].
    begin : float
        When its block starts, for nothing happens before; 0 if the recording began later [s].
    length : float
        Time of its last tick [s].
    """

    def __init__(self, material: Material) -> None:
        self.name, self.text, ticks = material.name, material.config_text, material.ticks
        if not len(ticks):
            raise RecordingError(f"{self.name}: has no tick to show")
        self.config: Config = parse(self.text, self.name)
        self.curtain = make_curtain(self.config)
        self.ticks, self.times = ticks, seconds(ticks)
        self.attempts: tuple[Attempt, ...] = find_attempts(ticks)
        self.gaps = find_gaps(ticks["tick"])
        self.marks: tuple[Mark, ...] = marks(ticks, self.attempts, self.gaps, material.events)
        self.length = float(self.times[-1])
        started = np.flatnonzero(ticks["event"] == Cause.START)
        self.begin = float(self.times[started[0]]) if len(started) else 0.0
        self._best = best_so_far(ticks)
        self._rest_until_ns = _rest_until_ns(material.events, self.config)
        self._judged = _judged(material.events, self.attempts, self.config.block.number)

    def at(self, position: float) -> int:
        """Index of the row that holds at a position: the last one that is not later [1]."""
        return max(int(np.searchsorted(self.times, position + ROUNDING, side="right")) - 1, 0)

    def stepped(self, position: float, count: int) -> float:
        """Position of the tick so many ticks from the one at a position [s]."""
        return float(self.times[min(max(self.at(position) + count, 0), len(self.times) - 1)])

    def time_of(self, tick: int) -> float:
        """Position of a tick, or of the last one before it if that is missing [s]."""
        return float(self.times[max(int(np.searchsorted(self.ticks["tick"], tick, side="right")) - 1, 0)])

    def trial(self, number: int) -> tuple[float, float] | None:
        """When a trial begins, with the levelling before its first attempt, and when its last attempt ends [s].

        Returns
        -------
        (float, float) or None
            From the start; None if there is no attempt at it.
        """
        tries = [attempt for attempt in self.attempts if attempt.trial == number]
        return (self.time_of(tries[0].began), self.time_of(tries[-1].stop)) if tries else None

    @property
    def trials(self) -> tuple[int, ...]:
        """Numbers of the trials that were tried, in order [1]."""
        return tuple(dict.fromkeys(attempt.trial for attempt in self.attempts))

    def best(self, index: int) -> float | None:
        """Best completion time so far, None before the first [s]."""
        best = float(self._best[index])
        return best if best < np.inf else None

    def rest(self, index: int) -> float | None:
        """What is left of the rest before the block; None without one [s]."""
        row = self.ticks[index]
        left = (self._rest_until_ns - int(row["time_ns"])) * 1e-9
        return left if left > 0 and row["phase"] == Phase.IDLE else None

    def view(self, index: int, station: Side, sent_ns: int = 0, seq: int = 0) -> View:
        """What a station could see."""
        row, best, rest = self.ticks[index], self.best(index), self.rest(index)
        return view_of(self.curtain, row, station, best, sent_ns, seq, rest)

    def outcomes(self, index: int) -> list[Row]:
        """What had become of the attempts so far, in order."""
        tick = int(self.ticks["tick"][index])
        return [row for at, row in self._judged if at <= tick]

    def gap_at(self, position: float) -> str:
        """Name the missing ticks at a position, in words; empty where none are missing."""
        index = self.at(position)
        tick, after = int(self.ticks["tick"][index]), position - float(self.times[index])
        gap = next((gap for gap in self.gaps if gap.first == tick + 1), None)
        return gap_in_words(gap) if gap is not None and after >= TICK_LENGTH else ""

    def where(self, position: float) -> str:
        """What is on at a position, in words."""
        row = self.ticks[self.at(position)]
        told = [f"tick {int(row['tick'])}", PHASE_NAMES[int(row["phase"])], f"trial {int(row['trial'])}"]
        if row["attempt"] > 1:
            told.append(f"attempt {int(row['attempt'])}")
        last = next((mark for mark in reversed(self.marks) if mark.kind != "trial" and mark.time <= position), None)
        if last is not None:
            told.append(f"last event: {last.label[:MOST_LETTERS]}")
        if gap := self.gap_at(position):
            told.append(gap)
        return ", ".join(told)


MOST_LETTERS = 80
"""More letters of a note are not told on the way [1]."""

ROUNDING = 1e-7
"""A position that is so little before a tick is at the tick: times of ticks were rounded on their way [s]."""

TICK_LENGTH = 1e-3 - ROUNDING
"""So long after a tick the next one should be there [s]."""


def best_so_far(ticks: NDArray[Any]) -> NDArray[np.float64]:
    """Best completion time up to each tick, a success at this tick included."""
    known = ticks["completion"].copy()
    held = np.flatnonzero(ticks["event"][:-1] == Cause.HELD)
    known[held] = known[held + 1]
    return np.asarray(np.minimum.accumulate(np.where(known > 0, known, np.inf)), dtype=np.float64)


def _rest_until_ns(events: Sequence[EventRecord], config: Config) -> int:
    """When the rest before the block is over; 0 if the recording does not have the block's beginning [ns]."""
    began = next((event for event in events if event.name == BLOCK_BEGAN), None)
    return 0 if began is None else began.time_ns + int(config.block.rest * 1e9)


def _judged(events: Sequence[EventRecord], attempts: Sequence[Attempt], block: int) -> list[tuple[int, Row]]:
    """The verdicts, each with the tick from which it was known; plain outcomes where nobody has judged."""
    held = {event.tick: event.details.get("completion") for event in events if event.name == "held"}
    found: list[tuple[int, Row]] = []
    for event in events:
        if event.name == "attempt_ended":
            told = event.details
            numbers = block, int(told["trial"]), int(told["attempt"])
            completion = float(held.get(event.tick) or nan)
            found.append(
                (event.tick, (*numbers, told["outcome"], completion, told["flags"], int(told.get("repeats", 0))))
            )
    return found or [
        (one.stop - 1, (block, one.trial, one.attempt, one.outcome, one.completion, "", 0))
        for one in attempts
        if one.outcome != "unfinished"
    ]
