"""Times and trial events of a recording, collected in one pass through its ticks in constant memory.

The nominal time of a tick is its number in milliseconds, except where the server's clock had to jump; ticks that no
logger received are missing. Times are therefore looked up, and a recording states whether its rows are evenly spaced.
"""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import TICK_NS
from netboard.network.protocol.records import kind_of_peer
from netboard.recording.export.formats import Progress, reporting
from netboard.recording.export.task import EVENT_NAMES
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import Attempt, find_attempts, from_release, turns_along
from netboard.recording.integrity.quality_check import judged
from netboard.stage.perturbing import is_perturbed

PORTION = 16_384
"""Approximate number of ticks in memory at once [1]."""

_DRIFT_NS = 1_000_000_000
"""Upper bound of the drift between two clocks within a block, with a wide margin [ns]."""


@dataclass(frozen=True, slots=True)
class PhaseChange:
    """A change of the trial phase."""

    tick: int  # tick that caused the change; the new phase begins with the next one
    name: str
    # Number of the trial in the block, and of the attempt.
    trial: int
    attempt: int
    target: int


@dataclass(frozen=True, slots=True)
class PerturbationSpan:
    """A perturbation: its ticks, and its attempt."""

    tick: int
    stop: int  # first tick after it
    trial: int
    attempt: int
    target: int


class Survey:
    """Results of the pass through a recording. ``origin_ns``: server time of the first tick [ns]."""

    def __init__(self, recording: Recording) -> None:
        self.ticks = 0
        self._last = 0
        self._jumps: list[tuple[int, int]] = []
        found: list[PhaseChange] = []
        self._perturbed: list[PerturbationSpan] = []
        turns = turns_along(self._watched(recording, found))
        recorded = find_attempts(turns)
        self.attempts: tuple[Attempt, ...] = from_release(recorded, turns["tick"], turns["run_ticks"])
        self.phase_changes = tuple(found)
        self.perturbations = tuple(self._perturbed)
        flags = {verdict.release: verdict.flags for verdict in judged(recording)}
        # Quality flags of each completed attempt, by the tick of its release.
        self.flags = {one.tick: flags.get(at.tick, ()) for one, at in zip(self.attempts, recorded, strict=True)}
        first, lead_ns = self._jumps[0]
        self._first, self.origin_ns = first, first * TICK_NS + lead_ns
        self.duration = self.span(first, self._last + 1)  # time from the first tick to the end of the last [s]
        self.rate = self.ticks * 10**9 / round(self.duration * 1e9)  # mean row rate [Hz]
        self._utc_ns = self.origin_ns + _utc_minus_server(recording)

    def _watched(self, recording: Recording, found: list[PhaseChange]) -> Iterator[NDArray[Any]]:
        """Yield the ticks, and collect times and phase changes on the way."""
        for rows in recording.batches(PORTION):
            leads = rows["time_ns"] - rows["tick"] * TICK_NS
            before = leads[0] - 1 if not self._jumps else self._jumps[-1][1]
            for place in np.flatnonzero(np.diff(leads, prepend=before)):
                self._jumps.append((int(rows["tick"][place]), int(leads[place])))
            found += [_phase_change(rows[place]) for place in np.flatnonzero(rows["event"])]
            for row in rows[is_perturbed(rows, recording.config)]:
                self._note_perturbation(row)
            self.ticks += rows.size
            self._last = int(rows["tick"][-1])
            yield rows

    def _note_perturbation(self, row: np.void) -> None:
        """Note a tick of a perturbation, which continues the one before unless it is of another attempt."""
        tick, which = int(row["tick"]), (int(row["trial"]), int(row["attempt"]), int(row["target"]))
        if self._perturbed and (before := self._perturbed[-1]) and (before.trial, before.attempt) == which[:2]:
            self._perturbed[-1] = replace(before, stop=tick + 1)
        else:
            self._perturbed.append(PerturbationSpan(tick, tick + 1, *which))

    @property
    def regular(self) -> bool:
        """Whether every row is one millisecond after the previous one."""
        return len(self._jumps) == 1 and self.ticks == self._last + 1 - self._first

    @property
    def began(self) -> datetime:
        """Time of the first tick, UTC."""
        return datetime.fromtimestamp(0, UTC) + timedelta(microseconds=round(self._utc_ns / 1000))

    def portions(self, recording: Recording, progress: Progress) -> Iterator[NDArray[Any]]:
        """Return the ticks again in portions that report progress."""
        return reporting(recording.batches(PORTION), recording.path.stem, self.ticks, progress)

    def seconds(self, tick: int) -> float:
        """Return the time of a tick after the first one, as the nearest float [s]."""
        return (self._time_ns(tick) - self.origin_ns) / 1e9

    def span(self, first: int, stop: int) -> float:
        """Return the time from one tick to another, as the nearest float [s]."""
        return (self._time_ns(stop) - self._time_ns(first)) / 1e9

    def _time_ns(self, tick: int) -> int:
        place = max(bisect_right(self._jumps, tick, key=lambda jump: jump[0]) - 1, 0)
        return tick * TICK_NS + self._jumps[place][1]


def _phase_change(row: np.void) -> PhaseChange:
    name = EVENT_NAMES.get(int(row["event"]), "unknown")
    return PhaseChange(int(row["tick"]), name, int(row["trial"]), int(row["attempt"]), int(row["target"]))


def _utc_minus_server(recording: Recording) -> int:
    """Return wall-clock time minus server time [ns].

    It comes from the logger's best clock probe. Without probes, as in a rehearsal, it comes from the server time just
    before the file was opened.
    """
    opened_ns, clock_ns, server_ns = (
        int(recording.metadata[name]) for name in ("opened_log_ns", "opened_monotonic_ns", "welcome_server_ns")
    )
    probes = [probe for probe in recording.clocks() if kind_of_peer(probe.peer) == "logger"]
    offsets = [(probe.bound_ns, probe.offset_ns) for probe in probes]
    # Another logger on another computer may have been connected; this file's logger matches the noted times.
    nearest = min((abs(clock_ns - server_ns - offset) for _, offset in offsets), default=0)
    matching = [found for found in offsets if abs(clock_ns - server_ns - found[1]) <= nearest + _DRIFT_NS]
    return opened_ns - (clock_ns - min(matching)[1] if matching else server_ns)
