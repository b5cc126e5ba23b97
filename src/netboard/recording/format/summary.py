"""What a recording amounts to, as numbers: a pure function of its arrays. Services print it; nothing is drawn here.

A percentile of nothing is not a number. The outcome of an attempt is read from the ``event`` column: the event in row k
ended the phase found in row k.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.tick import LATE_NS, TICK, TICK_SECONDS
from netboard.network.protocol.motion import Safeguard
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord, kind_of_peer
from netboard.recording.format.backfill import unknown_ticks
from netboard.task.trials.state_machine import BALL_FREE, Cause, Phase


@dataclass(frozen=True, slots=True)
class Gap:
    """Consecutive numbers that are missing."""

    first: int
    count: int


def find_gaps(numbers: NDArray[np.int64]) -> tuple[Gap, ...]:
    """Holes between the smallest and the largest of some numbers."""
    present = np.unique(numbers)
    steps = np.diff(present)
    holes = np.flatnonzero(steps > 1)
    return tuple(Gap(int(present[k]) + 1, int(steps[k]) - 1) for k in holes)


@dataclass(frozen=True, slots=True)
class Spread:
    """How a duration is distributed.

    Attributes
    ----------
    p50, p99, p999, largest : float
        Percentiles 50, 99 and 99.9, and the largest value [s].
    """

    count: int
    p50: float
    p99: float
    p999: float
    largest: float


def spread(values_ns: NDArray[np.int64]) -> Spread:
    """Distribution of durations."""
    if values_ns.size == 0:
        return Spread(0, *[float("nan")] * 4)
    seconds = values_ns * 1e-9
    p50, p99, p999 = np.percentile(seconds, (50, 99, 99.9))
    return Spread(seconds.size, float(p50), float(p99), float(p999), float(seconds.max()))


@dataclass(frozen=True, slots=True)
class Attempt:
    """One attempt at a trial, from the release of the ball on.

    Attributes
    ----------
    trial, attempt : int
        Number of the trial in the block and of the attempt at it, from 1 [1].
    outcome : str
        ``success``, ``fell``, ``timed_out``, or the operator's or server's cause in lower case; ``unfinished`` if the
        recording ends first.
    began : int
        First tick of the levelling before it; the same as `tick` if the recording does not have it [1].
    tick : int
        Tick at which the ball was released, or at which the recording begins [1].
    duration : float
        From there to the end, holding included [s].
    completion : float
        Completion time of a success, else not a number [s].
    """

    trial: int
    attempt: int
    target: int
    outcome: str
    began: int
    tick: int
    stop: int
    duration: float
    completion: float


_OUTCOMES = {Cause.HELD: "success", Cause.FELL: "fell", Cause.TIMED_OUT: "timed_out", Cause.LAST: "skip"}
"""Other attempts end with a command, and are called by it. While the ball rolls, the block's end is a skip."""

_CAUSES = frozenset(int(cause) for cause in Cause)

_ROW_BYTES = np.dtype((np.void, TICK.itemsize))
"""Rows are joined as plain bytes: numpy compares every field of structured types before it joins them."""


def find_attempts(ticks: NDArray[Any]) -> tuple[Attempt, ...]:
    """All attempts of a recording, in order."""
    if ticks.size == 0:
        return ()
    # Trial and attempt count too, so that a hole in the recording does not join two attempts.
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
        ended = stop < ticks.size or cause in _OUTCOMES
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


def attempts_along(portions: Iterable[NDArray[Any]]) -> tuple[Attempt, ...]:
    """All attempts of a recording that does not have to be in memory."""
    kept: list[NDArray[Any]] = []
    for rows in portions:
        # An attempt, and the levelling before it, is known by its first row and its last.
        keys = np.stack([rows[name] for name in ("phase", "trial", "attempt")])
        turns = np.any(np.diff(keys) != 0, axis=0)
        ends = np.concatenate([[True], turns]) | np.concatenate([turns, [True]])
        kept.append(rows[ends].view(_ROW_BYTES))
    return find_attempts(np.concatenate(kept).view(TICK)) if kept else ()


def _outcome(cause: int) -> str:
    """What became of an attempt that ended for a cause; ``unknown`` if there is no such cause."""
    if cause in _OUTCOMES:
        return _OUTCOMES[Cause(cause)]
    return Cause(cause).name.lower() if cause in _CAUSES else "unknown"


