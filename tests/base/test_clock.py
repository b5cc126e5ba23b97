"""The pacer's arithmetic with a simulated clock."""

from typing import Any

import pytest

from netboard.base import clock
from netboard.base.clock import CATCH_UP_TICKS, Pacer
from netboard.base.tick import TICK_NS


class FakeTime:
    """A simulated clock that advances only by sleeping and by the work that a test adds."""

    def __init__(self) -> None:
        self.now = 1_000_000_000

    def monotonic_ns(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.now += round(seconds * 1e9)


@pytest.fixture
def time(monkeypatch: pytest.MonkeyPatch) -> Any:
    fake = FakeTime()
    monkeypatch.setattr(clock, "time", fake)
    monkeypatch.setattr(clock, "monotonic", fake)
    return fake


def test_deadlines_are_one_millisecond_apart_for_any_workload(time: FakeTime) -> None:
    pacer = Pacer(time.now + TICK_NS)
    start = time.now + TICK_NS
    for number in range(1000):
        assert pacer.wait() == 0
        assert pacer.due_ns == start + number * TICK_NS
        time.now += 400_000 + number
    assert pacer.moved_ns == 0


def test_late_tick_does_not_shift_the_later_deadlines(time: FakeTime) -> None:
    pacer = Pacer(time.now)
    assert pacer.wait() == 0
    time.now += 3 * TICK_NS + 250_000
    assert [pacer.wait() for _ in range(4)] == [2_250_000, 1_250_000, 250_000, 0]


def test_pacer_far_behind_moves_its_deadlines_instead_of_bursting(time: FakeTime) -> None:
    pacer = Pacer(time.now)
    pacer.wait()
    due = pacer.due_ns
    time.now += (CATCH_UP_TICKS + 100) * TICK_NS + 123
    assert pacer.wait() == 123
    assert pacer.moved_ns == (CATCH_UP_TICKS + 99) * TICK_NS
    assert pacer.due_ns == due + (CATCH_UP_TICKS + 100) * TICK_NS
    assert pacer.wait() == 0
    assert pacer.due_ns == due + (CATCH_UP_TICKS + 101) * TICK_NS


def test_now_ns_is_monotonic() -> None:
    first = clock.now_ns()
    assert clock.now_ns() >= first
