"""Collection of the evidence of a fault: the forces written to the devices, and the recordings.

An unfinished part is recovered first, as a lab would do it. A fault is checked in the period from just before it to the
recovery; that every tick is accounted for is checked over whole sessions.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Side
from netboard.base.tables.rig import Safety
from netboard.base.tick import TICK
from netboard.benchmarks.faults.devices import read_traces
from netboard.benchmarks.faults.evidence import Pause, between, pauses, pauses_between
from netboard.benchmarks.faults.sites import Site
from netboard.network.protocol.records import EventRecord
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.account import Account, account_of
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import Report
from netboard.recording.recovery.spilled import recover_any

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
class Taken:
    """All recordings of one dyad.

    - `painted_ns`: times at which each station's display painted a frame [ns].
    """

    ticks: NDArray[Any]
    events: tuple[EventRecord, ...]
    pauses: tuple[Pause, ...]
    accounts: tuple[Account, ...]
    painted_ns: Mapping[Side, NDArray[np.int64]]
    reports: tuple[Report, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """All evidence of a fault.

    - `traces`: forces written to each device of each side in that time.
    - `stalls` (shape (k, 2)): start and end of the stalls of an agent, in the whole run of the site [ns].
    """

    window: Window
    limits: Safety
    traces: Mapping[Side, Sequence[NDArray[Any]]]
    rig: Taken
    neighbour: Taken | None
    stalls: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))

    @property
    def reports(self) -> tuple[Report, ...]:
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
    def held_up(self) -> NDArray[np.int64]:
        """Start and end of long stalls of an agent, shape (k, 2) [ns]."""
        return _stalls(self.traces)

    def _within(self, time_ns: int) -> bool:
        return self.window.start_ns <= time_ns < self.window.stop_ns


def gather(site: Site, windows: Sequence[Window]) -> list[Evidence]:
    """Read the evidence of a site whose processes have all ended."""
    rig = take(recordings_in(site.rig.folder))
    neighbour = take(recordings_in(site.neighbour.folder)) if site.neighbour is not None else None
    traces = {side: read_traces(site.rig.folder, side) for side in SIDES}
    stalls, safety = _stalls(traces), site.rig.config.safety
    return [Evidence(window, safety, _traces_in(traces, window), rig, neighbour, stalls) for window in windows]


def _stalls(traces: Mapping[Side, Sequence[NDArray[Any]]]) -> NDArray[np.int64]:
    found = [pauses_between(trace["time_ns"]) for parts in traces.values() for trace in parts]
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


def take(paths: Sequence[Path]) -> Taken:
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
    whole = np.concatenate([np.empty(0, TICK), *ticks])
    return Taken(
        ticks=whole[np.argsort(whole["time_ns"], kind="stable")],
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