def _levelled(before: NDArray[Any], release: Any) -> int:
    """First tick of the levelling that led to a release, or the release itself."""
    same = (before["trial"] == release["trial"]) & (before["attempt"] == release["attempt"])
    found = np.flatnonzero(same & (before["phase"] == Phase.LEVELLING))
    return int(before["tick"][found[0]]) if found.size else int(release["tick"])


@dataclass(frozen=True, slots=True)
class SideSummary:
    """One side of the rig.

    Attributes
    ----------
    loop : Spread
        Stylus read to rendering of the force computed from it [s].
    largest_force : float
        Largest magnitude of the vertical force handed to the device, as far as it is known; NaN if it never is [N].
    unknown_ticks : int
        Ticks since the first sample at which nobody knows what the device rendered [1].
    safeguards : dict of int
        Ticks at which each action of the safety chain was reported, by its lower-case name; others are left out [1].
    limited_ticks : int
        Ticks at which the force was clamped or its change limited [1].
    skipped_samples : int
        Samples that no tick used, because a newer one was there or they were lost [1].
    """

    loop: Spread
    largest_force: float
    unknown_ticks: int
    safeguards: dict[str, int]
    limited_ticks: int
    stale_ticks: int
    skipped_samples: int


def summarise_side(ticks: NDArray[Any], side: str) -> SideSummary:
    """Sum up one side."""
    loop, bits, seqs = ticks[f"{side}_loop_ns"], ticks[f"{side}_safeguards"], ticks[f"{side}_seq"]
    rendered = ticks[f"{side}_rendered"]
    known = rendered[~np.isnan(rendered)]
    steps = np.diff(seqs[seqs >= 0])
    counts = {str(guard.name).lower(): int(np.count_nonzero(bits & guard.value)) for guard in Safeguard}
    return SideSummary(
        loop=spread(_closed_loops(loop)),
        largest_force=float(np.max(np.abs(known))) if known.size else nan,
        unknown_ticks=unknown_ticks(rendered),
        safeguards={name: count for name, count in counts.items() if count},
        limited_ticks=int(np.count_nonzero(bits & (Safeguard.CLAMPED | Safeguard.SLEWED).value)),
        stale_ticks=int(np.count_nonzero(ticks[f"{side}_live"] == 0)),
        skipped_samples=int(np.sum(steps[steps > 1] - 1)),
    )


def _closed_loops(loop_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Each loop once: an agent repeats the newest one with every sample until the next is closed."""
    new = (np.diff(loop_ns, prepend=0) != 0) & (loop_ns > 0)
    return np.compress(new, loop_ns)


@dataclass(frozen=True, slots=True)
class DisplaySummary:
    """One station's display.

    Attributes
    ----------
    dropped : int
        Views replaced by a newer one before they were painted, or painted late [1].
    """

    frames: int
    dropped: int


@dataclass(frozen=True, slots=True)
class Summary:
    """What a recording amounts to.

    Attributes
    ----------
    duration : float
        First to last tick, both included [s].
    lateness : Spread
        How late ticks began [s].
    round_trips : dict of Spread
        Network round trip of the clock probes by kind of peer, the peer's own time taken off [s].
    """

    ticks: int
    duration: float
    missing: tuple[Gap, ...]
    lost_records: int
    attempts: tuple[Attempt, ...]
    late_ticks: int
    lateness: Spread
    left: SideSummary
    right: SideSummary
    round_trips: dict[str, Spread]
    displays: dict[str, DisplaySummary]
    events: int

    @property
    def completions(self) -> tuple[float, ...]:
        """Completion times of the successful trials, in order [s]."""
        return tuple(attempt.completion for attempt in self.attempts if attempt.outcome == "success")

    @property
    def failures(self) -> int:
        """Attempts that failed: the ball fell or the time was up [1]."""
        return sum(attempt.outcome in ("fell", "timed_out") for attempt in self.attempts)

    @property
    def missing_ticks(self) -> int:
        """Ticks that are not there [1]."""
        return sum(gap.count for gap in self.missing)


def summarise(
    ticks: NDArray[Any],
    events: Sequence[EventRecord] = (),
    clocks: Sequence[ClockRecord] = (),
    frames: Sequence[FrameRecord] = (),
    remarks: Sequence[EventRecord] = (),
) -> Summary:
    """Sum up a recording."""
    trips: dict[str, list[int]] = {}
    for probe in clocks:
        trips.setdefault(kind_of_peer(probe.peer), []).append(probe.t3_ns - probe.t0_ns - (probe.t2_ns - probe.t1_ns))
    return Summary(
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
