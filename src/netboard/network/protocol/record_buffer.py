"""The lossless log: a ring of the newest records, numbered, until a logger has them on disk.

The server appends every record once. It keeps a cursor for each logger, and advances it by what it sent. A logger that
joins late, asks again or restarts moves its cursor back, as far as the ring still reaches. Records that it no longer
reaches are counted in `LogBatch.lost`, so that no loss is silent.
"""

from netboard.network.protocol.records import LogBatch


class LogRing:
    """The newest records of a session; record n is in slot n modulo the capacity.

    Attributes
    ----------
    capacity : int
        Most records that it holds [1].
    next : int
        Number of the next record, and of the records so far [1].
    acknowledged : int
        Number of the first record that no logger has on disk [1].
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"capacity is {capacity}, expected at least 1")
        self.capacity = capacity
        self._slots = [b""] * capacity
        self.next = 0
        self.acknowledged = 0

    @property
    def first(self) -> int:
        """Number of the oldest record in the ring [1]."""
        return max(0, self.next - self.capacity)

    def append(self, record: bytes) -> int:
        """Append a record, in place of the oldest one if the ring is full, and return its number [1].

        Parameters
        ----------
        record : bytes
            An encoded record message.
        """
        number = self.next
        self._slots[number % self.capacity] = record
        self.next = number + 1
        return number

    def start(self, first: int) -> int:
        """Return the cursor of a logger that asks for records.

        Parameters
        ----------
        first : int
            `LogRequest.first`: a number, or -1 for the first record that no logger has acknowledged [1].

        Returns
        -------
        int
            Number of the first record to send, whether still in the ring or not; at most that of the next record [1].
        """
        return self.acknowledged if first < 0 else min(first, self.next)

    def batch(self, cursor: int, most_records: int, most_bytes: int) -> LogBatch:
        """Make the next batch for a logger, empty if it has everything.

        Parameters
        ----------
        cursor : int
            Number of the first record it has not been sent [1].
        most_records : int
            Most records of the batch [1].
        most_bytes : int
            Most bytes of its records together; the first is sent whatever its size [1].

        Returns
        -------
        LogBatch
            Moves the logger's cursor on to ``first + len(records)``.
        """
        first = max(cursor, self.first)
        records: list[bytes] = []
        room = most_bytes
        for number in range(first, min(self.next, first + most_records)):
            record = self._slots[number % self.capacity]
            room -= len(record)
            if room < 0 and records:
                break
            records.append(record)
        return LogBatch(first, first - cursor, tuple(records))

    def acknowledge(self, durable: int) -> bool:
        """Note that all records before one are on disk; an older acknowledgement changes nothing.

        Parameters
        ----------
        durable : int
            `LogAck.durable` [1].

        Returns
        -------
        bool
            False if there are no such records yet; then nothing is acknowledged.
        """
        if durable > self.next:
            return False
        self.acknowledged = max(self.acknowledged, durable)
        return True
