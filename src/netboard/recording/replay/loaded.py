"""A recording loaded for replay: views and information at each position. Pure.

The curtain makes the views from recorded rows, as in the live session. Two values are not in a row and are computed
here as on the server. The best completion time includes a success from its own tick on. The rest before a block runs
from the event that began it.
"""

from collections.abc import Sequence
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, Side, parse
from netboard.base.errors import RecordingError
from netboard.network.protocol.records import BLOCK_BEGAN, RELEASED, STOPPED, EventRecord
from netboard.recording.format.summary import Attempt, agents_of, find_attempts, find_gaps, from_release
from netboard.recording.replay.marks import Mark, gap_in_words, marks, seconds
from netboard.stage.curtain import PHASE_NAMES, Pause, make_curtain, view_of
from netboard.stage.view import View
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.trials.exclusion import rule_of
from netboard.task.trials.state_machine import Cause, Phase

MAX_CHARACTERS = 80
"""Longest displayed text of an event [1]."""

ROUNDING = 1e-7
"""Tolerance for positions just before a tick, because tick times were rounded [s]."""

TICK_LENGTH = 1e-3 - ROUNDING
"""Time after a tick by which the next one is due [s]."""


_PAUSES: dict[int, Pause] = {Cause.PAUSE: Pause.OPERATOR, Cause.FAULT: Pause.FAULT, Cause.REPEAT: Pause.REPEATS}
"""Causes of pauses; a repeat is one only in a block that was over."""


class LoadedRecording:
    """A recording ready for replay. ``times``: times of the ticks from the start [s]."""

    def __init__(self, name: str, config_text: str, ticks: NDArray[Any], events: tuple[EventRecord, ...] = ()) -> None:
        self.name, self.text = name, config_text
        if not len(ticks):
            raise RecordingError(f"{self.name}: contains no ticks to show")
        self.config: Config = parse(self.text, self.name)
        self.curtain = make_curtain(self.config)
        self.ticks, self.times = ticks, seconds(ticks)
        self.attempts: tuple[Attempt, ...] = from_release(find_attempts(ticks), ticks["tick"], ticks["run_ticks"])
        self.gaps = find_gaps(ticks["tick"])
        self._outcomes = _outcomes(events, self.attempts, self.config.block.number)
        rule = rule_of(self.config)
        consequences = {
            (one.trial, one.attempt): rule.consequence(one.outcome, one.flag_list) for _, one in self._outcomes
        }
        self.marks: tuple[Mark, ...] = marks(ticks, self.attempts, self.gaps, events, consequences)
        self.agents = agents_of(events)
        self.length = float(self.times[-1])  # time of the last tick [s]
        started = np.flatnonzero(ticks["event"] == Cause.START)
        # Start of the block, before which nothing happens; 0 if the recording began later [s].
        self.begin = float(self.times[started[0]]) if len(started) else 0.0
        self._best = best_so_far(ticks)
        self._rest_until_ns = _rest_until_ns(events, self.config)
        self._pauses = _pauses(ticks, events)

    def at(self, position: float) -> int:
        """Return the index of the row at a position: the last one that is not later [1]."""
        return max(int(np.searchsorted(self.times, position + ROUNDING, side="right")) - 1, 0)

    def device(self, side: Side, index: int) -> dict[str, str] | None:
        """Return what the agent of a side said of its device, as of a row; None if there was no agent by then."""
        said = [details for tick, details in self.agents.get(side, ()) if tick <= self.ticks["tick"][index]]
        return said[-1] if said else None

    def stepped(self, position: float, count: int) -> float:
        """Return the position a number of ticks away from a position [s]."""
        return float(self.times[min(max(self.at(position) + count, 0), len(self.times) - 1)])

    def time_of(self, tick: int) -> float:
        """Return the position of a tick; for a missing one, of the last tick before it [s]."""
        return float(self.times[max(int(np.searchsorted(self.ticks["tick"], tick, side="right")) - 1, 0)])

    def trial(self, number: int) -> tuple[float, float] | None:
        """Return the start of a trial (levelling before its first attempt) and the end of its last attempt [s].

        None without an attempt at the trial.
        """
        tries = [attempt for attempt in self.attempts if attempt.trial == number]
        return (self.time_of(tries[0].began), self.time_of(tries[-1].stop)) if tries else None

    @property
    def trials(self) -> tuple[int, ...]:
        """Numbers of the trials with attempts, in order [1]."""
        return tuple(dict.fromkeys(attempt.trial for attempt in self.attempts))

    def best(self, index: int) -> float | None:
        """Return the best completion time so far; None before the first [s]."""
        best = float(self._best[index])
        return best if best < np.inf else None

    def rest(self, index: int) -> float | None:
        """Return the remaining rest before the block; None without one [s]."""
        row = self.ticks[index]
        left = (self._rest_until_ns - int(row["time_ns"])) * 1e-9
        return left if left > 0 and row["phase"] == Phase.IDLE else None

    def view(self, index: int, station: Side, sent_ns: int = 0, seq: int = 0) -> View:
        """Return the view of a station."""
        row, best, rest = self.ticks[index], self.best(index), self.rest(index)
        return view_of(self.curtain, row, station, best, sent_ns, seq, rest, self.pause(index))

    def pause(self, index: int) -> Pause:
        """Return what has caused the pause at a row; `Pause.NONE` outside a pause."""
        if self.ticks[index]["phase"] != Phase.PAUSED:
            return Pause.NONE
        tick = int(self.ticks["tick"][index])
        return next((pause for at, pause in reversed(self._pauses) if at <= tick), Pause.OPERATOR)

    def outcomes(self, index: int) -> list[AttemptOutcome]:
        """Return the outcomes of the attempts so far, in order."""
        tick = int(self.ticks["tick"][index])
        return [row for at, row in self._outcomes if at <= tick]

    def gap_at(self, position: float) -> str:
        """Describe the missing ticks at a position; empty if none are missing."""
        index = self.at(position)
        tick, after = int(self.ticks["tick"][index]), position - float(self.times[index])
        gap = next((gap for gap in self.gaps if gap.first == tick + 1), None)
        return gap_in_words(gap) if gap is not None and after >= TICK_LENGTH else ""

    def where(self, position: float) -> str:
        """Describe the state of the trial at a position."""
        row = self.ticks[self.at(position)]
        parts = [f"tick {int(row['tick'])}", PHASE_NAMES[int(row["phase"])], f"trial {int(row['trial'])}"]
        if row["attempt"] > 1:
            parts.append(f"attempt {int(row['attempt'])}")
        last = next((mark for mark in reversed(self.marks) if mark.kind != "trial" and mark.time <= position), None)
        if last is not None:
            parts.append(f"last event: {last.label[:MAX_CHARACTERS]}")
        if gap := self.gap_at(position):
            parts.append(gap)
        return ", ".join(parts)


