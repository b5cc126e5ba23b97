"""Stamps of a live session in server time: sample read, sample arrived, tick begun, force rendered.

A row has the stamp of the sample that its tick used, and how long before a deadline that sample arrived. That was the
deadline of the tick that followed when the sample arrived, even if the server then moved its deadlines after a stall.
An agent sends the latency of its newest closed loop with every sample; it belongs to the sample before, if no number
was skipped. The time at which the server hands a force to ZeroMQ is not recorded: it follows the start of the tick.

A time on an agent's clock is as accurate as the estimated clock offset (`ClockRecord.bound_ns`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Side
from netboard.base.errors import RecordingError
from netboard.base.tick import RENDERED, TICK_NS
from netboard.network.protocol.records import BackfillRecord, EventRecord
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import closed_loops
from netboard.recording.integrity.walk import ACTIVE
from netboard.task.trials.state_machine import Phase

Times = NDArray[np.int64]
Mask = NDArray[np.bool_]

UNKNOWN = -(2**63)
"""Time of something that is not recorded [ns]."""

_SIDE = ("seq", "stamp_ns", "lead_ns", "loop_ns")
COLUMNS = ("tick", "time_ns", "late_ns", "phase", "trial", *(f"{side}_{name}" for side in SIDES for name in _SIDE))
"""Fields of `netboard.base.tick.TICK` that hold the timing of a session."""


@dataclass(frozen=True, slots=True)
class SideStamps:
    """Stamps of one side, at every tick."""

    seq: Times  # number of the sample used, -1 for none
    fresh: Mask  # no tick has used the sample before
    read_ns: Times
    arrived_ns: Times  # when the server took the sample from its socket
    excess_ns: Times  # how much later a fresh sample was read than its number allows after the one before it; else 0
    rendered_ns: Times  # when the force of the first tick with this sample was rendered; `UNKNOWN` if not reported
    loop_ns: Times  # latency of a loop where it is first reported; else 0
    backfilled: Times  # numbers and stamps of samples that the agent reported later, as two rows, in order

    def late_reading(self, last: int, first: int) -> int:
        """Return by how much the agent exceeded its interval between the samples of two rows [ns]."""
        inside = (self.backfilled[0] > self.seq[last]) & (self.backfilled[0] < self.seq[first])
        inside &= (self.backfilled[1] > self.read_ns[last]) & (self.backfilled[1] < self.read_ns[first])
        numbers = np.concatenate([[self.seq[last]], self.backfilled[0, inside], [self.seq[first]]])
        read = np.concatenate([[self.read_ns[last]], self.backfilled[1, inside], [self.read_ns[first]]])
        return int(np.max(np.diff(read) - TICK_NS * np.diff(numbers)))


@dataclass(frozen=True, slots=True)
class Stamps:
    """Stamps of all ticks of a recording, and its events."""

    tick: Times
    due_ns: Times  # deadline
    late_ns: Times  # start after the deadline that the tick had before any move
    moved_ns: Times  # by how much the server moved its deadlines before this tick, because it stalled
    follows: Mask  # the row before is the tick before
    in_trial: Mask
    trial: Times
    sides: Mapping[Side, SideStamps]
    events: tuple[EventRecord, ...]

    @property
    def began_ns(self) -> Times:
        """Start of every tick [ns]."""
        return self.due_ns - self.moved_ns + self.late_ns


def stamps_of(recording: Recording) -> Stamps:
    """Return the stamps of a live session; raise `RecordingError` for a file without real ones."""
    _refuse_simulated(recording)
    return stamps_from(recording.columns(*COLUMNS), recording.events(), recording.backfills(), str(recording.path))


def stamps_from(
    columns: dict[str, NDArray[Any]],
    events: tuple[EventRecord, ...] = (),
    backfills: Iterable[BackfillRecord] = (),
    name: str = "the recording",
) -> Stamps:
    """Return the stamps in columns of ticks; ``name``: of the recording, for errors."""
    tick, time_ns = columns["tick"], columns["time_ns"]
    if tick.size == 0:
        raise RecordingError(f"{name}: contains no ticks; a trace needs those of a session")
    follows = np.diff(tick, prepend=tick[0]) == 1
    moved_ns = np.where(follows, np.diff(time_ns, prepend=time_ns[0]) - TICK_NS, 0)
    reports = list(backfills)
    sides = {
        side: _side(columns, side, follows, time_ns - moved_ns, [one for one in reports if one.side == side])
        for side in SIDES
    }
    if not any((one.seq >= 0).any() for one in sides.values()):
        raise RecordingError(f"{name}: contains no sample of an agent; a trace needs a live session with devices")
    return Stamps(
        tick=tick,
        due_ns=time_ns,
        late_ns=columns["late_ns"] + moved_ns,
        moved_ns=moved_ns,
        follows=follows,
        in_trial=ACTIVE[np.clip(columns["phase"], 0, len(Phase) - 1)],
        trial=columns["trial"],
        sides=sides,
        events=events,
    )


def _side(
    columns: dict[str, NDArray[Any]], side: str, follows: Mask, due_ns: Times, reports: list[BackfillRecord]
) -> SideStamps:
    """Return the stamps of one side. ``due_ns``: deadlines as they were when the samples arrived."""
    seq, read_ns, lead_ns, loop_ns = (columns[f"{side}_{name}"] for name in _SIDE)
    ages_ns = (columns["time_ns"] - read_ns)[seq >= 0]
    if ages_ns.size > 1 and np.ptp(ages_ns) == 0:  # no clock keeps this: a robot in the server moves this side
        seq = np.full_like(seq, -1)
    steps = np.diff(seq, prepend=seq[0])
    fresh = (seq >= 0) & ((steps != 0) | ~follows)
    newest = np.maximum.accumulate(np.where(fresh, np.arange(seq.size), 0))
    after = fresh & follows & (steps > 0) & (seq - steps >= 0)
    excess_ns = np.where(after, np.diff(read_ns, prepend=read_ns[0]) - steps * TICK_NS, 0)
    closed = fresh & follows & closed_loops(loop_ns)
    rendered_ns = np.full(seq.size, UNKNOWN)
    reported_at = np.flatnonzero(closed & (steps == 1))
    rendered_ns[newest[reported_at - 1]] = read_ns[reported_at - 1] + loop_ns[reported_at]
    return SideStamps(
        seq=seq,
        fresh=fresh,
        read_ns=read_ns,
        arrived_ns=(due_ns - lead_ns)[newest],
        excess_ns=excess_ns,
        rendered_ns=rendered_ns,
        loop_ns=np.where(closed, loop_ns, 0),
        backfilled=_late_reports(reports),
    )


def _late_reports(reports: list[BackfillRecord]) -> Times:
    """Return numbers and stamps of the samples that an agent reported later, sorted by time."""
    parts = [np.empty((2, 0), np.int64)]
    for report in reports:
        rows = np.frombuffer(report.rows, RENDERED)
        parts.append(np.stack([rows["seq"], rows["stamp_ns"] - report.offset_ns]))
    backfilled = np.concatenate(parts, axis=1)
    return backfilled[:, np.argsort(backfilled[1], kind="stable")]


def _refuse_simulated(recording: Recording) -> None:
    """Refuse recordings whose stamps no machine has taken."""
    metadata = recording.metadata
    what = {
        "a rehearsal": "rehearsed" in metadata,
        f"computed from {metadata.get('source', 'another recording')}": "what_if" in metadata,
        "imported from a table": metadata.get("imported") in {"measured", "simulated"},
    }
    for words in (words for words, holds in what.items() if holds):
        raise RecordingError(
            f"{recording.path}: is {words}: its stamps are simulated and say nothing about a machine; "
            "trace a recording of a live session"
        )
