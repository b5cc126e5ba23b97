"""How long records wait until they are on a logger's disk: what a power cut at that moment would lose.

A logger reports which records are on its disk, not when they were made. So the server notes now and then which record
comes next, and takes the time of the oldest of these notes that the logger has not reported yet.
"""

from collections import deque

MARK_NS = 20_000_000
"""Shortest interval between two notes [ns]."""

MOST_MARKS = 1024
"""Notes that are kept for a logger that reports nothing; then every second one is dropped [1]."""

RECENT_NS = 5_000_000_000
"""Time for which the longest wait counts: a slow disk is late at intervals [ns]."""


class SyncAge:
    """The waits of the records for one logger."""

    def __init__(self) -> None:
        self._following = 0
        self._marks: deque[tuple[int, int]] = deque()  # number of the next record, and when it was noted [ns]
        self._waits: deque[tuple[int, int]] = deque()  # when records came to disk, and how long the oldest waited [ns]

    def note(self, following: int, now_ns: int) -> None:
        """Note the number of the next record, which has not been made yet."""
        marks = self._marks
        self._following = following
        if marks and marks[-1][0] == following:
            marks[-1] = following, now_ns
        elif not marks or now_ns - marks[-1][1] >= MARK_NS:
            if len(marks) >= MOST_MARKS:
                self._marks = marks = deque(mark for k, mark in enumerate(marks) if not k % 2)
            marks.append((following, now_ns))

    def durable(self, before: int, now_ns: int) -> None:
        """Note that all records before this number are on disk."""
        oldest = None
        while self._marks and self._marks[0][0] < before:
            _, noted_ns = self._marks.popleft()
            oldest = noted_ns if oldest is None else oldest
        if oldest is not None:
            self._waits.append((now_ns, now_ns - oldest))

    def longest(self, now_ns: int) -> float:
        """Return the longest wait of a record of late, on disk by now or not [s]."""
        while self._waits and now_ns - self._waits[0][0] > RECENT_NS:
            self._waits.popleft()
        is_waiting = self._marks and self._marks[0][0] < self._following
        waiting_ns = now_ns - self._marks[0][1] if is_waiting else 0
        return max(waiting_ns, *(wait_ns for _, wait_ns in self._waits), 0) * 1e-9
