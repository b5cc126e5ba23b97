"""Summary statistics of a recording: a pure function of its arrays. Services print them; nothing is drawn here.

Percentiles of an empty array are NaN. The outcome of an attempt comes from the ``event`` column: the event in row k
ended the phase in row k.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isnan, nan
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Words, kernel
from netboard.base.safeguards import Safeguard
from netboard.base.tick import LATE_NS, TICK_SECONDS, joined
from netboard.network.protocol.records import (
    AGENT_JOINED,
    AGENT_PRESENT,
    ClockRecord,
    EventRecord,
    FrameRecord,
    kind_of_peer,
)
from netboard.recording.format.backfill import unknown_ticks
from netboard.task.trials.state_machine import BALL_FREE, EMERGENCY_STOP, TABLE, Cause, Phase

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Gap:
    """A gap in a series of consecutive numbers."""

    first: int
    count: int


def find_gaps(numbers: NDArray[np.int64]) -> tuple[Gap, ...]:
    """Return the gaps between the smallest and the largest number."""
    present = np.unique(numbers)
    steps = np.diff(present)
    holes = np.flatnonzero(steps > 1)
    return tuple(Gap(int(present[k]) + 1, int(steps[k]) - 1) for k in holes)


def or_null(value: T) -> T | None:
    """Return None for NaN, which JSON does not have."""
    return None if isinstance(value, float) and isnan(value) else value


def or_nan(value: float | None) -> float:
    """Return NaN for None, as which JSON stores it."""
    return nan if value is None else value


@dataclass(frozen=True, slots=True)
class DurationSpread:
    """Distribution of a duration."""

    count: int
    # Percentiles 50, 99 and 99.9, and the largest value [s].
    p50: float
    p99: float
    p999: float
    largest: float


def spread(values_ns: NDArray[np.int64]) -> DurationSpread:
    """Return the distribution of durations."""
    if values_ns.size == 0:
        return DurationSpread(0, *[float("nan")] * 4)
    seconds = values_ns * 1e-9
    p50, p99, p999 = np.percentile(seconds, (50, 99, 99.9))
    return DurationSpread(seconds.size, float(p50), float(p99), float(p999), float(seconds.max()))


@dataclass(frozen=True, slots=True)
class Attempt:
    """One attempt at a trial, from the release of the ball."""

    # Number of the trial in the block, and of the attempt at it, from 1.
    trial: int
    attempt: int
    target: int
    # ``success``, ``fell``, ``timed_out``, or the cause from the operator or server in lower case; ``unfinished`` if
    # the recording ends first.
    outcome: str
    began: int  # first tick of the preceding levelling phase; equal to `tick` if the recording lacks it
    tick: int  # tick at which the ball was released or the recording begins
    stop: int
    duration: float  # time from `tick` to the end, holding included [s]
    completion: float  # completion time of a success, otherwise NaN [s]


_OUTCOMES = {Cause.HELD: "success", Cause.FELL: "fell", Cause.TIMED_OUT: "timed_out", Cause.LAST: "skip"}
"""Other attempts end with a command and carry its name. The end of a block while the ball rolls counts as a skip."""

_ENDS = frozenset(
    int(cause) for phase in BALL_FREE for cause, (after, _) in TABLE[phase].items() if after not in BALL_FREE
)
"""Causes that end an attempt, also in the last tick of a recording."""

_CAUSES = frozenset(int(cause) for cause in Cause)


def find_attempts(ticks: NDArray[Any]) -> tuple[Attempt, ...]:
    """Return all attempts of a recording, in order."""
    if ticks.size == 0:
        return ()
    # Include trial and attempt, so that a gap in the recording does not merge two attempts.
    keys = np.stack([np.isin(ticks["phase"], BALL_FREE).astype(np.int64), ticks["trial"], ticks["attempt"]])
    bounds = np.concatenate([[0], 1 + np.flatnonzero(np.any(np.diff(keys) != 0, axis=0)), [ticks.size]])
    attempts = []
    before = (0, 0)
    for first, stop in pairwise(bounds):
        if not keys[0, first]:
            before = first, stop
            continue
        begin, last = ticks[first], ticks[stop - 1]
        cause = int(last["event"])
        ended = stop < ticks.size or cause in _ENDS
        attempts.append(
            Attempt(
                trial=int(begin["trial"]),
                attempt=int(begin["attempt"]),
                target=int(begin["target"]),
                outcome=_outcome(cause) if ended else "unfinished",
                began=_levelled(ticks[slice(*before)], begin),
                tick=int(begin["tick"]),
                stop=int(last["tick"]) + 1,
                duration=float(last["tick"] + 1 - begin["tick"]) * TICK_SECONDS,
                completion=float(last["mark_ticks"]) * TICK_SECONDS if cause == Cause.HELD else float("nan"),
            )
        )
    return tuple(attempts)


def agents_of(events: Iterable[EventRecord]) -> dict[str, list[tuple[int, dict[str, str]]]]:
    """Return by side what its agents said of their devices, each with the tick from which it applies."""
    agents: dict[str, list[tuple[int, dict[str, str]]]] = {}
    for event in events:
        if event.name in {AGENT_JOINED, AGENT_PRESENT}:
            agents.setdefault(event.details.get("side", ""), []).append((event.tick, event.details))
    return agents


def attempts_along(portions: Iterable[NDArray[Any]]) -> tuple[Attempt, ...]:
    """Return all attempts of a recording that is read in batches."""
    return find_attempts(turns_along(portions))


def turns_along(portions: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """Return the first and the last row of each phase of a recording that is read in batches."""
    kept: list[NDArray[Any]] = []
    for rows in portions:
        # The first and last row of each phase suffice to describe an attempt and the levelling before it.
        places = _ends(rows["phase"], rows["trial"], rows["attempt"])
        kept.append(rows.view((np.void, rows.itemsize))[places].view(rows.dtype))  # NumPy copies field by field
    return joined(kept)


@kernel
def _ends(phase: Words, trial: Words, attempt: Words) -> NDArray[np.int64]:
    """Return the first and the last place of each run of equal rows."""
    count, last = 0, len(phase) - 1
    places = np.empty(len(phase), np.int64)
    for n in range(len(phase)):
        begins = n == 0 or phase[n] != phase[n - 1] or trial[n] != trial[n - 1] or attempt[n] != attempt[n - 1]
        ends = n == last or phase[n] != phase[n + 1] or trial[n] != trial[n + 1] or attempt[n] != attempt[n + 1]
        if begins or ends:
            places[count] = n
            count += 1
    return places[:count].copy()


def with_emergency_stops(attempts: Sequence[Attempt], events: Iterable[EventRecord]) -> tuple[Attempt, ...]:
    """Return attempts with the outcome of those that an emergency stop ended: only the server's events name it."""
    ended = (event.details for event in events if event.name == "attempt_ended")
    stopped = {(of["trial"], of["attempt"]) for of in ended if of.get("outcome") == EMERGENCY_STOP}
    return tuple(
        replace(one, outcome=EMERGENCY_STOP) if (str(one.trial), str(one.attempt)) in stopped else one
        for one in attempts
    )


