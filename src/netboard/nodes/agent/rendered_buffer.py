"""The agent's ring buffer of rendered forces, which the server asks for after an interruption of the link.

Every sample has a row, whether it was sent or not. The ring holds the last two minutes, until the process ends.
"""

import struct

from netboard.base.tick import RENDERED
from netboard.network.protocol.motion import BACKFILL_ROWS, Backfill, BackfillRequest

CAPACITY = 131_072
"""Samples that are remembered: two minutes [1]."""

_ROW = struct.Struct("<qqdq")
assert _ROW.size == RENDERED.itemsize


class RenderedRing:
    """Remembers the rendered force of each sample."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._capacity = capacity
        self._rows = bytearray(capacity * _ROW.size)
        self._next = 0

    def add(self, seq: int, stamp_ns: int, rendered: float, safeguards: int) -> None:
        """Store the force rendered before a sample; samples are numbered from 0 without a gap."""
        _ROW.pack_into(self._rows, seq % self._capacity * _ROW.size, seq, stamp_ns, rendered, safeguards)
        self._next = seq + 1

    def answer(self, asked: BackfillRequest) -> Backfill:
        """Return the first of the requested rows that are still in the ring."""
        stop = min(asked.stop, self._next)
        first = max(asked.first, self._next - self._capacity, 0)
        if first >= stop:
            return Backfill(asked.first, asked.stop, b"")
        last = min(stop, first + BACKFILL_ROWS)
        places = (number % self._capacity * _ROW.size for number in range(first, last))
        rows = b"".join(self._rows[place : place + _ROW.size] for place in places)
        return Backfill(asked.first, asked.stop if last == stop else last, rows)
