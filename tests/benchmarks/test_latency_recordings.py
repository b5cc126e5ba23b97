"""Latencies and deadline misses read from synthetic recordings."""

import numpy as np
import pytest

from netboard.base.config import SIDES
from netboard.base.tick import TICK, TICK_NS
from netboard.benchmarks.loop.timing import REST, UPLINK, WAIT, LoopTiming, TickTiming, loop_timing, within
from netboard.recording.timing.stamps import COLUMNS, stamps_from
from netboard.task.trials.state_machine import Phase

COUNT = 100
UP_NS, LEAD_NS, EARLY_NS = 80_000, 300_000, 270_000
LOOP_NS = 200_000


@pytest.fixture
def ticks() -> np.ndarray:
    """Ticks that begin as soon as a sample arrives, and whose force is rendered before the next sample."""
    rows = np.zeros(COUNT, TICK)
    number = np.arange(COUNT)
    rows["tick"], rows["time_ns"], rows["late_ns"] = number, (number + 1) * TICK_NS, -EARLY_NS
    rows["phase"] = Phase.RUNNING
    for side in SIDES:
        rows[f"{side}_seq"] = number
        rows[f"{side}_lead_ns"] = LEAD_NS
        rows[f"{side}_stamp_ns"] = rows["time_ns"] - LEAD_NS - UP_NS - number % 2  # a clock is never exact
        rows[f"{side}_loop_ns"][1:] = LOOP_NS + number[:-1]  # reported with the next sample, each slightly longer
    return rows


def whole(rows: np.ndarray) -> list[tuple[int, int]]:
    return [(int(rows["time_ns"][0]), int(rows["time_ns"][-1]) + 1)]


def played_in(rows: np.ndarray, times: list[tuple[int, int]]) -> LoopTiming:
    return loop_timing(stamps_from({name: rows[name] for name in COLUMNS}), times)


def test_every_loop_is_counted_once(ticks: np.ndarray) -> None:
    found = played_in(ticks, whole(ticks))
    for side in SIDES:
        assert found.latency_ns[side].tolist() == [LOOP_NS + number for number in range(COUNT - 1)]
    assert found.answered == pytest.approx((COUNT - 1) / COUNT)


def test_loop_time_is_the_sum_of_its_parts(ticks: np.ndarray) -> None:
    found = played_in(ticks, whole(ticks)).parts_ns
    assert set(found[UPLINK]) == {UP_NS, UP_NS + 1}
    assert set(found[WAIT]) == {LEAD_NS - EARLY_NS}
    assert (found[UPLINK] + found[WAIT] + found[REST]).tolist() == 2 * [LOOP_NS + number for number in range(COUNT - 1)]


def test_only_loops_reported_by_the_next_sample_are_split_into_parts(ticks: np.ndarray) -> None:
    ticks["left_seq"][50:] += 1  # one was lost
    assert played_in(ticks, whole(ticks)).parts_ns[UPLINK].size == 2 * (COUNT - 1) - 1


def test_repeated_loop_time_is_not_counted_again(ticks: np.ndarray) -> None:
    ticks["left_loop_ns"][20:30] = ticks["left_loop_ns"][19]
    assert played_in(ticks, whole(ticks)).latency_ns["left"].size == COUNT - 1 - 10


def test_ticks_outside_the_intervals_or_paused_are_left_out(ticks: np.ndarray) -> None:
    ticks["phase"][30:40] = Phase.PAUSED
    times = [(int(ticks["time_ns"][10]), int(ticks["time_ns"][20])), (int(ticks["time_ns"][30]), 2**62)]
    found = played_in(ticks, times)
    assert found.latency_ns["left"].size == 10 + 60
    assert found.ticks.ticks == 10 + 70


def test_intervals_are_half_open() -> None:
    assert within(np.arange(10), [(2, 4), (7, 8)]).nonzero()[0].tolist() == [2, 3, 7]


def test_late_and_missed_ticks_are_counted() -> None:
    late_ns = np.array([-300_000, 0, 400_000, 600_000, 1_100_000, 5_000_000])
    found = TickTiming(late_ns, 3)
    assert (found.ticks, found.late, found.missed) == (6, 3, 2 + 3)
    assert found.missed_of(600) == 500


def test_missing_ticks_within_an_interval_are_missed(ticks: np.ndarray) -> None:
    ticks["time_ns"][60:] += 7 * TICK_NS
    ticks["time_ns"][80:] += 1000 * TICK_NS  # a gap between two measured intervals
    ends = ticks["time_ns"]
    times = [(int(ends[0]), int(ends[79]) + 1), (int(ends[80]), int(ends[-1]) + 1)]
    assert played_in(ticks, times).ticks.missed == 7
