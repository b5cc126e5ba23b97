"""The summary of streams with known numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netboard.base.config import parse
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord
from netboard.recording.format.summary import Gap, find_attempts, find_gaps, spread, summarise, with_emergency_stops
from netboard.recording.integrity.trial_check import _wrong_list
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause, Phase


def ticks(count: int) -> np.ndarray:
    rows = np.zeros(count, TICK)
    rows["tick"] = np.arange(count)
    rows["trial"] = rows["attempt"] = 1
    for side in ("left", "right"):
        rows[f"{side}_live"] = 1
        rows[f"{side}_seq"] = np.arange(count)
    return rows


@given(st.sets(st.integers(0, 60), min_size=1))
def test_gaps_are_exactly_the_missing_numbers(present: set[int]) -> None:
    gaps = find_gaps(np.array(sorted(present, reverse=True), np.int64))
    missing = {number for gap in gaps for number in range(gap.first, gap.first + gap.count)}
    assert missing == set(range(min(present), max(present))) - present


def test_percentiles_of_a_known_distribution() -> None:
    found = spread(np.arange(1001) * 1_000_000)
    assert (found.count, found.p50, found.p99, found.largest) == pytest.approx((1001, 0.5, 0.99, 1.0))
    assert found.p999 == pytest.approx(0.999)
    assert math.isnan(spread(np.empty(0, np.int64)).p50)


def test_emergency_stop_is_told_from_another_fault_by_the_events() -> None:
    rows = ticks(60)
    for first, attempt in ((10, 1), (40, 2)):
        rows["phase"][first : first + 10] = Phase.RUNNING
        rows["attempt"][first - 3 :] = attempt
        rows["event"][first + 9] = Cause.FAULT
    details = {"trial": "1", "attempt": "2", "outcome": "emergency_stop", "flags": ""}
    events = [EventRecord(0, 20, 0, "attempt_ended", details | {"attempt": "1", "outcome": "paused"})]
    found = with_emergency_stops(find_attempts(rows), [*events, EventRecord(1, 50, 0, "attempt_ended", details)])
    assert [one.outcome for one in found] == ["fault", "emergency_stop"]


def test_attempts_are_found_with_their_outcomes() -> None:
    rows = ticks(100)
    for first, last, trial, attempt, target, cause in (
        (10, 19, 1, 1, -1, Cause.FELL),
        (25, 39, 1, 2, -1, Cause.HELD),
        (45, 49, 2, 1, 1, Cause.ABORT),
        (55, 60, 2, 2, 1, Cause.TIMED_OUT),
        (70, 80, 2, 3, 1, Cause.FAULT),
        (90, 99, 2, 4, 1, Cause.NONE),
    ):
        rows["phase"][first : last + 1] = Phase.RUNNING
        rows["trial"][first - 3 :] = trial
        rows["attempt"][first - 3 :] = attempt
        rows["target"][first - 3 :] = target
        rows["event"][last] = cause
    rows["phase"][33:40] = Phase.HOLDING
    rows["mark_ticks"][33:] = 9
    found = find_attempts(rows)
    assert [(a.trial, a.attempt, a.target, a.outcome, a.tick) for a in found] == [
        (1, 1, -1, "fell", 10),
        (1, 2, -1, "success", 25),
        (2, 1, 1, "abort", 45),
        (2, 2, 1, "timed_out", 55),
        (2, 3, 1, "fault", 70),
        (2, 4, 1, "unfinished", 90),
    ]
    assert [a.duration for a in found] == pytest.approx([0.010, 0.015, 0.005, 0.006, 0.011, 0.010])
    summary = summarise(rows)
    assert summary.completions == pytest.approx((0.009,))
    assert summary.failures == 2
    # A command in the last tick of the recording ends the attempt, too.
    for cause, outcome in ((Cause.STOP, "stop"), (Cause.PAUSE, "pause"), (Cause.ENTERED, "unfinished")):
        ended = rows.copy()
        ended["event"][-1] = cause
        assert find_attempts(ended)[-1].outcome == outcome
    # A hole between two attempts does not join them.
    assert [a.tick for a in find_attempts(np.concatenate([rows[:15], rows[30:]]))][:2] == [10, 30]


def test_summary_counts_losses_deadline_misses_safeguards_and_drops() -> None:
    rows = np.delete(ticks(100), [40, 41])
    rows["late_ns"][[3, 4, 5]] = 500_000, 500_001, 2_000_000
    rows["left_loop_ns"][50:] = 1_500_000
    rows["left_loop_ns"][60:] = 2_500_000
    rows["left_loop_ns"][70:90] = 0
    rows["left_safeguards"][10:20] = Safeguard.ARMED | Safeguard.CLAMPED
    rows["left_safeguards"][15:18] |= Safeguard.SLEWED
    rows["left_rendered"][7] = -2.5
    rows["right_live"][:30] = 0
    rows["right_seq"][:30] = -1
    rows["right_seq"][90:] += 3
    clocks = [ClockRecord(k, "agent.left", 0, 10**9, 10**9 + 50, 350, 0, 0, 0.0) for k in range(3)]
    frames = [FrameRecord(k, "left", k, k, k, k // 2) for k in range(6)] + [FrameRecord(0, "right", 0, 0, 0, 4)]
    lost = EventRecord(0, -1, 0, "log_lost", {"first": "9", "count": "12"})
    summary = summarise(rows, [lost], clocks, frames, [lost])
    assert (summary.ticks, summary.duration) == (98, pytest.approx(0.1))
    assert (summary.missing, summary.missing_ticks, summary.lost_records) == ((Gap(40, 2),), 2, 12)
    assert (summary.late_ticks, summary.lateness.largest) == (2, pytest.approx(2e-3))
    assert (summary.left.loop.count, summary.left.loop.p50) == (3, pytest.approx(2.5e-3))
    assert summary.left.safeguards == {"armed": 10, "clamped": 10, "slewed": 3}
    assert summary.left.limited_ticks == 10
    assert summary.left.largest_force == 2.5
    assert (summary.right.stale_ticks, summary.right.skipped_samples) == (30, 5)
    assert summary.round_trips["agent.left"].p50 == pytest.approx(300e-9)
    assert {name: (d.frames, d.dropped) for name, d in summary.displays.items()} == {"left": (6, 2), "right": (1, 4)}
    assert summary.events == 1


def test_summary_of_an_empty_recording_is_empty() -> None:
    summary = summarise(np.empty(0, TICK))
    assert (summary.ticks, summary.duration, summary.attempts, summary.missing) == (0, 0.0, (), ())


@pytest.mark.slow
def test_summary_agrees_with_the_counts_of_the_stage() -> None:
    """A steady pair of hands plays a block with the real stage; now and then it lets the ball roll off the board."""
    config = parse("[block]\ntrials = 4\n[task]\nhold_time = 0.3\nlevel_time = 0.1\n")
    stage, state, rows = make_stage(config), None, np.zeros(60_000, TICK)
    state = stage.initial()
    tilt = 0.0
    for k, row in enumerate(rows):
        now = state[0]
        wanted = 0.0
        if now["phase"] in (Phase.RUNNING, Phase.HOLDING):
            wanted = -(3.0 * (0.15 * now["target"] - now["p"]) - 3.0 * now["vp"]) / 9.81
            if now["trial"] == 2 and now["attempt"] < 3:
                wanted = -wanted
        tilt += 0.01 * (np.clip(wanted, -0.05, 0.05) - now["theta"])
        row["tick"], row["time_ns"], row["command"] = k, k * 1_000_000, Cause.START if k == 5 else Cause.NONE
        for side, sign in (("left", -1), ("right", 1)):
            row[f"{side}_live"], row[f"{side}_seq"], row[f"{side}_stamp_ns"] = 1, k, k * 1_000_000
            row[f"{side}_sent_z"] = sign * 0.25 * tilt
        stage.advance(state, rows, k)
        if now["phase"] == Phase.FINISHED:
            break
    played = rows[: k + 1]
    summary = summarise(played)
    changes = np.flatnonzero(np.diff(played["successes"]) > 0) + 1
    assert summary.completions == tuple(played["completion"][changes])
    assert len(summary.completions) == 4 == state["successes"][0]
    assert summary.failures == 2 == state["failures"][0]
    assert [(a.trial, a.attempt) for a in summary.attempts] == [(1, 1), (2, 1), (2, 2), (2, 3), (3, 1), (4, 1)]
    assert all(a.duration == pytest.approx(a.completion + 0.3, abs=2e-3) for a in summary.attempts if a.completion > 0)


def test_list_of_an_older_logger_may_call_a_stopped_last_attempt_unfinished() -> None:
    rows = ticks(20)
    rows["phase"][5:] = Phase.RUNNING
    rows["event"][-1] = Cause.STOP
    found = find_attempts(rows)
    listed = (replace(found[0], outcome="unfinished"),)
    assert list(_wrong_list(found, found)) == list(_wrong_list(found, listed)) == []
    rows["event"][-1] = Cause.FELL
    assert list(_wrong_list(find_attempts(rows), listed)) != []
