"""The agent's ring buffer of rendered forces, which the server asks for after an interruption of the link.

Every sample has a row, whether it was sent or not. The ring holds the last two minutes, until the process ends.
"""

import numpy as np

from netboard.base.compiled import Records, kernel, machine_code
from netboard.base.tick import RENDERED
from netboard.network.protocol.motion import BACKFILL_ROWS, Backfill, BackfillRequest

CAPACITY = 131_072
"""Samples that are remembered: two minutes [1]."""


@kernel
def remember(rows: Records, seq: int, stamp_ns: int, rendered: float, safeguards: int) -> None:
    """Store a sample's row in its place of the ring."""
    row = rows[seq % len(rows)]
    row["seq"], row["stamp_ns"], row["rendered"], row["safeguards"] = seq, stamp_ns, rendered, safeguards


class RenderedRing:
    """Ring buffer of the rendered force of each sample; `next_seq` numbers the sample after the newest one."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self.rows = np.zeros(capacity, RENDERED)
        self.next_seq = 0
        self._remember = machine_code(remember, self.rows, 0, 0, 0.0, 0)

    def add(self, seq: int, stamp_ns: int, rendered: float, safeguards: int) -> None:
        """Store the force rendered before a sample; samples are numbered from 0 without a gap."""
        self._remember(self.rows, seq, stamp_ns, rendered, safeguards)
        self.next_seq = seq + 1

    def answer(self, asked: BackfillRequest) -> Backfill:
        """Return the first of the requested rows that are still in the ring."""
        stop = min(asked.stop, self.next_seq)
        first = max(asked.first, self.next_seq - len(self.rows), 0)
        if first >= stop:
            return Backfill(asked.first, asked.stop, b"")
        last = min(stop, first + BACKFILL_ROWS)
        rows = self.rows[np.arange(first, last) % len(self.rows)].tobytes()
        return Backfill(asked.first, asked.stop if last == stop else last, rows)
