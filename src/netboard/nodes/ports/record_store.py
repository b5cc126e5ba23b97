"""The records of a session until they are on a logger's disk: a ring in memory, and the spill, a file.

A record gets its number when it is made and keeps it. The spill takes what leaves the ring while no logger is there.
Records that neither holds are counted and reported with the cause. Nothing here waits for a disk.
"""

from collections.abc import Iterator

from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.record_buffer import LogRing
from netboard.network.protocol.records import LogBatch
from netboard.nodes.ports.peer_events import News
from netboard.recording.recovery.spill import Spill

BATCHES = 2
"""Batches spilled, or sent to one logger, at once: a long backlog must not hold up a tick [1]."""

BATCH_RECORDS = 256
BATCH_BYTES = 65_536

MARGIN = 4096
"""Records are spilled this many before the ring drops them, at most a quarter of the ring [1]."""

FULL_SHARE = 0.8
"""Share of the ring, filled with records that are stored nowhere else, at which a trial stops if the spill accepts none
[1]."""


class RecordStore:
    """Keeps records until a logger has them on disk."""

    def __init__(self, capacity: int, spill: Spill, welcome: Welcome, news: News) -> None:
        self.ring = LogRing(capacity)  # the newest records
        self.needed = False  # whether a logger has brought any record to disk, or a trial that needs one has started
        self._spill, self._news = spill, news
        self._welcomes = [(0, welcome)]
        self._margin = min(MARGIN, capacity // 4)
        self._reported_loss = self._cause = self._spill_trouble = ""

    @property
    def backlog(self) -> int:
        """Number of records not yet acknowledged as safely on disk."""
        return self.ring.next - self.ring.acknowledged

    @property
    def spilled_to(self) -> str:
        """The spill's file if it holds records that no logger has on disk, or an empty string."""
        return str(self._spill.path) if self._spill.next > self.ring.acknowledged else ""

    @property
    def behind(self) -> bool:
        """Whether a trial must stop, because only the ring holds too many records."""
        full = FULL_SHARE * self.ring.capacity if self._refusal else self.ring.capacity - self._margin // 2
        return self.ring.next - self._first_unstored > full

    @property
    def closed(self) -> bool:
        """Whether the spill has finished."""
        return self._spill.closed

    @property
    def shortfall(self) -> str:
        """Records not known to be on a logger's disk, and where they are; empty if none. Valid once `closed`."""
        if self.backlog == 0:
            return ""
        sentence = f"{self.backlog} records may not be on disk: no logger confirmed them"
        spilled = self._spill.held
        if not spilled:
            return sentence + (f"; {self._spill.trouble}" if self._spill.trouble else "")
        return f"{sentence}; {spilled} records are in {self._spill.path}: netboard recover makes a recording of it"

    def begin_block(self, welcome: Welcome) -> None:
        """Begin a block with the next record."""
        self._welcomes.append((self.ring.next, welcome))

    def welcome(self) -> Welcome:
        """Return the configuration of the first record that no logger has on disk, where a logger begins."""
        while len(self._welcomes) > 1 and self._welcomes[1][0] <= self.ring.acknowledged:
            del self._welcomes[0]
        return self.welcome_of(self.ring.acknowledged)

    def welcome_of(self, record: int) -> Welcome:
        """Return the configuration of the block to which a record belongs."""
        return next(welcome for first, welcome in reversed(self._welcomes) if first <= record)

    def batch(self, cursor: int) -> LogBatch | None:
        """Make the next batch for a logger; None while it is being read from the spill."""
        if cursor < self.ring.first and cursor < self._spill.next:
            return self._spill.batch(cursor)
        return self.ring.batch(cursor, BATCH_RECORDS, BATCH_BYTES)

    def acknowledge(self, durable: int) -> None:
        """Forget the records that a logger has on disk, up to this one."""
        self.needed = True
        if self.ring.acknowledge(durable) and self._spill.next:
            self._spill.forget(self.ring.acknowledged)
            if not self._spill.next:
                self._news.append(("log_spill_taken", {}))

    def spill(self) -> None:
        """Spill the records that will soon leave the ring, and report what is lost."""
        ring, spill = self.ring, self._spill
        for _ in range(BATCHES):
            if ring.next - self._first_unstored <= ring.capacity - self._margin or self._refusal:
                break
            if not spill.next:
                spill.introduce(self.welcome_of(self._first_unstored))
                self._news.append(("log_spilling", {"file": str(spill.path)}))
            spill.put(ring.batch(self._first_unstored, BATCH_RECORDS, BATCH_BYTES))
        if spill.trouble != self._spill_trouble:
            self._spill_trouble = spill.trouble
            if self._spill_trouble:
                self._news.append(("log_spill_failed", {"reason": self._spill_trouble}))
        self._watch_losses()

    def report_lost(self, first: int, count: int) -> None:
        """Report records that a logger cannot be given, with the cause."""
        acknowledged = first + count <= self.ring.acknowledged
        cause = "another logger has written them to disk" if acknowledged else self._cause or self._spill.trouble
        self._news.append(("log_lost", {"first": str(first), "count": str(count), "cause": cause}))

    def close(self) -> None:
        """Spill the records that no logger has on disk; `closed` says when that is done."""
        self._spill.close(self._unstored_batches() if self.backlog and self.needed else None)

    @property
    def _first_unstored(self) -> int:
        """Number of the first record that is neither on a logger's disk nor in the spill."""
        return max(self.ring.acknowledged, self._spill.next)

    @property
    def _refusal(self) -> str:
        """Why the spill takes nothing now; empty if it does."""
        return self._spill.refusal if self.needed else "no logger was connected yet"

    def _watch_losses(self) -> None:
        """Report why the ring drops records that are nowhere else."""
        losing = (self._refusal or "the disk is too slow") if self.ring.first > self._first_unstored else ""
        if losing and losing != self._reported_loss:
            self._cause = losing
            if self.needed:
                self._news.append(("log_losing", {"first": str(self._first_unstored), "cause": losing}))
        self._reported_loss = losing

    def _unstored_batches(self) -> Iterator[LogBatch]:
        """Yield all records that are neither on a logger's disk nor in the spill."""
        while (first := self._first_unstored) < self.ring.next:
            yield self.ring.batch(first, BATCH_RECORDS, BATCH_BYTES)
