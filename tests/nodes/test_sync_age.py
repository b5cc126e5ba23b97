"""How long records wait until they are on disk."""

import pytest

from netboard.nodes.ports.sync_age import MARK_NS, MOST_MARKS, RECENT_NS, SyncAge

MS = 1_000_000


def run(age: SyncAge, sync_ms: int, flush_ms: int = 400, seconds: float = 4.0, first_ms: int = 0) -> float:
    """Make a record each millisecond, on a disk that syncs every `flush_ms` in `sync_ms`; return the longest wait."""
    began, pending, longest = -flush_ms, None, 0.0
    for now in range(first_ms, first_ms + round(seconds * 1e3)):
        if pending is None and now - began >= flush_ms:
            began, pending = now, now
        if pending is not None and now - began >= sync_ms:
            age.durable(pending, now * MS)
            pending = None
        age.note(now, now * MS)
        longest = max(longest, age.longest(now * MS))
    return longest


@pytest.mark.parametrize(("sync_ms", "expected"), [(5, 0.405), (300, 0.7), (1000, 2.0), (3000, 6.0)])
def test_wait_is_that_of_the_oldest_record_on_a_disk_that_takes_its_time(sync_ms: int, expected: float) -> None:
    assert run(SyncAge(), sync_ms, seconds=20) == pytest.approx(expected, abs=2 * MARK_NS * 1e-9)


def test_longest_wait_counts_for_some_seconds() -> None:
    age = SyncAge()
    run(age, 1000)
    assert run(age, 5, first_ms=4000, seconds=1.0) > 1.5
    assert run(age, 5, first_ms=5000, seconds=3.0) > 1.5
    run(age, 5, first_ms=8000, seconds=RECENT_NS * 1e-9)
    assert age.longest(13_000 * MS) < 0.5


def test_nothing_waits_while_no_record_is_made() -> None:
    age = SyncAge()
    for now in range(0, 60_000, 100):
        age.note(7, now * MS)
        assert age.longest(now * MS) == 0.0
    age.note(8, 60_000 * MS)
    assert age.longest(60_100 * MS) == pytest.approx(0.2)
    age.durable(8, 60_200 * MS)
    assert age.longest(60_200 * MS) == pytest.approx(0.3)


def test_logger_that_never_reports_costs_no_memory() -> None:
    age = SyncAge()
    for now in range(0, 3_600_000, 20):
        age.note(now, now * MS)
    assert len(age._marks) <= MOST_MARKS
    assert age.longest(3_600_000 * MS) == pytest.approx(3600)
