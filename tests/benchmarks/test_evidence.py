"""Measurements on traces of device forces, with synthetic forces."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.tick import TICK
from netboard.benchmarks.faults.devices import TRACE
from netboard.benchmarks.faults.evidence import (
    between,
    fades,
    largest_step,
    pauses,
    pauses_between,
    steps_to_nothing,
    without_cut,
)
from netboard.network.protocol.records import EventRecord
from netboard.task.trials.state_machine import Cause, Phase

MS = 1_000_000
SLEW = 500.0


def trace_of(force: Callable[[int], float], milliseconds: int, start_ns: int = 1000 * MS) -> NDArray:
    """A force for each millisecond."""
    trace = np.zeros(milliseconds, TRACE)
    trace["time_ns"] = start_ns + MS * np.arange(milliseconds)
    trace["fz"] = [force(k) for k in range(milliseconds)]
    return trace


def renewed(k: int) -> float:
    """A force that is never the same twice."""
    return 1.0 + 0.01 * np.sin(k)


def faded(k: int, last: int = 20, held: int = 10, fade: int = 50) -> float:
    """A force renewed up to a millisecond, held for some, then faded to zero."""
    if k <= last:
        return renewed(k)
    return renewed(last) * max(0.0, 1.0 - max(0, k - last - held) / fade)


def test_a_force_that_is_renewed_does_not_fade() -> None:
    assert fades(trace_of(renewed, 100), 5 * MS) == []


def test_a_fade_is_timed_from_the_last_fresh_force() -> None:
    (fade,) = fades(trace_of(faded, 100), 5 * MS)
    assert fade.last_ns == 1020 * MS
    assert fade.force == pytest.approx(renewed(20))
    assert fade.held == pytest.approx(0.010)
    assert fade.begun == pytest.approx(0.011)
    assert fade.zero == pytest.approx(0.060)
    assert fade.held_up == 0.0


def test_a_force_that_is_renewed_before_it_is_zero_is_not_zero() -> None:
    (fade,) = fades(trace_of(lambda k: faded(k) if k < 40 else renewed(k), 100), 5 * MS)
    assert fade.begun == pytest.approx(0.011)
    assert np.isnan(fade.zero)
    assert "not zero soon" in str(fade)


def test_no_force_is_no_force_that_is_not_renewed() -> None:
    assert fades(trace_of(lambda k: 0.0, 100), 5 * MS) == []


def test_time_for_which_the_machine_held_the_agent_up_is_told() -> None:
    trace = np.delete(trace_of(faded, 100), slice(40, 55))
    fade, gap = fades(trace, 5 * MS)
    assert gap.held == 0.0
    assert fade.held_up == pytest.approx(0.015)


def test_a_step_within_the_slew_limit_is_within_it() -> None:
    trace = trace_of(lambda k: 0.4 * k, 5)
    step = largest_step(trace, SLEW)
    assert step.size == pytest.approx(0.4)
    assert step.share == pytest.approx(0.4)


def test_a_step_beyond_the_slew_limit_is_found_where_it_is() -> None:
    trace = trace_of(lambda k: 0.0 if k < 5 else 1.5, 10)
    step = largest_step(trace, SLEW)
    assert (step.at_ns, step.size) == (1005 * MS, 1.5)
    assert step.share == pytest.approx(1.5)


def test_a_late_step_is_allowed_no_more_than_one_of_two_milliseconds() -> None:
    trace = trace_of(lambda k: 0.0 if k < 5 else 1.5, 10)
    trace["time_ns"][5:] += 100 * MS
    assert largest_step(trace, SLEW).share == pytest.approx(1.5)


def test_all_axes_count_in_a_step() -> None:
    trace = trace_of(lambda k: 0.0, 4)
    trace["fx"][3], trace["fy"][3] = 0.6, 0.8
    assert largest_step(trace, SLEW).size == pytest.approx(1.0)


def test_too_few_forces_make_no_step() -> None:
    assert largest_step(trace_of(renewed, 2), SLEW).share == 0.0


def test_a_cut_to_nothing_is_told_from_a_way_down() -> None:
    down = trace_of(lambda k: max(0.0, 2.0 - 0.4 * k), 10)
    cut = trace_of(lambda k: 2.0 if k < 5 else 0.0, 10)
    assert steps_to_nothing(down, SLEW) == []
    assert [step.at_ns for step in steps_to_nothing(cut, SLEW)] == [1005 * MS]
    parts = without_cut(cut, SLEW)
    assert [part.size for part in parts] == [5, 5]
    assert max(largest_step(part, SLEW).share for part in parts) == 0.0


def test_pauses_of_a_loop_are_found() -> None:
    times = MS * np.array([0, 1, 2, 40, 41, 100], np.int64)
    assert (pauses_between(times) // MS).tolist() == [[2, 40], [41, 100]]
    assert pauses_between(times[:3]).size == 0


def test_what_lies_between_two_times_is_cut_out() -> None:
    trace = trace_of(renewed, 10)
    assert between(trace, 1002 * MS, 1005 * MS)["time_ns"].tolist() == [1002 * MS, 1003 * MS, 1004 * MS]


def ticks_of(phases: list[tuple[Phase, int, int]]) -> NDArray:
    ticks = np.zeros(len(phases), TICK)
    ticks["tick"] = np.arange(len(phases))
    ticks["time_ns"] = MS * np.arange(len(phases))
    ticks["phase"], ticks["trial"], ticks["attempt"] = np.array(phases).T
    return ticks


def fault(tick: int, why: str) -> EventRecord:
    return EventRecord(0, tick, 0, "fault", {"notice": why})


def test_a_pause_has_its_reason_and_what_came_next() -> None:
    ticks = ticks_of([(Phase.RUNNING, 3, 1), (Phase.RUNNING, 3, 1), (Phase.PAUSED, 3, 1), (Phase.LEVELLING, 3, 2)])
    ticks["event"][1] = Cause.FAULT
    (pause,) = pauses(ticks, [fault(1, "paused: nobody there")])
    assert (pause.at_ns, pause.why) == (MS, "paused: nobody there")
    assert (pause.trial, pause.attempt, pause.again) == (3, 1, (3, 2))
    assert pause.repeated


def test_a_trial_that_is_not_repeated_is_told() -> None:
    ticks = ticks_of([(Phase.RUNNING, 3, 1), (Phase.PAUSED, 3, 1), (Phase.LEVELLING, 4, 1)])
    ticks["event"][0] = Cause.FAULT
    assert not pauses(ticks, [fault(0, "why")])[0].repeated
    assert pauses(ticks[:2], [])[0].again is None
