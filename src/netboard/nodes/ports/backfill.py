"""Backfill after an interruption: the server asks the agents what their devices rendered while no sample arrived.

The rows of those ticks hold NaN for the rendered force. The agent remembers it for two minutes and sends it in parts,
one for each request. The server makes requests between ticks, so that none is delayed, and repeats a request without an
answer. An agent that was restarted has forgotten it, and the force stays unknown. Time is an argument.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Side
from netboard.base.tick import RENDERED
from netboard.network.protocol.motion import BACKFILL_ROWS, Backfill, BackfillRequest
from netboard.network.protocol.records import BackfillRecord
from netboard.nodes.ports.motion_port import MotionPort

REPEAT_INTERVAL_NS = 200_000_000
"""Interval at which an unanswered request is repeated [ns]."""

SCAN_TICKS = 60
"""Ticks that are scanned for interruptions at once; to scan a few takes as long [1]."""

MARGIN = 10
"""Samples to ask for beyond the ticks without one: this many, and one more for each this many ticks [1]."""

MAX_GAPS = 64
"""Interruptions of each side that are remembered one by one; a later one extends the last of them [1]."""


class Gaps:
    """Interruptions of one side whose samples have not been received yet."""

    def __init__(self) -> None:
        self.open: deque[BackfillRequest] = deque()
        self.requested_ns: int | None = None  # when the first of them was requested; None if it was not, or is answered
        self._known: int | None = None  # newest sample before the interruption
        self._ticks = 0  # ticks without a sample since then

    def begin(self) -> None:
        """Begin with the next sample: those before it belong to another block."""
        self._known, self._ticks = None, 0

    def poll(self, unknown: list[bool], seqs: list[int]) -> None:
        """Scan the next ticks: whether the rendered force is unknown, and the number of the newest sample."""
        for missing, seq in zip(unknown, seqs, strict=True):
            if missing:
                self._ticks += 1
                continue
            if self._known is not None and seq < self._known:
                self._forget()
            if self._known is not None and (self._ticks or seq - self._known > MARGIN):
                self._end(self._known, seq)
            self._known, self._ticks = seq, 0

    def _forget(self) -> None:
        """Forget all interruptions: a restarted agent counts from 0, and would answer with other samples."""
        self.open.clear()
        self.requested_ns = None

    def _end(self, known: int, seq: int) -> None:
        """End an interruption that began after the sample `known` with the sample `seq`.

        The number of ticks alone does not determine which samples are missing: when a line that held back samples
        opens, some of them can pass for new ones before the clock is known again. A restarted agent counts from 0.
        """
        first = seq - self._ticks - MARGIN - self._ticks // MARGIN
        first = max(0, min(first, known) if known < seq else first)
        if first < seq:
            # With the next sample, whose number tells a reader that the device held its force until then.
            self._remember(BackfillRequest(first, seq + 1))

    def _remember(self, request: BackfillRequest) -> None:
        """Add an interruption; beyond `MAX_GAPS` all samples since the last one are asked for, so that none is lost."""
        if len(self.open) < MAX_GAPS:
            self.open.append(request)
        else:
            last = self.open[-1]
            self.open[-1] = BackfillRequest(min(last.first, request.first), max(last.stop, request.stop))


class Backfiller:
    """Finds interruptions in the ticks, asks the agents about them, and turns the answers into records."""

    def __init__(self) -> None:
        self._gaps: dict[Side, Gaps] = {side: Gaps() for side in SIDES}
        self._people: tuple[Side, ...] = SIDES
        self._scanned = 0
        self._records = 0

    def expect(self, people: tuple[Side, ...], number: int) -> None:
        """Scan the sides whose hand is a person's, from this tick on if that has changed: a robot has no agent."""
        if people != self._people:
            self._people, self._scanned = people, number
            for gaps in self._gaps.values():
                gaps.begin()

    def attend(self, motion: MotionPort, rows: NDArray[np.void], number: int, now_ns: int) -> list[BackfillRecord]:
        """Take the answers that have arrived, scan the new ticks if there are many, and send requests that are due.

        An answer counts only while the agent's clock is known: its rows are dated by that clock. Else it comes again.
        """
        records = [
            self.take(side, answer, motion.agents[side].clock.offset_ns)
            for side, answer in motion.backfills
            if motion.knows_clock(side)
        ]
        motion.backfills.clear()
        if number - self._scanned >= SCAN_TICKS:
            self.poll(rows, number)
        for side in SIDES:
            if motion.knows_clock(side) and (request := self.due(side, now_ns)):
                motion.ask(side, request)
        return [record for record in records if record is not None]

    def pending(self, motion: MotionPort, rows: NDArray[np.void], number: int) -> bool:
        """Scan the last ticks, and return whether an agent that is connected still has rows to send."""
        self.poll(rows, number)
        return any(self._gaps[side].open and motion.agents[side].hello is not None for side in SIDES)

    def poll(self, rows: NDArray[np.void], number: int) -> None:
        """Scan the ticks since the last call."""
        places = np.arange(max(self._scanned, number - len(rows)), number) % len(rows)
        self._scanned = number
        for side in self._people:
            unknown = np.isnan(rows[f"{side}_rendered"][places])
            self._gaps[side].poll(unknown.tolist(), rows[f"{side}_seq"][places].tolist())

    def due(self, side: Side, now_ns: int) -> BackfillRequest | None:
        """Return the request to send to a side's agent now, and mark it as open."""
        gaps = self._gaps[side]
        if not gaps.open or (gaps.requested_ns is not None and now_ns - gaps.requested_ns < REPEAT_INTERVAL_NS):
            return None
        gaps.requested_ns = now_ns
        return gaps.open[0]

    def take(self, side: Side, answer: Backfill, offset_ns: int) -> BackfillRecord | None:
        """Return the record of an answer; None if the answer is empty, invalid or was not requested."""
        gaps = self._gaps[side]
        request = gaps.open[0] if gaps.open and gaps.requested_ns is not None else None
        count, remainder = divmod(len(answer.rows), RENDERED.itemsize)
        if request is None or answer.first != request.first or not request.first < answer.next <= request.stop:
            return None
        if remainder or count > BACKFILL_ROWS:
            return None
        gaps.requested_ns = None
        gaps.open.popleft()
        if answer.next < request.stop:
            gaps.open.appendleft(BackfillRequest(answer.next, request.stop))
        if not count:
            return None
        self._records += 1
        return BackfillRecord(self._records - 1, side, offset_ns, answer.rows)
