"""Flag attempts by quality rules declared in advance (`netboard.base.tables.experiment.Quality`).

A `Referee` gets the rows of the ticks, in chunks of any size, and the frames that the displays have painted. At the
tick that ends an attempt it returns a `Verdict` with the flags that apply, from `FLAGS`. The server does this live;
`netboard.recording.integrity.quality_check` does it over a recording, with the same result.

Here an attempt lasts from the release of the ball to its end, the hold included. Its counts are in one record of
`TALLY`, which is reset at every release.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined, kernel
from netboard.base.config import SIDES, Config
from netboard.base.tables.experiment import Block, Quality
from netboard.base.tick import LATE_NS, TICK, TICK_NS, TICK_SECONDS
from netboard.task.trials.state_machine import OUTCOMES, SUCCESSOR, Cause, Phase, is_free

REPORT_TICKS = 700
"""Longest delay with which the server learns of a painted frame, in ticks: displays report twice a second [1]. So the
last ticks of an attempt cannot be used to judge displays; in a success, the ball is then already in the hold."""

FLAGS: dict[str, str] = {
    "late_ticks": "too many deadline misses of the server (later than half a millisecond)",
    "lost_samples": "a stylus had no fresh sample for too large a share of the time",
    "missing_ticks": "too many ticks are missing in the recording",
    "clipped": "a force was at its limit for too large a share of the time",
    "saturated": "a stylus was at the edge of its range for too large a share of the time",
    "start_tilt": "the board was tilted when the ball was released",
    "stuck_left": "the height of the left stylus did not change for too long",
    "stuck_right": "the height of the right stylus did not change for too long",
    "too_short": "the completion time is too short for a person",
    "too_long": "the completion time is too long",
    "frozen_display": "a display showed no new frame for too long",
}
"""Every flag, with its meaning in words."""

FLAG_WORDS: dict[str, str] = {
    "late_ticks": "deadline misses",
    "lost_samples": "lost samples",
    "missing_ticks": "missing ticks",
    "clipped": "force at its limit",
    "saturated": "stylus at the edge of its range",
    "start_tilt": "board tilted at the start",
    "stuck_left": "left stylus stuck",
    "stuck_right": "right stylus stuck",
    "too_short": "too short",
    "too_long": "too long",
    "frozen_display": "frozen display",
}
"""Every flag in two or three words, for tables and lines of an operator."""

TALLY = np.dtype(
    [
        ("under_way", "<i8"),  # 1: the ball is free
        ("ended", "<i8"),  # 1: the attempt is over, and no tick was counted since
        ("trial", "<i8"),  # number of the trial in the block, from 1
        ("attempt", "<i8"),  # number of the attempt at that trial, from 1
        ("release", "<i8"),  # first tick with a free ball
        ("since_release", "<i8"),  # ticks from the true release to that one; 0 unless its tick is missing
        ("last", "<i8"),  # newest tick counted
        ("cause", "<i8"),  # the netboard.task.trials.state_machine.Cause that ended the attempt
        ("mark_ticks", "<i8"),  # ticks from the release to the ball's newest entry into the target
        ("ticks", "<i8"),  # ticks counted
        ("late", "<i8"),  # of those: deadline misses
        ("start_tilt", "<f8"),  # tilt at the release, NaN if its tick is missing [rad]
        ("lost", "<i8", 2),  # ticks without a fresh sample, left and right
        ("clipped", "<i8", 2),  # ticks with a force at its limit
        ("saturated", "<i8", 2),  # ticks with the stylus at the edge of its range
        ("stuck", "<i8", 2),  # longest run of ticks in which the height as sent did not change
        ("stamp_ns", "<i8", 2),  # time stamp of the sample of the previous tick [ns]
        ("sent_z", "<f8", 2),  # height in the newest sample [m]
        ("still", "<i8", 2),  # ticks since that changed
    ]
)
"""Counts of an attempt, and the state kept from the previous tick."""

FIELDS_NEEDED = (
    *("tick", "trial", "attempt", "phase", "event", "run_ticks", "mark_ticks", "theta", "late_ns"),
    *(f"{side}_{name}" for name in ("live", "stamp_ns", "sent_z", "used_z", "safeguards") for side in SIDES),
)
"""Fields of a tick that the rules read."""

_Sample = tuple[int, int, float, float, int]
"""Of one side at a tick: live, stamp_ns, sent_z, used_z, safeguards."""

_Ticks = NDArray[Any] | tuple[NDArray[Any], ...]
"""Rows of ticks, or columns in the order of `FIELDS_NEEDED`."""

_RUNNING = int(Phase.RUNNING)
_CAUSES = len(Cause)


def empty_tally() -> Any:
    """Return an empty tally.

    Returns
    -------
    TALLY record
        The counts before the first tick.
    """
    counts = np.zeros(1, TALLY)[0]
    counts["sent_z"] = counts["start_tilt"] = np.nan
    return counts


@inlined
def _begin(counts: np.void, tick: int, trial: int, attempt: int, run_ticks: int, theta: float) -> None:
    """Reset the counts for a new attempt."""
    counts["under_way"], counts["ended"], counts["cause"] = 1, 0, 0
    counts["trial"], counts["attempt"], counts["release"] = trial, attempt, tick
    counts["ticks"], counts["late"], counts["since_release"] = 0, 0, run_ticks
    counts["start_tilt"] = theta if run_ticks == 0 else np.nan
    for side in range(2):
        counts["lost"][side], counts["clipped"][side], counts["saturated"][side] = 0, 0, 0
        counts["stuck"][side], counts["still"][side] = 0, 0


@inlined
def _count(
    counts: np.void, side: int, live: int, stamp_ns: int, sent_z: float, edge: bool, clamped: bool, counting: bool
) -> None:
    """Count a tick of one side, and keep what the next tick is compared with."""
    if counting:
        counts["lost"][side] += live == 0 or stamp_ns == counts["stamp_ns"][side]
        counts["saturated"][side] += edge
        counts["clipped"][side] += clamped
    if live != 0:
        counts["still"][side] = counts["still"][side] + 1 if sent_z == counts["sent_z"][side] else 0
        counts["sent_z"][side] = sent_z
        if counting:
            counts["stuck"][side] = max(counts["stuck"][side], counts["still"][side])
    counts["stamp_ns"][side] = stamp_ns


@kernel
def tally(counts: np.void, rows: Records, first: int, count: int, stylus_range: float, clamped: int) -> int:
    """Count ticks, up to the first that ends an attempt, and return how many were counted [1].

    Parameters
    ----------
    rows : ndarray of TICK, shape (n,)
        Ring buffer of rows with their outputs; the fields of `FIELDS_NEEDED` are enough.
    first : int
        Number of the first tick; its row is ``first % n`` [1].
    """
    place = first % len(rows)
    for taken in range(count):
        if tally_tick(counts, rows[place], stylus_range, clamped):
            return taken + 1
        place = place + 1 if place + 1 < len(rows) else 0
    return count


@inlined
def tally_tick(counts: np.void, row: np.void, stylus_range: float, clamped: int) -> bool:
    """Count a tick, and return whether it has ended an attempt.

    Parameters
    ----------
    row : TICK record
        The tick with its outputs.
    """
    numbers = row["tick"], row["trial"], row["attempt"], row["phase"], row["event"]
    times = row["run_ticks"], row["mark_ticks"], row["late_ns"]
    left = row["left_live"], row["left_stamp_ns"], row["left_sent_z"], row["left_used_z"], row["left_safeguards"]
    right = (
        *(row["right_live"], row["right_stamp_ns"], row["right_sent_z"], row["right_used_z"]),
        row["right_safeguards"],
    )
    return _take(counts, numbers, times, row["theta"], left, right, stylus_range, clamped)


@kernel
def tally_columns(
    counts: np.void, columns: tuple[Any, ...], first: int, count: int, stylus_range: float, clamped: int
) -> int:
    """Count ticks of columns, as `tally` does, and return how many were counted [1].

    Parameters
    ----------
    columns : tuple of ndarray, shape (n,)
        Columns of ticks, in the order of `FIELDS_NEEDED`.
    first : int
        Place of the first tick in them [1].
    """
    tick, trial, attempt, phase, event, run_ticks, mark_ticks, theta, late_ns = columns[:9]
    left_live, right_live, left_stamp_ns, right_stamp_ns, left_sent_z, right_sent_z = columns[9:15]
    left_used_z, right_used_z, left_safeguards, right_safeguards = columns[15:]
    for k in range(first, first + count):
        numbers, times = (tick[k], trial[k], attempt[k], phase[k], event[k]), (run_ticks[k], mark_ticks[k], late_ns[k])
        left = left_live[k], left_stamp_ns[k], left_sent_z[k], left_used_z[k], left_safeguards[k]
        right = right_live[k], right_stamp_ns[k], right_sent_z[k], right_used_z[k], right_safeguards[k]
        if _take(counts, numbers, times, theta[k], left, right, stylus_range, clamped):
            return k - first + 1
    return count


@inlined
def _take(
    counts: np.void,
    numbers: tuple[int, int, int, int, int],
    times: tuple[int, int, int],
    theta: float,
    left: _Sample,
    right: _Sample,
    stylus_range: float,
    clamped: int,
) -> bool:
    """Count a tick, and return whether it has ended an attempt."""
    (tick, trial, attempt, phase, event), (run_ticks, mark_ticks, late_ns) = numbers, times
    free = is_free(phase)
    if free:
        same = counts["under_way"] != 0 and trial == counts["trial"] and attempt == counts["attempt"]
        if not same or (phase == _RUNNING and run_ticks == 0):
            _begin(counts, tick, trial, attempt, run_ticks, theta)
        counts["ticks"] += 1
        counts["late"] += late_ns > LATE_NS
        counts["last"], counts["mark_ticks"] = tick, mark_ticks
    live, stamp_ns, sent_z, used_z, safeguards = left
    _count(counts, 0, live, stamp_ns, sent_z, abs(used_z) >= stylus_range, (safeguards & clamped) != 0, free)
    live, stamp_ns, sent_z, used_z, safeguards = right
    _count(counts, 1, live, stamp_ns, sent_z, abs(used_z) >= stylus_range, (safeguards & clamped) != 0, free)
    if not free:
        counts["under_way"] = 0
        return False
    then = SUCCESSOR[phase, event] if 0 <= event < _CAUSES else phase
    if not is_free(then):
        counts["under_way"], counts["ended"], counts["cause"] = 0, 1, event
        return True
    return False


def longest_gap(frames: Sequence[tuple[int, int]], release: int, end: int) -> float:
    """Return the longest time in an attempt for which a display showed nothing new.

    The ball is free in an attempt, so every view differs from the one before. The last `REPORT_TICKS` are left out.
    Before the first frame and after the last one, the gap is measured in ticks; between two frames, by the ticks that
    they show or by their paint times, whichever gap is longer. Paint times further apart than the length of the attempt
    come from two displays with different clocks and are ignored.

    Parameters
    ----------
    frames : sequence of (int, int)
        Tick of the view and paint time, of all frames of a station's displays, in any order [1, ns].
    release : int
        First tick of the attempt [1].
    end : int
        Last tick of the attempt [1].

    Returns
    -------
    float
        The gap; 0 for an attempt that is too short to be judged [s].
    """
    stop = end - REPORT_TICKS
    if stop <= release:
        return 0.0
    within = sorted(frame for frame in frames if release <= frame[0] <= stop)
    longest_ns = (end - release) * TICK_NS
    shown = [release, *(tick for tick, _ in within), stop]
    ticks = max(after - before for before, after in pairwise(shown))
    painted = (after[1] - before[1] for before, after in pairwise(within))
    painted_ns = max((gap for gap in painted if gap <= longest_ns), default=0)
    return max(ticks * TICK_SECONDS, painted_ns * 1e-9)


def judge(counts: Any, completion: float, frame_gap: float, rules: Quality, block: Block) -> tuple[str, ...]:
    """Apply the rules to an attempt.

    A side that is held still has no samples and no force, so it is skipped. Only the stylus of a person can be stuck.
    Ticks can be missing only in a recording, never live.

    Parameters
    ----------
    counts : TALLY record
        Counts of the ended attempt.
    completion : float
        Completion time; NaN without a success [s].
    frame_gap : float
        Longest time for which a display showed nothing new [s].
    rules : Quality
        The limits of the block's table ``[quality]``.
    block : Block
        The block; it says who moves each side.

    Returns
    -------
    tuple of str
        Flags, in the order of `FLAGS`; empty if no rule applies.
    """
    movers = (block.left, block.right)
    moved = [side for side, mover in enumerate(movers) if mover != "still"]
    stuck = [counts["stuck"][side] * TICK_SECONDS > rules.stuck and movers[side] == "person" for side in range(2)]

    def share(name: str) -> float:
        return max(int(counts[name][side]) for side in moved) / max(int(counts["ticks"]), 1)

    whole = int(counts["since_release"]) + int(counts["last"]) + 1 - int(counts["release"])
    found = {
        "late_ticks": counts["late"] > rules.late_ticks,
        "lost_samples": share("lost") > rules.lost_share,
        "missing_ticks": whole - int(counts["ticks"]) > rules.missing_ticks,
        "clipped": share("clipped") > rules.clipped_share,
        "saturated": share("saturated") > rules.saturated_share,
        "start_tilt": abs(counts["start_tilt"]) > np.radians(rules.start_tilt_deg),
        "stuck_left": stuck[0],
        "stuck_right": stuck[1],
        "too_short": completion < rules.shortest,
        "too_long": completion > rules.longest,
        "frozen_display": frame_gap * 1e3 > rules.frozen_ms,
    }
    return tuple(word for word in FLAGS if found[word])


@dataclass(frozen=True, slots=True)
class Verdict:
    """Quality of an attempt that has ended.

    Attributes
    ----------
    trial, attempt : int
        Number of the trial in the block and of the attempt at it, from 1 [1].
    release, end : int
        First and last tick of the attempt [1].
    cause : Cause
        Cause that ended the attempt.
    completion : float
        Completion time; NaN without a success [s].
    flags : tuple of str
        What was wrong with the attempt, from `FLAGS`; empty if nothing was.
    """

    trial: int
    attempt: int
    release: int
    end: int
    cause: Cause
    completion: float
    flags: tuple[str, ...]

    @property
    def outcome(self) -> str:
        """Outcome of the attempt, as in `netboard.network.protocol.control.Outcomes`."""
        return OUTCOMES[self.cause]


class Referee:
    """Judge every attempt of one block.

    Parameters
    ----------
    clamped : int
        Bit of the safeguards for a force at its limit [1].

    Attributes
    ----------
    tally : ndarray of TALLY, shape (1,)
        Counts of the newest attempt, for a kernel that counts ticks by `tally_tick`.
    counts : TALLY record
        The same memory as a record.
    limits : (float, int)
        Last arguments of `tally_tick`: range of the styluses [m], and `clamped`.
    """

    def __init__(self, config: Config, clamped: int) -> None:
        block = config.block
        watched = (block.station,) if block.configuration == "bimanual" else SIDES
        movers = {"left": block.left, "right": block.right}
        self._rules, self._block = config.quality, block
        self.limits = config.task.stylus_range, int(clamped)
        self._stations = [side for side in watched if config.physics.balls and movers[side] == "person"]
        self._frames: dict[str, list[tuple[int, int]]] = {}
        self.tally = np.array([empty_tally()])
        self.counts = self.tally[0]

    def warm(self) -> None:
        """Compile the kernels of `watch`, or load them from the cache."""
        tally(empty_tally(), np.zeros(1, TICK), 0, 1, *self.limits)

    def paint(self, station: str, tick: int, painted_ns: int) -> None:
        """Take note of a frame that a display has painted; frames outside an attempt are ignored.

        Parameters
        ----------
        station : str
            Station of the display, ``left`` or ``right``.
        tick : int
            Number of the tick that the frame shows [1].
        painted_ns : int
            Paint time on the display's clock [ns].
        """
        if station in self._stations:
            frames = self._frames.setdefault(station, [])
            if self.counts["under_way"]:
                frames.append((tick, painted_ns))

    def watch(self, rows: NDArray[Any], first: int, count: int) -> list[Verdict]:
        """Count finished ticks: each tick once, in order.

        Parameters
        ----------
        rows : ndarray of TICK, shape (n,)
            Ring buffer of rows; the fields of `FIELDS_NEEDED` are enough.
        first : int
            Number of the first tick; its row is ``first % n`` [1].
        count : int
            Number of ticks, at most n [1].

        Returns
        -------
        list of Verdict
            Verdicts of the attempts that ended in these ticks.
        """
        return self._watched(tally, rows, first, count)

    def watch_columns(self, columns: Mapping[str, NDArray[Any]], first: int, count: int) -> list[Verdict]:
        """Count finished ticks: each tick once, in order.

        Parameters
        ----------
        columns : mapping of str to ndarray, shape (n,)
            Columns of ticks by name, at least `FIELDS_NEEDED` [SI].
        first : int
            Place of the first tick in them [1].
        count : int
            Number of ticks, at most n [1].

        Returns
        -------
        list of Verdict
            Verdicts of the attempts that ended in these ticks.
        """
        return self._watched(tally_columns, tuple(columns[name] for name in FIELDS_NEEDED), first, count)

    def _watched(self, count_ticks: Callable[..., int], ticks: _Ticks, first: int, count: int) -> list[Verdict]:
        """Count ticks with one of the kernels, and judge the attempts that end in them."""
        verdicts: list[Verdict] = []
        stop = first + count
        while first < stop:
            first += count_ticks(self.counts, ticks, first, stop - first, *self.limits)
            verdicts += self.verdicts()
        return verdicts

    def verdicts(self) -> list[Verdict]:
        """Judge the attempt that the newest tick has ended; the list is empty if it has ended none."""
        if not self.counts["ended"]:
            return []
        self.counts["ended"] = 0
        return [self._verdict()]

    def _verdict(self) -> Verdict:
        """Judge the attempt that has just ended, and discard the frames up to its end."""
        counts = self.counts
        release, end, cause = int(counts["release"]), int(counts["last"]), Cause(int(counts["cause"]))
        completion = float(counts["mark_ticks"]) * TICK_SECONDS if cause == Cause.HELD else float("nan")
        gap = max((longest_gap(frames, release, end) for frames in self._frames.values()), default=0.0)
        for frames in self._frames.values():
            frames[:] = [frame for frame in frames if frame[0] > end]
        flags = judge(counts, completion, gap, self._rules, self._block)
        return Verdict(int(counts["trial"]), int(counts["attempt"]), release, end, cause, completion, flags)
