"""Checks of the requirements after a fault, on synthetic evidence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from evidence.faults.checks import (
    continues,
    disturbed,
    fact_contains,
    falls,
    frames_shown,
    may_pause,
    neighbour_unaffected,
    no_damage,
    no_force_if_failing,
    no_force_in_pauses,
    nothing_lost,
    paused,
    recorded,
    recovered,
    rendered_known,
    safeguard_reported,
    ticks_accounted,
    verdict_of,
    within_slew_limit,
)
from evidence.faults.devices import TRACE
from evidence.faults.evidence import DyadRecordings, Evidence, Pause, Window
from netboard.base.safeguards import Safeguard
from netboard.base.tables.rig import Safety
from netboard.base.tick import TICK
from netboard.network.protocol.records import EventRecord
from netboard.recording.integrity.account import Account, NumberRange
from netboard.recording.integrity.account import PauseRecord as Told
from netboard.recording.integrity.severity import CheckFinding, CheckReport, Severity
from netboard.task.trials.state_machine import Phase

MS = 1_000_000
START = 1000 * MS
LENGTH = 1000
WINDOW = Window(START, START + LENGTH * MS)
WHY = "paused: no sample from the left agent"


def trace_of(forces: NDArray) -> NDArray:
    trace = np.zeros(forces.size, TRACE)
    trace["time_ns"] = START + MS * np.arange(forces.size)
    trace["fz"] = forces
    return trace


def updated_forces() -> NDArray:
    return 1.0 + 0.01 * np.sin(np.arange(LENGTH))


def fading_forces(k: int, hold: int = 10, fade: int = 50) -> NDArray:
    """Forces that are not updated after millisecond `k`: held, then faded to zero."""
    forces = updated_forces()
    age = np.arange(LENGTH) - k
    faded = forces[k] * np.clip(1.0 - (age - hold) / fade, 0.0, 1.0)
    return np.where(age > 0, faded, forces)


def account(lost: tuple[NumberRange, ...] = (), unexplained: tuple[NumberRange, ...] = ()) -> Account:
    return Account("s", (), (), lost, unexplained, (), (), (Told(1, "why"),), ())


def taken(pauses: tuple[Pause, ...] = (), phase: Phase = Phase.RUNNING, **changes: object) -> DyadRecordings:
    ticks = np.zeros(LENGTH, TICK)
    ticks["tick"], ticks["phase"] = np.arange(LENGTH), phase
    ticks["time_ns"] = START + MS * np.arange(LENGTH)
    painted = {"left": np.empty(0, np.int64), "right": np.empty(0, np.int64)}
    return replace(DyadRecordings(ticks, (), pauses, (account(),), painted), **changes)


def evidence(left: NDArray | None = None, rig: DyadRecordings | None = None, **changes: object) -> Evidence:
    traces = {"left": [trace_of(updated_forces() if left is None else left)], "right": [trace_of(updated_forces())]}
    return replace(Evidence(WINDOW, Safety(), traces, rig or taken(), None), **changes)


def pause(at: int = 100, reason: str = WHY, again: tuple[int, int] | None = (1, 2)) -> Pause:
    return Pause(START + at * MS, reason, 1, 1, again)


def test_force_that_falls_in_time_passes() -> None:
    verdict = falls("left")(evidence(fading_forces(100)))
    assert verdict.holds, verdict
    assert "falls after 11.0 ms, zero after 60.0 ms" in verdict.found


@pytest.mark.parametrize(("hold", "fade"), [(13, 40), (10, 70)])
def test_force_that_falls_too_late_or_too_slowly_fails(hold: int, fade: int) -> None:
    assert not falls("left")(evidence(fading_forces(100, hold, fade))).holds


def test_force_that_need_not_reach_zero_must_only_begin_to_fall() -> None:
    forces = np.where(np.arange(LENGTH) < 120, fading_forces(100), updated_forces())
    assert not falls("left")(evidence(forces)).holds
    assert falls("left", to_zero=False)(evidence(forces)).holds


def test_force_that_is_always_updated_fails_the_fall_check() -> None:
    assert not falls("right")(evidence()).holds


def test_stalls_of_the_machine_are_not_counted_against_the_agent() -> None:
    slow = evidence(fading_forces(100, hold=30))
    late = trace_of(fading_forces(100, hold=30))
    late = np.delete(late, slice(105, 131))
    assert not falls("left")(slow).holds
    assert falls("left")(replace(slow, traces={"left": [late], "right": []})).holds


def test_smooth_force_passes_and_step_fails_the_gentleness_check() -> None:
    assert within_slew_limit()(evidence(fading_forces(100))).holds
    stepped = np.where(np.arange(LENGTH) < 500, 1.0, -1.0)
    assert not within_slew_limit()(evidence(stepped)).holds


def test_cut_to_zero_is_allowed_only_on_the_named_side() -> None:
    cut = evidence(np.where(np.arange(LENGTH) < 500, 2.0, 0.0))
    assert not within_slew_limit()(cut).holds
    assert not within_slew_limit("right")(cut).holds
    assert within_slew_limit("left")(cut).holds


def test_pause_passes_if_its_reason_matches_and_the_trial_is_repeated() -> None:
    check = paused("left agent")
    assert check(evidence(rig=taken((pause(),)))).holds
    assert not check(evidence(rig=taken())).holds
    assert not check(evidence(rig=taken((pause(reason="the operator"),)))).holds
    assert not check(evidence(rig=taken((pause(again=(2, 1)),)))).holds
    assert not check(evidence(rig=taken((pause(again=None),)))).holds
    assert not check(evidence(rig=taken((pause(at=-500),)))).holds


def test_trial_continues_unless_paused() -> None:
    assert continues(evidence()).holds
    assert not continues(evidence(rig=taken((pause(),)))).holds
    assert may_pause("left agent")(evidence()).holds
    assert may_pause("left agent")(evidence(rig=taken((pause(),)))).holds
    assert not may_pause("left agent")(evidence(rig=taken((pause(reason="something else"),)))).holds


def test_pause_caused_by_the_machine_is_excused() -> None:
    assert continues(evidence(rig=taken((pause(reason="paused: the server stalled for 50 ms"),)))).holds
    held_up = np.delete(trace_of(updated_forces()), slice(40, 95))
    excused = evidence(rig=taken((pause(100),)), traces={"left": [held_up], "right": []})
    assert continues(excused).holds
    assert not continues(replace(excused, rig=taken((pause(500),)))).holds


def test_forces_must_be_zero_while_paused() -> None:
    phases = np.where(np.arange(LENGTH) <= 100, Phase.RUNNING, Phase.PAUSED)
    rig = taken((pause(),))
    rig.ticks["phase"] = phases
    quiet = {"left": [trace_of(fading_forces(90))], "right": [trace_of(fading_forces(95))]}
    assert no_force_in_pauses(evidence(rig=rig, traces=quiet)).holds
    assert not no_force_in_pauses(evidence(rig=rig)).holds
    rig.ticks["phase"][170:] = Phase.LEVELLING
    back_again = np.where(np.arange(LENGTH) < 170, fading_forces(90), updated_forces())
    assert no_force_in_pauses(evidence(rig=rig, traces={"left": [trace_of(back_again)], "right": []})).holds


def test_every_tick_must_be_accounted_for() -> None:
    lost = taken(accounts=(account(lost=(NumberRange(3, 5, "no room"),)),))
    unexplained = taken(accounts=(account(unexplained=(NumberRange(3, 5),)),))
    assert ticks_accounted(evidence()).holds
    assert nothing_lost(evidence()).holds
    assert ticks_accounted(evidence(rig=lost)).holds
    assert "3 lost (no room)" in ticks_accounted(evidence(rig=lost)).found
    assert not nothing_lost(evidence(rig=lost)).holds
    assert not ticks_accounted(evidence(rig=unexplained)).holds
    assert not ticks_accounted(evidence(rig=taken(accounts=()))).holds


def test_event_must_be_recorded_with_its_words_within_the_window() -> None:
    event = EventRecord(0, 1, START + MS, "refused", {"reason": "it has not joined yet"})
    noticed = evidence(rig=taken(events=(event,)))
    assert recorded("refused")(noticed).holds
    assert recorded("refused", "joined", "yet")(noticed).holds
    assert not recorded("refused", "goodbye")(noticed).holds
    assert not recorded("joined")(noticed).holds
    assert not recorded("refused")(evidence(rig=taken(events=(replace(event, time_ns=0),)))).holds


def test_facts_and_failures_of_a_case_are_checked() -> None:
    fact = evidence(window=replace(WINDOW, facts={"answer": "it has not joined yet"}))
    assert fact_contains("answer", "joined")(fact).holds
    assert not fact_contains("answer", "welcome")(fact).holds
    assert not fact_contains("question", "joined")(fact).holds
    assert recovered(fact).holds
    assert not recovered(evidence(window=replace(WINDOW, trouble="nobody came"))).holds


def test_active_safeguards_are_read_from_the_ticks() -> None:
    rig = taken()
    rig.ticks["left_safeguards"][5] = Safeguard.NOT_FINITE | Safeguard.ARMED
    assert safeguard_reported("left", Safeguard.NOT_FINITE)(evidence(rig=rig)).holds
    assert not safeguard_reported("left", Safeguard.TOO_FAST)(evidence(rig=rig)).holds


def test_device_with_non_finite_position_must_have_zero_force() -> None:
    trace = trace_of(np.where(np.arange(LENGTH) < 500, 1.0, 0.0))
    trace["z"][500:] = np.nan
    found = evidence(traces={"left": [trace], "right": []})
    assert no_force_if_failing("left", to_the_end=True)(found).holds
    assert no_force_if_failing("left", to_the_end=False)(found).holds
    trace["z"][600:], trace["fz"][700:] = 0.0, 1.0
    assert no_force_if_failing("left", to_the_end=False)(found).holds
    assert not no_force_if_failing("left", to_the_end=True)(found).holds
    trace["z"][499] = np.nan
    assert no_force_if_failing("left", to_the_end=False)(found).holds  # by which it found out
    trace["z"][498] = np.nan
    assert not no_force_if_failing("left", to_the_end=False)(found).holds
    trace["z"][:] = 0.0
    assert not no_force_if_failing("left", to_the_end=False)(found).holds


def test_display_must_show_frames_at_the_end() -> None:
    at_end = {"left": np.array([WINDOW.stop_ns - MS]), "right": np.empty(0, np.int64)}
    assert frames_shown("left")(evidence(rig=taken(painted_ns=at_end))).holds
    assert not frames_shown("right")(evidence(rig=taken(painted_ns=at_end))).holds


def test_trial_paused_by_the_machine_before_the_fault_is_repeated() -> None:
    stood = pause(-4, "paused: the server stalled for 28 ms")
    assert disturbed(evidence(rig=taken((stood,)))) == stood.reason
    for late in (pause(0, stood.reason), pause(-301, stood.reason)):
        assert disturbed(evidence(rig=taken((late,)))) == ""
    lost = pause(-100)
    assert disturbed(evidence(rig=taken((lost,)))) == "", "the machine is not to blame"
    stalls = START + MS * np.array([[-250, -150]])
    assert disturbed(evidence(rig=taken((lost,)), stalls=stalls)) == lost.reason


def test_recorded_force_must_equal_the_device_force_or_be_briefly_unknown() -> None:
    handed = fading_forces(300)
    ticks = taken().ticks
    ticks["left_rendered"] = np.roll(handed, 1)
    ticks["left_rendered"][0] = handed[0]
    assert rendered_known("left")(evidence(handed, taken(ticks=ticks))).holds
    unknown = ticks.copy()
    unknown["left_rendered"][310:330] = np.nan
    assert rendered_known("left")(evidence(handed, taken(ticks=unknown))).holds
    unknown["left_rendered"][330] = np.nan
    assert not rendered_known("left")(evidence(handed, taken(ticks=unknown))).holds
    stale = ticks.copy()
    stale["left_rendered"][310:] = handed[300]
    verdict = rendered_known("left")(evidence(handed, taken(ticks=stale)))
    assert not verdict.holds
    assert "ticks hold another force" in verdict.found


def test_neighbouring_dyad_must_be_unaffected() -> None:
    assert neighbour_unaffected(evidence()).holds
    assert neighbour_unaffected(evidence(neighbour=taken())).holds
    assert neighbour_unaffected(evidence(neighbour=taken((pause(at=-500),)))).holds
    assert not neighbour_unaffected(evidence(neighbour=taken((pause(),)))).holds
    assert not neighbour_unaffected(
        evidence(neighbour=taken(accounts=(account(unexplained=(NumberRange(1, 2),)),)))
    ).holds


def test_damaged_recording_fails_every_case(tmp_path: Path) -> None:
    lossy = CheckReport(tmp_path / "a.mcap", (CheckFinding(Severity.LOSS, "stopped", "trials"),))
    broken = CheckReport(tmp_path / "b.mcap", (CheckFinding(Severity.DAMAGE, "no clock does this", "clocks"),))
    good = evidence(rig=taken(reports=(lossy,)))
    assert no_damage(good).holds
    assert verdict_of(good) == "losses"
    bad = evidence(rig=taken(reports=(lossy,)), neighbour=taken(reports=(broken,)))
    assert not no_damage(bad).holds
    assert no_damage(bad).found == "b.mcap: no clock does this"
    assert verdict_of(bad) == "damaged"
