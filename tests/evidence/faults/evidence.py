"""Measurements of a fault, from the forces written to the devices and the recordings: arrays in, numbers out.

The trace of a device has a row for each written force (`evidence.faults.devices.TRACE`), independent of the
network. Consecutive renewed forces always differ, because a hand is never at rest to the last bit; equal forces have
not been renewed. So the time of the last renewed force follows from the trace alone.

All times are of the monotonic clock of the one machine.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from evidence.faults.devices import read_traces
from evidence.faults.sites import Site
from netboard.base.config import SIDES, Side
from netboard.base.tables.rig import Safety
from netboard.base.tick import TICK, TICK_NS
from netboard.devices.safety.chain import MAX_STEP_NS
from netboard.network.protocol.records import EventRecord
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.account import Account, account_of
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import CheckReport
from netboard.recording.recovery.spilled import recover_any
from netboard.task.trials.state_machine import Cause, Phase

MIN_STALL_NS = 20_000_000
"""Shortest stall of a 1 kHz loop that counts as a suspension [ns]."""

SOON_NS = 1_000_000_000
"""Longest time from the last renewal to zero force; a later zero means that the force was renewed meanwhile [ns]."""


@dataclass(frozen=True, slots=True)
class Fade:
    """Course of the vertical force while it was not renewed.

    - `last_ns`: time of the last renewed force at the device [ns].
    - `force`: that force [N].
    - `held`: delay until it was written for the last time [s].
    - `begun`: delay until another force was written; NaN without one [s].
    - `zero`: delay until the force was zero; NaN if it was not soon [s].
    - `stalled`: duration for which the machine suspended the agent meanwhile [s].
    """

    last_ns: int
    force: float
    held: float
    begun: float
    zero: float
    stalled: float

    def __str__(self) -> str:
        zero = ", not zero soon" if math.isnan(self.zero) else f", zero after {self.zero * 1e3:.1f} ms"
        stalled = f" (the agent was held up for {self.stalled * 1e3:.1f} ms)" if self.stalled else ""
        return f"{self.force:.2f} N falls after {self.begun * 1e3:.1f} ms{zero}{stalled}"


def fades(trace: NDArray[Any], longer_ns: int) -> list[Fade]:
    """Return all periods in which the vertical force was not renewed.

    - `longer_ns`: minimum duration until another force [ns].
    """
    forces, times = trace["fz"], trace["time_ns"]
    found = []
    for first, stop in _runs(forces):
        if forces[first] == 0.0 or times[min(stop, times.size - 1)] - times[first] <= longer_ns:
            continue
        last = int(times[first])
        after = forces[stop:]
        zeros = np.flatnonzero(after == 0.0)
        begun = (int(times[stop]) - last) * 1e-9 if after.size else float("nan")
        gone = zeros.size > 0 and int(times[stop + zeros[0]]) - last < SOON_NS
        zero = (int(times[stop + zeros[0]]) - last) * 1e-9 if gone else float("nan")
        until = stop + int(zeros[0]) if gone else min(stop, forces.size - 1)
        gaps = np.diff(times[first : until + 1])
        stalled = float(np.sum(gaps[gaps > MAX_STEP_NS] - TICK_NS)) * 1e-9
        found.append(Fade(last, float(forces[first]), (int(times[stop - 1]) - last) * 1e-9, begun, zero, stalled))
    return found


def _runs(values: NDArray[np.float64]) -> Iterator[tuple[int, int]]:
    """Yield runs of equal values as (first, one after the last)."""
    bounds = np.concatenate([[0], 1 + np.flatnonzero(values[1:] != values[:-1]), [values.size]])
    yield from pairwise(bounds.tolist())


def step_shares(trace: NDArray[Any], slew: float) -> NDArray[np.float64]:
    """Return the change of force up to each row, relative to the slew limit; 0 at the first two rows.

    The chain limits a force some time before it is written, but after the one before it was. So the time step of the
    chain is at most that from two rows before, and at most `MAX_STEP_NS`.
    """
    force = np.stack([trace["fx"], trace["fy"], trace["fz"]])
    times = trace["time_ns"]
    shares = np.zeros(trace.size)
    sizes = np.sqrt(np.sum(np.diff(force, axis=1)[:, 1:] ** 2, axis=0))
    shares[2:] = sizes / (slew * 1e-9 * np.minimum(times[2:] - times[:-2], MAX_STEP_NS))
    return shares


def cuts_to_zero(trace: NDArray[Any], slew: float) -> NDArray[np.int64]:
    """Return the rows at which the force was cut to zero faster than the slew limit, as by the chain after a fault."""
    silent = (trace["fx"] == 0.0) & (trace["fy"] == 0.0) & (trace["fz"] == 0.0)
    return np.flatnonzero(silent & ~np.roll(silent, 1) & (step_shares(trace, slew) > 1.0))


def stalls_in(times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the stalls of a loop that exceed `MIN_STALL_NS`."""
    rows = np.flatnonzero(np.diff(times_ns) > MIN_STALL_NS)
    return np.stack([times_ns[rows], times_ns[rows + 1]], axis=1)


