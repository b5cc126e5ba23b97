"""The lossless log over a lossy link: every record arrives once and in order, or is counted as lost."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_link import Link

from netboard.network.protocol.record_buffer import LogRing
from netboard.network.protocol.records import LogBatch


def record(number: int) -> bytes:
    """Record with a unique content, of varying size."""
    return number.to_bytes(4, "big") + bytes(number % 7)


def filled(capacity: int, count: int) -> LogRing:
    ring = LogRing(capacity)
    for number in range(count):
        assert ring.append(record(number)) == number
    return ring


class Logger:
    """Minimal logger that follows PROTOCOL.md."""

    def __init__(self, first: int) -> None:
        self.next = first
        self.kept: list[tuple[int, bytes]] = []
        self.lost = 0

    def take(self, batch: LogBatch) -> bool:
        """Keep what is new; False if something is missing before it."""
        if batch.first - batch.lost > self.next:
            return False
        self.lost += max(batch.first - self.next, 0)
        self.next = max(batch.first, self.next)
        for data in batch.records[self.next - batch.first :]:
            self.kept.append((self.next, data))
            self.next += 1
        return True


def test_full_ring_keeps_the_newest_records() -> None:
    ring = filled(4, 10)
    assert (ring.first, ring.next) == (6, 10)
    assert ring.batch(6, 100, 10**6) == LogBatch(6, 0, tuple(map(record, range(6, 10))))
    assert ring.batch(2, 100, 10**6) == LogBatch(6, 4, tuple(map(record, range(6, 10))))
    assert ring.batch(10, 100, 10**6) == LogBatch(10, 0, ())


def test_empty_ring_gives_empty_batches() -> None:
    ring = LogRing(4)
    assert (ring.first, ring.next, ring.acknowledged) == (0, 0, 0)
    assert ring.batch(0, 10, 10) == LogBatch(0, 0, ())
    with pytest.raises(ValueError, match="capacity"):
        LogRing(0)


def test_batch_respects_its_limits_but_holds_at_least_one_record() -> None:
    ring = filled(100, 50)
    assert len(ring.batch(0, 7, 10**6).records) == 7
    assert ring.batch(0, 100, 9).records == (record(0), record(1))  # 4 and 5 bytes
    assert ring.batch(0, 100, 8).records == (record(0),)
    assert ring.batch(0, 100, 1).records == (record(0),)


def test_logger_starts_at_its_request_or_after_the_acknowledged_records() -> None:
    ring = filled(100, 50)
    assert ring.start(-1) == 0
    assert ring.acknowledge(20)
    assert ring.acknowledge(10)
    assert ring.acknowledged == 20
    assert not ring.acknowledge(51)
    assert (ring.start(-1), ring.start(7), ring.start(50), ring.start(99)) == (20, 7, 50, 50)


@given(st.integers(1, 20), st.integers(0, 60), st.integers(0, 60), st.integers(1, 30), st.integers(1, 200))
def test_batches_cover_kept_records_and_count_lost_ones(
    capacity: int, count: int, cursor: int, most_records: int, most_bytes: int
) -> None:
    ring = filled(capacity, count)
    asked = cursor = ring.start(cursor)
    got: list[bytes] = []
    lost = 0
    while cursor < ring.next:
        batch = ring.batch(cursor, most_records, most_bytes)
        assert 1 <= len(batch.records) <= most_records
        assert len(batch.records) == 1 or sum(map(len, batch.records)) <= most_bytes
        assert batch.first == cursor + batch.lost
        got += batch.records
        lost += batch.lost
        cursor = batch.first + len(batch.records)
    assert got == [record(number) for number in range(count - len(got), count)]
    assert lost + len(got) == count - asked


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32), st.floats(0, 0.4), st.floats(0, 0.4), st.floats(0, 0.4), st.integers(1, 60))
def test_every_record_arrives_once_in_order_or_is_counted_as_lost(
    seed: int, drop: float, repeat: float, overtake: float, capacity: int
) -> None:
    rng = random.Random(seed)
    ring = LogRing(capacity)
    down: Link[LogBatch] = Link(rng, drop, repeat, overtake)
    up: Link[int] = Link(rng, drop, repeat, overtake)
    logger = Logger(0)
    cursor = 0

    def turn(appended: int) -> None:
        nonlocal cursor
        for _ in range(appended):
            ring.append(record(ring.next))
        while (asked := up.receive()) is not None:
            cursor = ring.start(asked)
        if cursor < ring.next:
            batch = ring.batch(cursor, 5, 100)
            down.send(batch)
            cursor = batch.first + len(batch.records)
        while rng.random() < 0.7 and (batch_or_none := down.receive()) is not None:
            if not logger.take(batch_or_none):
                up.send(logger.next)

    for _ in range(100):
        turn(rng.randrange(6))
    turns = 0
    while logger.next < ring.next:
        turn(0)
        if cursor == ring.next and turns % 10 == 9:  # all was sent and something is missing: the logger asks again
            up.send(logger.next)
        turns += 1
        assert turns < 10_000
    numbers = [number for number, _ in logger.kept]
    assert numbers == sorted(set(numbers))
    assert all(data == record(number) for number, data in logger.kept)
    assert len(numbers) + logger.lost == ring.next


@given(st.integers(1, 50), st.integers(0, 50), st.integers(0, 40))
def test_new_logger_resumes_after_the_acknowledged_records(capacity: int, before: int, while_away: int) -> None:
    ring = filled(capacity, before)
    first = Logger(ring.start(-1))
    while first.next < ring.next:
        assert first.take(ring.batch(first.next, 10, 1000))
    assert ring.acknowledge(first.next)
    for _ in range(while_away):
        ring.append(record(ring.next))
    second = Logger(ring.start(-1))
    while second.next < ring.next:
        assert second.take(ring.batch(second.next, 10, 1000))
    assert second.lost == max(while_away - capacity, 0)
    assert [number for number, _ in second.kept] == list(range(before + second.lost, before + while_away))
