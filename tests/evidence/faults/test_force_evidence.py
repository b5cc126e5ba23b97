"""Fades, steps and pauses measured on synthetic traces of device forces."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from evidence.faults.devices import TRACE
from evidence.faults.evidence import (
    between,
    cuts_to_zero,
    fades,
    pauses,
    stalls_in,
    step_shares,
)
from netboard.base.tick import TICK
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


def updated_force(k: int) -> float:
    """A force that changes every millisecond."""
    return 1.0 + 0.01 * np.sin(k)


def fading_force(k: int, last: int = 20, held: int = 10, fade: int = 50) -> float:
    """A force updated up to millisecond `last`, held, then faded to zero."""
    if k <= last:
        return updated_force(k)
    return updated_force(last) * max(0.0, 1.0 - max(0, k - last - held) / fade)


def test_updated_force_has_no_fade() -> None:
    assert fades(trace_of(updated_force, 100), 5 * MS) == []


def test_fade_is_timed_from_the_last_updated_force() -> None:
    (fade,) = fades(trace_of(fading_force, 100), 5 * MS)
    assert fade.last_ns == 1020 * MS
    assert fade.force == pytest.approx(updated_force(20))
    assert fade.held == pytest.approx(0.010)
    assert fade.begun == pytest.approx(0.011)
    assert fade.zero == pytest.approx(0.060)
    assert fade.stalled == 0.0


def test_force_updated_before_zero_has_no_time_of_zero() -> None:
    (fade,) = fades(trace_of(lambda k: fading_force(k) if k < 40 else updated_force(k), 100), 5 * MS)
    assert fade.begun == pytest.approx(0.011)
    assert np.isnan(fade.zero)
    assert "not zero soon" in str(fade)


def test_zero_force_has_no_fade() -> None:
    assert fades(trace_of(lambda k: 0.0, 100), 5 * MS) == []


def test_stall_of_the_agent_is_reported_with_the_fade() -> None:
    trace = np.delete(trace_of(fading_force, 100), slice(40, 55))
    fade, gap = fades(trace, 5 * MS)
    assert gap.held == 0.0
    assert fade.stalled == pytest.approx(0.015)


def test_step_within_the_slew_limit_has_share_below_1() -> None:
    trace = trace_of(lambda k: 0.4 * k, 5)
    assert step_shares(trace, SLEW) == pytest.approx([0.0, 0.0, 0.4, 0.4, 0.4])


def test_step_beyond_the_slew_limit_is_located() -> None:
    trace = trace_of(lambda k: 0.0 if k < 5 else 1.5, 10)
    shares = step_shares(trace, SLEW)
    assert shares.nonzero()[0].tolist() == [5]
    assert shares[5] == pytest.approx(1.5)


def test_late_step_is_allowed_at_most_two_milliseconds_of_slew() -> None:
    trace = trace_of(lambda k: 0.0 if k < 5 else 1.5, 10)
    trace["time_ns"][5:] += 100 * MS
    assert step_shares(trace, SLEW).max() == pytest.approx(1.5)


def test_step_size_combines_all_axes() -> None:
    trace = trace_of(lambda k: 0.0, 4)
    trace["fx"][3], trace["fy"][3] = 0.6, 0.8
    assert step_shares(trace, SLEW)[3] == pytest.approx(1.0)


def test_two_forces_give_no_step() -> None:
    assert step_shares(trace_of(updated_force, 2), SLEW).tolist() == [0.0, 0.0]
    assert step_shares(trace_of(updated_force, 0), SLEW).size == 0


def test_cut_to_zero_is_distinguished_from_a_ramp_down() -> None:
    down = trace_of(lambda k: max(0.0, 2.0 - 0.4 * k), 10)
    cut = trace_of(lambda k: 2.0 if k < 5 else 0.0, 10)
    assert cuts_to_zero(down, SLEW).size == 0
    assert cuts_to_zero(cut, SLEW).tolist() == [5]


def test_long_gaps_of_a_loop_are_found() -> None:
    times = MS * np.array([0, 1, 2, 40, 41, 100], np.int64)
    assert (stalls_in(times) // MS).tolist() == [[2, 40], [41, 100]]
    assert stalls_in(times[:3]).size == 0


def test_between_returns_samples_of_a_half_open_interval() -> None:
    trace = trace_of(updated_force, 10)
    assert between(trace, 1002 * MS, 1005 * MS)["time_ns"].tolist() == [1002 * MS, 1003 * MS, 1004 * MS]


def ticks_of(phases: list[tuple[Phase, int, int]]) -> NDArray:
    ticks = np.zeros(len(phases), TICK)
    ticks["tick"] = np.arange(len(phases))
    ticks["time_ns"] = MS * np.arange(len(phases))
    ticks["phase"], ticks["trial"], ticks["attempt"] = np.array(phases).T
    return ticks


def fault(tick: int, reason: str) -> EventRecord:
    return EventRecord(0, tick, 0, "fault", {"notice": reason})


def test_pause_has_its_reason_and_the_next_trial() -> None:
    ticks = ticks_of([(Phase.RUNNING, 3, 1), (Phase.RUNNING, 3, 1), (Phase.PAUSED, 3, 1), (Phase.LEVELLING, 3, 2)])
    ticks["event"][1] = Cause.FAULT
    (pause,) = pauses(ticks, [fault(1, "paused: nobody there")])
    assert (pause.at_ns, pause.reason) == (MS, "paused: nobody there")
    assert (pause.trial, pause.attempt, pause.next_attempt) == (3, 1, (3, 2))
    assert pause.repeated


def test_unrepeated_trial_is_reported() -> None:
    ticks = ticks_of([(Phase.RUNNING, 3, 1), (Phase.PAUSED, 3, 1), (Phase.LEVELLING, 4, 1)])
    ticks["event"][0] = Cause.FAULT
    assert not pauses(ticks, [fault(0, "why")])[0].repeated
    assert pauses(ticks[:2], [])[0].next_attempt is None
