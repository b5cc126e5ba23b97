"""Deadlines: when a tick may be done, how many are due, and what becomes of them after a standstill."""

import pytest

from netboard.base.tick import TICK_NS
from netboard.nodes.server.tick_clock import CATCH_UP_TICKS, EARLIEST_NS, IDLE_TICKS, LATE_NS, Pace

DUE = 5_000_000_000


@pytest.fixture
def pace() -> Pace:
    pace = Pace()
    pace.begin(DUE)
    return pace


def test_the_first_tick_is_due_when_it_was_said_to_be(pace: Pace) -> None:
    assert (pace.due_ns, pace.wake_ns, pace.gap) == (DUE, DUE, "")


def test_a_tick_waits_for_its_deadline_unless_both_samples_are_in(pace: Pace) -> None:
    early = DUE - EARLIEST_NS
    assert pace.is_time(DUE, complete=False)
    assert not pace.is_time(DUE - 1, complete=False)
    assert pace.is_time(early, complete=True)
    assert not pace.is_time(early - 1, complete=True)


def test_the_next_deadline_is_a_tick_later(pace: Pace) -> None:
    pace.did(1)
    assert pace.due_ns == DUE + TICK_NS
    pace.did(IDLE_TICKS)
    assert pace.due_ns == DUE + (1 + IDLE_TICKS) * TICK_NS


@pytest.mark.parametrize(("late", "due"), [(-1, 0), (0, 1), (TICK_NS - 1, 1), (TICK_NS, 2), (24 * TICK_NS, 25)])
def test_what_has_become_due_is_counted(pace: Pace, late: int, due: int) -> None:
    assert pace.how_many(DUE + late) == due


def test_late_is_more_than_half_a_tick(pace: Pace) -> None:
    for late in (-LATE_NS, 0, LATE_NS, LATE_NS + 1, 3 * TICK_NS):
        pace.began(late)
    assert pace.late_ticks == 2


@pytest.mark.parametrize(("idle", "most"), [(False, CATCH_UP_TICKS), (True, CATCH_UP_TICKS + IDLE_TICKS)])
def test_a_standstill_moves_the_deadlines_by_whole_ticks_and_is_told_of_once(
    pace: Pace, *, idle: bool, most: int
) -> None:
    assert pace.catch_up(DUE + most * TICK_NS, idle) == 0
    assert (pace.due_ns, pace.gap) == (DUE, "")
    moved = pace.catch_up(DUE + most * TICK_NS + 1, idle)
    assert moved == most * TICK_NS
    assert pace.due_ns == DUE + moved
    assert pace.take_gap() == f"the server stood still for {most} ms"
    assert pace.take_gap() == pace.gap == ""


def test_one_sleeps_until_there_may_be_something_to_do(pace: Pace) -> None:
    pace.sleep(idle=False, complete=False)
    assert pace.wake_ns == DUE
    pace.sleep(idle=False, complete=True)
    assert pace.wake_ns == DUE - EARLIEST_NS
    pace.sleep(idle=True, complete=True)
    assert pace.how_many(pace.wake_ns) == IDLE_TICKS