@dataclass(frozen=True, slots=True)
class Pause:
    """A pause of a trial, caused by a fault.

    - `at_ns`: time [ns].
    - `next_attempt`: trial and attempt that came next; None at the end of the recording [1].
    """

    at_ns: int
    reason: str
    trial: int
    attempt: int
    next_attempt: tuple[int, int] | None

    @property
    def repeated(self) -> bool:
        """Whether the same trial came next, as a new attempt."""
        return self.next_attempt == (self.trial, self.attempt + 1)


def pauses(ticks: NDArray[Any], events: Sequence[EventRecord]) -> list[Pause]:
    """Return the pauses of one session that were caused by faults."""
    notices = [
        (event.tick, event.details.get("notice", "")) for event in events if event.name == Cause.FAULT.name.lower()
    ]
    found = []
    for row in np.flatnonzero(ticks["event"] == Cause.FAULT).tolist():
        tick = int(ticks["tick"][row])
        _, notice = min(notices, key=lambda event: abs(event[0] - tick), default=(tick, ""))
        later = np.flatnonzero(ticks["phase"][row + 1 :] == Phase.LEVELLING)
        next_attempt = None
        if later.size:
            then = ticks[row + 1 + int(later[0])]
            next_attempt = int(then["trial"]), int(then["attempt"])
        at_ns, trial, attempt = (int(ticks[name][row]) for name in ("time_ns", "trial", "attempt"))
        found.append(Pause(at_ns, notice, trial, attempt, next_attempt))
    return found


def between(trace: NDArray[Any], start_ns: int, stop_ns: int) -> NDArray[Any]:
    """Return the rows of an array with ``time_ns`` that lie in a time window."""
    first, stop = np.searchsorted(trace["time_ns"], (start_ns, stop_ns))
    return trace[int(first) : int(stop)]


BEFORE_NS = 5_000_000
"""Time before a fault that belongs to its trace, so that it includes the last force before it [ns]."""


@dataclass(frozen=True)
class Window:
    """Time window of a fault.

    - `start_ns`, `stop_ns`: just before the fault, and after the recovery [ns].
    - `trouble`: why the fault was not injected as intended, or there was no recovery; else empty.
    """

    start_ns: int
    stop_ns: int
    facts: Mapping[str, str] = field(default_factory=dict)
    trouble: str = ""


@dataclass(frozen=True)
class DyadRecordings:
    """All recordings of one dyad.

    - `painted_ns`: times at which each station's display painted a frame [ns].
    """

    ticks: NDArray[Any]
    events: tuple[EventRecord, ...]
    pauses: tuple[Pause, ...]
    accounts: tuple[Account, ...]
    painted_ns: Mapping[Side, NDArray[np.int64]]
    reports: tuple[CheckReport, ...] = ()

    @property
    def lost_ticks(self) -> int:
        """Number of ticks that the recordings list as lost [1]."""
        return sum(stretch.last - stretch.first + 1 for account in self.accounts for stretch in account.lost)


