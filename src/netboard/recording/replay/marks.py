"""Marks on the time line of a recording: trials, their outcomes, and other events. Pure."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import isnan
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from netboard.base.settings import parse_json
from netboard.network.protocol.records import BLOCK_BEGAN, EventRecord
from netboard.recording.format.summary import Attempt, Gap
from netboard.task.trials.state_machine import Cause

KINDS = ("trial", "release", "success", "failure", "stop", "note", "event", "gap")
"""Kinds of marks.

The board has to be levelled for an attempt (trial); the ball is released (release); it was held in the target
(success); it fell, or the time limit was reached (failure); the block was stopped or paused, or the attempt aborted
(stop); an operator's note (note); any other event (event); ticks are missing (gap).
"""

_KINDS: dict[int, str] = {
    Cause.LEVEL: "release",
    Cause.HELD: "success",
    Cause.FELL: "failure",
    Cause.TIMED_OUT: "failure",
    Cause.ABORT: "stop",
    Cause.PAUSE: "stop",
    Cause.STOP: "stop",
    Cause.SKIP: "stop",
    Cause.FAULT: "stop",
}


@dataclass(frozen=True, slots=True)
class _Note:
    """A note as the console sends it: its text, and the tick at which its writing began."""

    text: str
    tick: int | None = None


_NOTE = TypeAdapter(_Note)

_IN_TICKS = {cause.name.lower() for cause in Cause} | {"attempt_ended", BLOCK_BEGAN}
"""Events that a mark from the ticks already shows."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A mark on the time line."""

    time: float  # time from the start of the recording [s]
    tick: int
    kind: str
    label: str
    trial: int


def seconds(ticks: NDArray[Any]) -> NDArray[np.float64]:
    """Return the time of each tick from the start of the recording [s]."""
    return np.asarray((ticks["time_ns"] - ticks["time_ns"][0]) * 1e-9, dtype=np.float64)


def marks(
    ticks: NDArray[Any],
    attempts: Sequence[Attempt] = (),
    gaps: Sequence[Gap] = (),
    events: Sequence[EventRecord] = (),
    consequences: Mapping[tuple[int, int], str] = MappingProxyType({}),
) -> tuple[Mark, ...]:
    """Return the marks of a recording; ``consequences``: what the analysis does with an attempt at a trial."""
    times = seconds(ticks)

    def mark(tick: int, kind: str, label: str, trial: int | None = None) -> Mark:
        row = min(max(int(np.searchsorted(ticks["tick"], tick, side="right")) - 1, 0), len(ticks) - 1)
        return Mark(float(times[row]), tick, kind, label, int(ticks["trial"][row]) if trial is None else trial)

    released = np.isin([attempt.tick for attempt in attempts], ticks["tick"])
    found = [
        mark(one.began, "trial", _attempt_in_words(one, known, consequences), one.trial)
        for one, known in zip(attempts, released, strict=True)
    ]
    for row in np.flatnonzero(ticks["event"]):
        cause = int(ticks["event"][row])
        if cause in _KINDS:
            label = f"{Cause(cause).name.lower()} {int(ticks['trial'][row])}"
            found.append(mark(int(ticks["tick"][row]), _KINDS[cause], label))
    found += [mark(gap.first - 1, "gap", gap_in_words(gap)) for gap in gaps]
    found += [mark(*_event_in_words(_at_tick(event, ticks))) for event in events if event.name not in _IN_TICKS]
    return tuple(sorted(found, key=lambda one: one.time))


def _at_tick(event: EventRecord, ticks: NDArray[Any]) -> EventRecord:
    """Return an event that names no tick, such as the end of a rehearsal, at the newest tick of its time."""
    newest = max(int(np.searchsorted(ticks["time_ns"], event.time_ns, side="right")) - 1, 0)
    return event if event.tick >= 0 else replace(event, tick=int(ticks["tick"][newest]))


def _attempt_in_words(attempt: Attempt, released: bool, consequences: Mapping[tuple[int, int], str]) -> str:
    took = "" if isnan(attempt.completion) else f" in {attempt.completion:.3f} s"
    again = f", attempt {attempt.attempt}" if attempt.attempt > 1 else ""
    ended = f"trial {attempt.trial}{again}: {attempt.outcome.replace('_', ' ')}{took}"
    consequence = consequences.get((attempt.trial, attempt.attempt), "")
    excluded = consequence and f"will be {consequence}"
    return ", ".join(filter(None, (ended, "" if released else "its release is not recorded", excluded)))


def gap_in_words(gap: Gap) -> str:
    """Describe missing ticks."""
    last = gap.first + gap.count - 1
    return f"tick {gap.first} is missing" if gap.count == 1 else f"ticks {gap.first} to {last} are missing"


def _event_in_words(event: EventRecord) -> tuple[int, str, str]:
    """Return tick, kind and label of an event."""
    details = event.details
    refused = details.get("accepted") == "false"  # its text may be anything
    if event.name == "command" and details.get("name") == "note" and not refused:
        return _note(event.tick, details.get("argument", ""))
    where, what = details.get("side", details.get("station")), details.get("name", details.get("event"))
    words = " ".join(filter(None, (where, event.name.replace("_", " "), what)))
    length = f"{details['milliseconds']} ms" if "milliseconds" in details else ""
    return event.tick, "event", ": ".join(filter(None, (words, length, details.get("reason"))))


def _note(tick: int, argument: str) -> tuple[int, str, str]:
    """Return a note, at the tick at which its writing began if known."""
    if argument.lstrip().startswith("{"):
        with suppress(ValueError):  # what is no note of a console is shown as it is
            note = _NOTE.validate_python(parse_json(argument))
            return (tick if note.tick is None else note.tick), "note", note.text
    return tick, "note", argument


HERE, JUST_NOW = 5e-4, 0.5
"""Distance, ahead and behind, within which a mark counts as the current position [s].

The wider distance behind lets an operator step back through marks while the replay runs.
"""

ANY = "mark"
"""Stands for any of the `KINDS`."""


def trial_starts(found: Sequence[Mark]) -> list[Mark]:
    """Return the marks of the trials in order, each at its first attempt."""
    return list({mark.trial: mark for mark in reversed(found) if mark.kind == "trial"}.values())[::-1]


def near(found: Sequence[Mark], position: float, kind: str, *, back: bool) -> Mark | None:
    """Find the next or previous mark. The current position does not count; None if there is none.

    Of a trial, only the mark of its first attempt counts.
    """
    alike = trial_starts(found) if kind == "trial" else [mark for mark in found if kind in (ANY, mark.kind)]
    if back:
        return next((mark for mark in reversed(alike) if mark.time < position - JUST_NOW), None)
    return next((mark for mark in alike if mark.time > position + HERE), None)