def best_so_far(ticks: NDArray[Any]) -> NDArray[np.float64]:
    """Return the best completion time up to each tick, including a success at that tick."""
    known = ticks["completion"].copy()
    held = np.flatnonzero(ticks["event"][:-1] == Cause.HELD)
    known[held] = known[held + 1]
    return np.asarray(np.minimum.accumulate(np.where(known > 0, known, np.inf)), dtype=np.float64)


def _pauses(ticks: NDArray[Any], events: Sequence[EventRecord]) -> list[tuple[int, Pause]]:
    """Return the tick of each pause, and its cause; a fault during an emergency stop is a part of that."""
    switches = [(event.tick, event.name == STOPPED) for event in events if event.name in {STOPPED, RELEASED}]
    found = []
    for row in ticks[np.isin(ticks["event"], list(_PAUSES))]:
        tick, pause = int(row["tick"]), _PAUSES[int(row["event"])]
        stopped = next((halted for at, halted in reversed(switches) if at <= tick), False)
        if pause is not Pause.REPEATS or row["phase"] == Phase.FINISHED:
            found.append((tick, Pause.STOP if stopped and pause is Pause.FAULT else pause))
    return found


def _rest_until_ns(events: Sequence[EventRecord], config: Config) -> int:
    """Return the end of the rest before the block; 0 without one, or if the block's start is not recorded [ns]."""
    began = next((event for event in events if event.name == BLOCK_BEGAN), None)
    return 0 if began is None or not config.block.rest else began.time_ns + int(config.block.rest * 1e9)


def _outcomes(
    events: Sequence[EventRecord], attempts: Sequence[Attempt], block: int
) -> list[tuple[int, AttemptOutcome]]:
    """Return the outcomes of attempts with the ticks at which they became known.

    Without the server's events, as in a rehearsal, they come from the ticks and have no flags.
    """
    held = {event.tick: event.details.get("completion") for event in events if event.name == "held"}
    found: list[tuple[int, AttemptOutcome]] = []
    for event in events:
        if event.name == "attempt_ended":
            numbers = block, int(event.details["trial"]), int(event.details["attempt"])
            completion, repeats = float(held.get(event.tick) or nan), int(event.details.get("repeats", 0))
            outcome, flags = event.details["outcome"], event.details["flags"]
            found.append((event.tick, AttemptOutcome(*numbers, outcome, completion, flags, repeats)))
    return found or [
        (one.stop - 1, AttemptOutcome(block, one.trial, one.attempt, one.outcome, one.completion, "", 0))
        for one in attempts
        if one.outcome != "unfinished"
    ]
