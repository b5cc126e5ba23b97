"""Deadlines: the earliest time of a tick, the number of due ticks, and skipped ticks after a stall."""

import pytest

from netboard.base.clock import CATCH_UP_TICKS
from netboard.base.tick import TICK_NS
from netboard.nodes.server.tick_clock import EARLIEST_NS, IDLE_TICKS, LATE_NS, NO_PEER_TICKS, TickClock

DUE = 5_000_000_000


@pytest.fixture
def clock() -> TickClock:
    clock = TickClock()
    clock.begin(DUE)
    return clock


def test_first_tick_is_due_at_the_start_time(clock: TickClock) -> None:
    assert (clock.due_ns, clock.wake_ns, clock.gap) == (DUE, DUE, "")


def test_tick_starts_early_only_with_both_samples(clock: TickClock) -> None:
    early = DUE - EARLIEST_NS
    assert clock.is_due(DUE, complete=False)
    assert not clock.is_due(DUE - 1, complete=False)
    assert clock.is_due(early, complete=True)
    assert not clock.is_due(early - 1, complete=True)


def test_deadline_advances_by_one_tick_per_tick(clock: TickClock) -> None:
    clock.advance(1)
    assert clock.due_ns == DUE + TICK_NS
    clock.advance(IDLE_TICKS)
    assert clock.due_ns == DUE + (1 + IDLE_TICKS) * TICK_NS


@pytest.mark.parametrize(("late", "due"), [(-1, 0), (0, 1), (TICK_NS - 1, 1), (TICK_NS, 2), (24 * TICK_NS, 25)])
def test_due_ticks_are_counted(clock: TickClock, late: int, due: int) -> None:
    assert clock.due_count(DUE + late) == due


def test_ticks_beyond_the_late_threshold_are_counted(clock: TickClock) -> None:
    for late in (-LATE_NS, 0, LATE_NS, LATE_NS + 1, 3 * TICK_NS):
        clock.began(late)
    assert clock.late_ticks == 2


@pytest.mark.parametrize(("idle", "most"), [(False, CATCH_UP_TICKS), (True, CATCH_UP_TICKS + NO_PEER_TICKS)])
def test_stall_shifts_deadlines_by_whole_ticks_and_is_reported_once(clock: TickClock, *, idle: bool, most: int) -> None:
    assert clock.skip_backlog(DUE + most * TICK_NS, idle) == 0
    assert (clock.due_ns, clock.gap) == (DUE, "")
    moved = clock.skip_backlog(DUE + most * TICK_NS + 1, idle)
    assert moved == most * TICK_NS
    assert clock.due_ns == DUE + moved
    assert clock.take_gap() == f"the server stalled for {most} ms"
    assert clock.take_gap() == clock.gap == ""


def test_wake_time_depends_on_idleness_and_samples(clock: TickClock) -> None:
    clock.sleep(idle=False, complete=False)
    assert clock.wake_ns == DUE
    clock.sleep(idle=False, complete=True)
    assert clock.wake_ns == DUE - EARLIEST_NS
    clock.sleep(idle=True, complete=True)
    assert clock.due_count(clock.wake_ns) == IDLE_TICKS
    clock.sleep(idle=True, complete=True, alone=True)
    assert clock.due_count(clock.wake_ns) == NO_PEER_TICKS
    clock.sleep(idle=False, complete=False, alone=True)
    assert clock.wake_ns == DUE
