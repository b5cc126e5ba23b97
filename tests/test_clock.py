"""The pacer's arithmetic with a simulated clock."""

from typing import Any

import pytest

from netboard.base import clock
from netboard.base.clock import CATCH_UP_TICKS, Pacer
from netboard.base.tick import TICK_NS


class FakeTime:
    """A clock that stands still but for sleeping and for what the loop is said to take."""

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
    return fake


def test_ticks_are_due_every_millisecond_whatever_the_work_takes(time: FakeTime) -> None:
    pacer = Pacer(time.now + TICK_NS)
    start = time.now + TICK_NS
    for number in range(1000):
        assert pacer.wait() == 0
        assert pacer.due_ns == start + number * TICK_NS
        time.now += 400_000 + number
    assert pacer.moved_ns == 0


def test_a_late_tick_is_followed_by_the_next_at_its_own_time(time: FakeTime) -> None:
    pacer = Pacer(time.now)
    assert pacer.wait() == 0
    time.now += 3 * TICK_NS + 250_000
    assert [pacer.wait() for _ in range(4)] == [2_250_000, 1_250_000, 250_000, 0]


def test_a_loop_that_fell_far_behind_moves_its_deadlines_instead_of_running_a_burst(time: FakeTime) -> None:
    pacer = Pacer(time.now)
    pacer.wait()
    due = pacer.due_ns
    time.now += (CATCH_UP_TICKS + 100) * TICK_NS + 123
    assert pacer.wait() == 123
    assert pacer.moved_ns == (CATCH_UP_TICKS + 99) * TICK_NS
    assert pacer.due_ns == due + (CATCH_UP_TICKS + 100) * TICK_NS
    assert pacer.wait() == 0
    assert pacer.due_ns == due + (CATCH_UP_TICKS + 101) * TICK_NS


def test_real_time_is_real_monotonic_time() -> None:
    first = clock.now_ns()
    assert clock.now_ns() >= first
