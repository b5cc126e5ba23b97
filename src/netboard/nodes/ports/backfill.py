"""What the server asks agents after an interruption: what their devices rendered while no sample arrived.

The rows of those ticks say that it is not known (NaN). The agent remembers it for two minutes and tells it in parts,
one request at a time, each made when the server has time for it: nothing of this delays a tick. A request without an
answer is repeated, so that a link that fails again loses nothing. An agent that was started anew has forgotten it: then
it stays unknown. Time is an argument.
"""

from collections import deque
from typing import Any

import numpy as np

from netboard.base.config import SIDES, Side
from netboard.base.tick import RENDERED
from netboard.network.protocol.motion import BACKFILL_ROWS, Backfill, BackfillRequest
from netboard.network.protocol.records import BackfillRecord
from netboard.nodes.ports.motion_port import MotionPort

AGAIN_NS = 200_000_000
"""A request without an answer is repeated after so long [ns]."""

MARGIN = 10
"""There may be so many samples more than there were ticks without one, and one more in so many [1]."""

MOST_GAPS = 64
"""So many interruptions of each side are remembered; the oldest give way [1]."""


class Gaps:
    """The interruptions of one side whose samples the server has not asked for yet.

    Attributes
    ----------
    asked_ns : int or None
        When the first of them was asked for; None if it was not, or is answered [ns].
    """

    def __init__(self) -> None:
        self.open: deque[BackfillRequest] = deque(maxlen=MOST_GAPS)
        self.asked_ns: int | None = None
        self._seen = False
        self._ticks = 0

    def look(self, unknown: list[bool], seqs: list[int]) -> None:
        """Look at the next ticks: whether the rendered force is unknown, and the number of the newest sample."""
        for missing, seq in zip(unknown, seqs, strict=True):
            if missing:
                self._ticks += 1
                continue
            if self._ticks and self._seen:
                self._end(seq)
            self._seen, self._ticks = True, 0

    def _end(self, seq: int) -> None:
        """A sample has come after ticks without one; an agent that was started anew counts from 0."""
        first = max(seq - self._ticks - MARGIN - self._ticks // MARGIN, 0)
        if first < seq:
            self.open.append(BackfillRequest(first, seq + 1))


class Backfiller:
    """Finds interruptions in the ticks, asks the agents, and makes records of their answers."""

    def __init__(self) -> None:
        self._gaps: dict[Side, Gaps] = {side: Gaps() for side in SIDES}
        self._looked = 0
        self._records = 0

    def attend(self, motion: MotionPort, rows: Any, number: int, now_ns: int) -> list[BackfillRecord]:
        """Take the answers that have come, look at the new ticks, and ask what is due."""
        taken = [self.take(side, answer, motion.seats[side].clock.offset_ns) for side, answer in motion.backfills]
        motion.backfills.clear()
        self.look(rows, number)
        for side in SIDES:
            if motion.knows_clock(side) and (request := self.due(side, now_ns)):
                motion.ask(side, request)
        return [record for record in taken if record is not None]

    def look(self, rows: Any, number: int) -> None:
        """Look at the ticks done since the last time."""
        places = np.arange(max(self._looked, number - len(rows)), number) % len(rows)
        self._looked = number
        for side, gaps in self._gaps.items():
            unknown = np.isnan(rows[f"{side}_rendered"][places])
            gaps.look(unknown.tolist(), rows[f"{side}_seq"][places].tolist())

    def due(self, side: Side, now_ns: int) -> BackfillRequest | None:
        """Return what to ask the agent of a side now, which is then taken to be asked."""
        gaps = self._gaps[side]
        if not gaps.open or (gaps.asked_ns is not None and now_ns - gaps.asked_ns < AGAIN_NS):
            return None
        gaps.asked_ns = now_ns
        return gaps.open[0]

    def take(self, side: Side, answer: Backfill, offset_ns: int) -> BackfillRecord | None:
        """Take an answer; what is to be recorded of it, if anything.

        Parameters
        ----------
        answer : Backfill
            The answer; one that was not asked for, or that breaks the rules, is ignored.
        """
        gaps = self._gaps[side]
        asked = gaps.open[0] if gaps.open and gaps.asked_ns is not None else None
        count, odd = divmod(len(answer.rows), RENDERED.itemsize)
        if asked is None or answer.first != asked.first or not asked.first < answer.next <= asked.stop:
            return None
        if odd or count > BACKFILL_ROWS:
            return None
        gaps.asked_ns = None
        gaps.open.popleft()
        if answer.next < asked.stop:
            gaps.open.appendleft(BackfillRequest(answer.next, asked.stop))
        if not count:
            return None
        self._records += 1
        return BackfillRecord(self._records - 1, side, offset_ns, answer.rows)