def from_release(
    attempts: Sequence[Attempt], ticks: NDArray[np.int64], run_ticks: NDArray[np.int64]
) -> tuple[Attempt, ...]:
    """Return attempts with the tick of their release, even if it is missing or before the first tick."""
    since = run_ticks[np.searchsorted(ticks, [attempt.tick for attempt in attempts])].tolist()
    return tuple(
        replace(
            one,
            began=min(one.began, one.tick - lost),
            tick=one.tick - lost,
            duration=(one.stop - one.tick + lost) * TICK_SECONDS,
        )
        if lost
        else one
        for one, lost in zip(attempts, since, strict=True)
    )


def _outcome(cause: int) -> str:
    """Return the outcome of an attempt from the cause of its end; ``unknown`` if there is no such cause."""
    if cause in _OUTCOMES:
        return _OUTCOMES[Cause(cause)]
    return Cause(cause).name.lower() if cause in _CAUSES else "unknown"


def _levelled(before: NDArray[Any], release: np.void) -> int:
    """Return the first tick of the levelling before a release, or the release itself."""
    same = (before["trial"] == release["trial"]) & (before["attempt"] == release["attempt"])
    found = np.flatnonzero(same & (before["phase"] == Phase.LEVELLING))
    return int(before["tick"][found[0]]) if found.size else int(release["tick"])


@dataclass(frozen=True, slots=True)
class SideSummary:
    """Summary of one side."""

    loop: DurationSpread  # sample-to-force latency: from reading the stylus to rendering the force computed from it [s]
    largest_force: float  # largest magnitude of the known vertical rendered force; NaN if it is never known [N]
    unknown_ticks: int  # ticks since the first sample with an unknown rendered force
    # Number of ticks with each action of the safety chain, by its lower-case name; zero counts are left out.
    safeguards: dict[str, int]
    limited_ticks: int  # ticks at which the force was clamped or slew-limited
    stale_ticks: int
    skipped_samples: int  # samples that no tick used, because a newer one had arrived or they were lost