@dataclass(frozen=True)
class Evidence:
    """All evidence of a fault.

    - `traces`: forces written to each device of each side in that time.
    - `stalls` (shape (k, 2)): start and end of the stalls of an agent, in the whole run of the site [ns].
    """

    window: Window
    limits: Safety
    traces: Mapping[Side, Sequence[NDArray[Any]]]
    rig: DyadRecordings
    neighbour: DyadRecordings | None
    stalls: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))

    @property
    def reports(self) -> tuple[CheckReport, ...]:
        """Result of `netboard check` for each file, including the other dyad's."""
        return (*self.rig.reports, *(self.neighbour.reports if self.neighbour is not None else ()))

    @property
    def ticks(self) -> NDArray[Any]:
        """The dyad's ticks of that time."""
        return between(self.rig.ticks, self.window.start_ns, self.window.stop_ns)

    @property
    def events(self) -> list[EventRecord]:
        """The dyad's events of that time."""
        return [event for event in self.rig.events if self._within(event.time_ns)]

    @property
    def pauses(self) -> list[Pause]:
        """The dyad's pauses of that time."""
        return [pause for pause in self.rig.pauses if self._within(pause.at_ns)]

    @property
    def window_stalls(self) -> NDArray[np.int64]:
        """Start and end of the stalls of an agent in that time, shape (k, 2) [ns]."""
        return _stalls(self.traces)

    def _within(self, time_ns: int) -> bool:
        return self.window.start_ns <= time_ns < self.window.stop_ns


def gather(site: Site, windows: Sequence[Window]) -> list[Evidence]:
    """Read the evidence of a site whose processes have all ended."""
    rig = read_recordings(recordings_in(site.rig.folder))
    neighbour = read_recordings(recordings_in(site.neighbour.folder)) if site.neighbour is not None else None
    traces = {side: read_traces(site.rig.folder, side) for side in SIDES}
    stalls, safety = _stalls(traces), site.rig.config.safety
    return [Evidence(window, safety, _traces_in(traces, window), rig, neighbour, stalls) for window in windows]


def _stalls(traces: Mapping[Side, Sequence[NDArray[Any]]]) -> NDArray[np.int64]:
    found = [stalls_in(trace["time_ns"]) for parts in traces.values() for trace in parts]
    return np.concatenate([np.empty((0, 2), np.int64), *found])


def _traces_in(traces: Mapping[Side, Sequence[NDArray[Any]]], window: Window) -> dict[Side, list[NDArray[Any]]]:
    start_ns = window.start_ns - BEFORE_NS
    cut = {side: [between(trace, start_ns, window.stop_ns) for trace in found] for side, found in traces.items()}
    return {side: [trace for trace in found if trace.size] for side, found in cut.items()}


def recordings_in(folder: Path) -> list[Path]:
    """Find all recordings below a folder, after recovering unfinished and spilled parts."""
    for unfinished in (*folder.rglob("*.mcap.part"), *folder.rglob("*.spill")):
        recover_any(unfinished)
    return sorted(folder.rglob("*.mcap"))


def read_recordings(paths: Sequence[Path]) -> DyadRecordings:
    """Read the recordings of a dyad."""
    sessions: dict[str, list[Path]] = {}
    painted: dict[Side, list[int]] = {side: [] for side in SIDES}
    for path in paths:
        with Recording(path) as recording:
            sessions.setdefault(recording.metadata["session"], []).append(path)
            for frame in recording.frames():
                painted[cast("Side", frame.station)].append(frame.painted_ns)
    accounts = [account_of(parts) for parts in sessions.values()]
    ticks = [_ticks(parts) for parts in sessions.values()]
    found = [pause for rows, account in zip(ticks, accounts, strict=True) for pause in pauses(rows, account.events)]
    ticks_of_all = np.concatenate([np.empty(0, TICK), *ticks])
    return DyadRecordings(
        ticks=ticks_of_all[np.argsort(ticks_of_all["time_ns"], kind="stable")],
        events=tuple(sorted((e for account in accounts for e in account.events), key=lambda event: event.time_ns)),
        pauses=tuple(sorted(found, key=lambda pause: pause.at_ns)),
        accounts=tuple(accounts),
        painted_ns={side: np.array(times, np.int64) for side, times in painted.items()},
        reports=tuple(check(path) for path in paths),
    )


def _ticks(parts: Sequence[Path]) -> NDArray[Any]:
    """Return each tick of a session once."""
    rows = []
    for path in parts:
        with Recording(path) as recording:
            rows.append(recording.ticks())
    together = np.concatenate(rows)
    return together[np.unique(together["tick"], return_index=True)[1]]