def summarise_side(ticks: NDArray[Any], side: str) -> SideSummary:
    """Summarise one side."""
    loop, bits, seqs = ticks[f"{side}_loop_ns"], ticks[f"{side}_safeguards"], ticks[f"{side}_seq"]
    rendered = ticks[f"{side}_rendered"]
    known = rendered[~np.isnan(rendered)]
    steps = np.diff(seqs[seqs >= 0])
    counts = {str(guard.name).lower(): int(np.count_nonzero(bits & guard.value)) for guard in Safeguard}
    return SideSummary(
        loop=spread(loop[closed_loops(loop)]),
        largest_force=float(np.max(np.abs(known))) if known.size else nan,
        unknown_ticks=unknown_ticks(rendered),
        safeguards={name: count for name, count in counts.items() if count},
        limited_ticks=int(np.count_nonzero(bits & (Safeguard.CLAMPED | Safeguard.SLEWED).value)),
        stale_ticks=int(np.count_nonzero(ticks[f"{side}_live"] == 0)),
        skipped_samples=int(np.sum(steps[steps > 1] - 1)),
    )


def closed_loops(loop_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return the ticks that first report a sample-to-force latency: an agent repeats the newest one until the next."""
    new: NDArray[np.bool_] = (np.diff(loop_ns, prepend=0) != 0) & (loop_ns > 0)
    return new


@dataclass(frozen=True, slots=True)
class DisplaySummary:
    """Summary of one station's display."""

    frames: int
    dropped: int  # views replaced by a newer one before they were painted, or painted late


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """Summary of a recording."""

    ticks: int
    duration: float  # time from the first to the last tick, both included [s]
    missing: tuple[Gap, ...]
    lost_records: int
    attempts: tuple[Attempt, ...]
    late_ticks: int
    lateness: DurationSpread  # delay of the tick starts after their deadlines [s]
    left: SideSummary
    right: SideSummary
    # Round-trip time of the clock probes by kind of peer, without the peer's own processing time [s].
    round_trips: dict[str, DurationSpread]
    displays: dict[str, DisplaySummary]
    events: int

    @property
    def completions(self) -> tuple[float, ...]:
        """Completion times of the successful trials, in order [s]."""
        return tuple(attempt.completion for attempt in self.attempts if attempt.outcome == "success")

    @property
    def failures(self) -> int:
        """Attempts that failed: the ball fell or the time limit was reached [1]."""
        return sum(attempt.outcome in ("fell", "timed_out") for attempt in self.attempts)

    @property
    def missing_ticks(self) -> int:
        """Missing ticks [1]."""
        return sum(gap.count for gap in self.missing)


def summarise(
    ticks: NDArray[Any],
    events: Sequence[EventRecord] = (),
    clocks: Sequence[ClockRecord] = (),
    frames: Sequence[FrameRecord] = (),
    remarks: Sequence[EventRecord] = (),
) -> RecordingSummary:
    """Summarise a recording."""
    trips: dict[str, list[int]] = {}
    for probe in clocks:
        trips.setdefault(kind_of_peer(probe.peer), []).append(probe.t3_ns - probe.t0_ns - (probe.t2_ns - probe.t1_ns))
    return RecordingSummary(
        ticks=ticks.size,
        duration=float(ticks["tick"][-1] - ticks["tick"][0] + 1) * TICK_SECONDS if ticks.size else 0.0,
        missing=find_gaps(ticks["tick"]),
        lost_records=sum(int(remark.details["count"]) for remark in remarks if remark.name == "log_lost"),
        attempts=find_attempts(ticks),
        late_ticks=int(np.count_nonzero(ticks["late_ns"] > LATE_NS)),
        lateness=spread(ticks["late_ns"]),
        left=summarise_side(ticks, "left"),
        right=summarise_side(ticks, "right"),
        round_trips={peer: spread(np.array(values, np.int64)) for peer, values in sorted(trips.items())},
        displays=_displays(frames),
        events=len(events),
    )


def _displays(frames: Sequence[FrameRecord]) -> dict[str, DisplaySummary]:
    stations = sorted({frame.station for frame in frames})
    return {
        station: DisplaySummary(
            frames=sum(frame.station == station for frame in frames),
            dropped=max(frame.dropped for frame in frames if frame.station == station),
        )
        for station in stations
    }
