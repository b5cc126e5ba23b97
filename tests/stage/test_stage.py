"""The stage: one tick, many ticks, and the same ticks again."""

import os
import subprocess
import sys
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from netboard.base.config import Config, parse
from netboard.base.tables import forces
from netboard.base.tick import INPUT, OUTPUT, SERVICE, STATE, TICK, TICK_NS
from netboard.recording.integrity.verification import state_of, verify
from netboard.stage.stage import Stage, commanded_forces, make_stage
from netboard.task.trials.state_machine import BALL_FREE, TABLE, Cause, Phase

RIGHT_FIRST = '[block]\nfirst_target = "right"\ntrials = 2\n'


def inputs(count: int, left: Any = 0.0, right: Any = 0.0, age_ns: int = 300_000) -> NDArray[Any]:
    """Rows with live samples at the given heights [m], one a tick, their velocities the differences."""
    rows = np.zeros(count, TICK)
    rows["tick"] = np.arange(count)
    rows["time_ns"] = rows["tick"] * TICK_NS + 10**9
    for side, z in (("left", left), ("right", right)):
        heights = np.broadcast_to(np.asarray(z, float), (count,))
        rows[f"{side}_live"] = 1
        rows[f"{side}_seq"] = rows["tick"]
        rows[f"{side}_stamp_ns"] = rows["time_ns"] - age_ns
        rows[f"{side}_sent_z"] = heights
        rows[f"{side}_sent_vz"] = np.gradient(heights, 1e-3)
    return rows


def play(stage: Stage, rows: NDArray[Any]) -> NDArray[Any]:
    """Run the rows from the initial state; the state after them."""
    state = stage.initial()
    stage.advance(state, rows, 0, len(rows))
    return state


def started(rows: NDArray[Any]) -> NDArray[Any]:
    rows["command"][0] = Cause.START
    return rows


def events(rows: NDArray[Any]) -> list[tuple[int, Cause]]:
    return [(int(row["tick"]), Cause(int(row["event"]))) for row in rows if row["event"]]


def test_row_has_its_four_parts_and_eight_bytes_per_field() -> None:
    names = [*INPUT.names, *STATE.names, *OUTPUT.names, *SERVICE.names]  # type: ignore[misc]
    assert list(TICK.names or ()) == names
    assert all(TICK[name].itemsize == 8 for name in names)
    assert TICK.itemsize == 8 * len(names)


def test_advancing_many_ticks_at_once_or_singly_gives_the_same_bits() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    heights = 0.01 * np.sin(np.arange(4000) * 1e-3 * 4)
    at_once = started(inputs(4000, heights, -heights))
    one_by_one = at_once.copy()
    end = play(stage, at_once)
    state = stage.initial()
    for i in range(4000):
        stage.advance(state, one_by_one, i)
    assert at_once.tobytes() == one_by_one.tobytes()
    assert end.tobytes() == state.tobytes()


def test_rows_may_be_a_ring_buffer() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(100, 0.01, 0.0))
    ring, state = np.zeros(8, TICK), stage.initial()
    for i in range(100):
        ring[i % 8] = rows[i]
        stage.advance(state, ring, i)
    assert state.tobytes() == play(stage, rows).tobytes()


def test_forces_of_a_board_at_rest_satisfy_static_equilibrium() -> None:
    """The values are those of the paper's scene with the ball fixed opposite a right target."""
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(500))
    play(stage, rows)
    last = rows[-1]
    assert last["z"] == pytest.approx(-1.0900e-3, abs=1e-7)
    assert last["p"] == -0.15
    assert np.sin(last["theta"]) == pytest.approx(0.002943, abs=1e-6)
    assert last["left_coupling"] == pytest.approx(0.36515, abs=1e-5)
    assert last["right_coupling"] == pytest.approx(0.07085, abs=1e-5)
    assert last["left_force"] == -last["left_coupling"]


def test_trial_runs_from_levelling_to_success_and_the_next_target() -> None:
    """Hands that compensate the ball's weight at once: tilt right for a while, brake, hold."""
    stage = make_stage(parse(RIGHT_FIRST))
    t = np.arange(14_000) * 1e-3
    rows = started(inputs(14_000, *steered(stage, t)))
    play(stage, rows)
    happened = [cause for _, cause in events(rows)]
    assert happened[:3] == [Cause.START, Cause.LEVEL, Cause.ENTERED]
    assert Cause.HELD in happened
    success = rows[rows["event"] == Cause.HELD][0]
    following = rows[rows["tick"] == success["tick"] + 2][0]
    assert following["completion"] == pytest.approx(success["mark_ticks"] * 1e-3)
    assert success["run_ticks"] - success["mark_ticks"] == pytest.approx(1500, abs=1)
    assert (following["target"], following["p"], following["trial"]) == (-1, 0.15, 2)


def steered(stage: Stage, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Heights of both hands that bring the ball over: the stage itself with a PD controller of the ball."""
    state, rows = stage.initial(), inputs(len(t))
    rows["command"][0] = Cause.START
    tilt = 0.0
    for i in range(len(t)):
        s = state[0]
        if s["phase"] in BALL_FREE:
            tilt = float(np.clip(-(2.0 * (s["target"] * 0.15 - s["p"]) - 2.5 * s["vp"]) / 9.81, -0.05, 0.05))
        else:
            tilt = 0.0
        compliance = -s["p"] * 0.05 * 9.81 / (2 * 200 * 0.25**2)
        rise = 0.25 * (tilt - compliance)
        rows["right_sent_z"][i], rows["left_sent_z"][i] = rise, -rise
        stage.advance(state, rows, i)
    return rows["left_sent_z"].copy(), rows["right_sent_z"].copy()


def test_fallen_ball_fails_the_attempt_and_repeats_the_trial() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(6000))
    rows["left_sent_z"][1000:], rows["right_sent_z"][1000:] = 0.03, -0.03
    play(stage, rows)
    happened = events(rows)
    assert [cause for _, cause in happened][:4] == [Cause.START, Cause.LEVEL, Cause.ENTERED, Cause.LEFT]
    assert [cause for _, cause in happened][4:6] == [Cause.FELL, Cause.NEXT]
    after = rows[rows["tick"] == happened[5][0] + 1][0]
    assert (after["trial"], after["attempt"], after["target"], after["failures"]) == (1, 2, 1, 1)
    assert (after["p"], after["vp"]) == (-0.15, 0.0)


def test_haptics_off_zeroes_the_forces_and_keeps_the_motion() -> None:
    on, off = started(inputs(2000, 0.01)), started(inputs(2000, 0.01))
    play(make_stage(parse(RIGHT_FIRST)), on)
    play(make_stage(parse(RIGHT_FIRST + 'force = "none"')), off)
    assert np.any(on["left_force"] != 0)
    assert not np.any(off["left_force"])
    assert not np.any(off["right_force"])
    assert all(np.array_equal(on[name], off[name]) for name in STATE.names or ())


def test_forces_are_zero_before_the_block_and_while_paused() -> None:
    rows = inputs(3000, 0.01)
    rows["command"][1000], rows["command"][2000] = Cause.START, Cause.PAUSE
    play(make_stage(parse(RIGHT_FIRST)), rows)
    felt = rows["left_force"] != 0
    assert not felt[:1001].any()
    assert felt[1001:2001].all()
    assert not felt[2001:].any()


def test_sample_is_extrapolated_by_velocity_for_at_most_10_ms() -> None:
    rows = inputs(3, 0.010, 0.0)
    rows["left_sent_vz"] = 0.1
    rows["left_stamp_ns"] = rows["time_ns"] - np.array([2_000_000, 10_000_000, 40_000_000])
    play(make_stage(Config()), rows)
    assert rows["left_used_z"] == pytest.approx([0.0102, 0.011, 0.011], abs=1e-15)


def speeding_up(count: int, acceleration: float = 4.0) -> NDArray[Any]:
    """Samples of a left stylus that speeds up from rest, each read 0.4 ms before its tick."""
    rows = inputs(count, age_ns=400_000)
    t = (rows["left_stamp_ns"] - rows["left_stamp_ns"][0]) * 1e-9
    rows["left_sent_z"], rows["left_sent_vz"] = acceleration * t**2 / 2, acceleration * t
    return rows


def test_constant_acceleration_is_extrapolated_exactly_from_the_second_sample() -> None:
    rows = speeding_up(6)
    play(make_stage(Config()), rows)
    t = np.arange(6) * 1e-3 + 0.4e-3
    assert rows["left_used_z"][1:] == pytest.approx(2.0 * t[1:] ** 2, rel=1e-12)
    assert rows["left_used_vz"][1:] == pytest.approx(4.0 * t[1:], rel=1e-12)
    assert rows["left_used_az"].tolist() == pytest.approx([0.0, *[4.0] * 5], rel=1e-9)


def test_constant_velocity_and_zero_order_extrapolation() -> None:
    rows = speeding_up(4)
    play(make_stage(parse('[physics]\nhold = "cv"')), rows)
    assert rows["left_used_z"] == pytest.approx(rows["left_sent_z"] + 0.4e-3 * rows["left_sent_vz"], rel=1e-12)
    assert not rows["left_used_az"].any()
    play(make_stage(parse('[physics]\nhold = "zoh"')), rows)
    assert rows["left_used_z"].tolist() == rows["left_sent_z"].tolist()


def test_during_loss_acceleration_applies_for_5_ms_and_velocity_for_10() -> None:
    rows = speeding_up(24)
    for name in ("left_stamp_ns", "left_sent_z", "left_sent_vz"):
        rows[name][9:] = rows[name][8]
    play(make_stage(Config()), rows)
    since = np.minimum((rows["time_ns"] - rows["left_stamp_ns"])[8:] * 1e-9, 0.010)
    quick, z, vz = np.minimum(since, 0.005), rows["left_sent_z"][8], rows["left_sent_vz"][8]
    expected = z + vz * since + 4.0 * quick * (since - quick / 2)
    assert rows["left_used_z"][8:] == pytest.approx(expected, rel=1e-12)
    assert rows["left_used_vz"][20:] == pytest.approx([vz + 0.020] * 4, rel=1e-12)


@pytest.mark.parametrize(("gap_ns", "slope"), [(6_000_000, 0.0), (100_000, 0.0), (-1_000_000, 0.0), (1_000_000, 50.0)])
def test_acceleration_needs_neighbouring_samples_and_is_bounded(gap_ns: int, slope: float) -> None:
    rows = inputs(2)
    rows["left_sent_vz"] = 0.0, 0.2
    rows["left_stamp_ns"][1] = rows["left_stamp_ns"][0] + gap_ns
    play(make_stage(Config()), rows)
    assert rows["left_used_az"][1] == slope


def test_stylus_beyond_its_range_is_clipped_with_zero_velocity() -> None:
    rows = inputs(2, 0.2, -0.2)
    rows["left_sent_vz"] = 1.0
    play(make_stage(Config()), rows)
    assert rows["left_used_z"].tolist() == [0.075] * 2
    assert rows["right_used_z"].tolist() == [-0.075] * 2
    assert rows["left_used_vz"].tolist() == [0.0] * 2


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
def test_non_finite_sample_is_ignored_and_the_last_height_kept(bad: float) -> None:
    rows = started(inputs(100, 0.01, 0.0))
    rows["left_sent_z"][50:] = bad
    state = play(make_stage(Config()), rows)
    assert np.all(rows["left_used_z"][49:] == rows["left_used_z"][49])
    assert np.isfinite(state["z"]).all()


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1e300, -10.1])
def test_sample_with_an_impossible_velocity_is_ignored(bad: float) -> None:
    rows = started(inputs(100, 0.01, 0.0))
    rows["left_sent_vz"][50:] = bad
    play(make_stage(Config()), rows)
    assert np.all(rows["left_used_z"][50:] == rows["left_used_z"][49])
    assert not rows["left_used_vz"][50:].any()
    assert np.abs(rows["left_coupling"]).max() < 5.0


def test_side_without_a_live_sample_has_zero_force() -> None:
    rows = started(inputs(200, 0.01, 0.01))
    rows["left_live"][100:] = 0
    play(make_stage(Config()), rows)
    assert not rows["left_force"][100:].any()
    assert rows["right_force"][100:].all()


def test_non_finite_board_is_a_fault_and_is_reset_to_rest() -> None:
    stage = make_stage(Config())
    rows, state = started(inputs(10)), stage.initial()
    stage.advance(state, rows, 0, 5)
    state["omega"] = np.inf
    stage.advance(state, rows, 5, 1)
    assert rows["event"][5] == Cause.FAULT
    assert state["phase"] == Phase.PAUSED
    assert np.isfinite([float(state[name][0]) for name in ("z", "vz", "theta", "omega", "p", "vp")]).all()


def test_upright_board_is_a_fault_and_is_reset_to_rest() -> None:
    stage = make_stage(Config())
    rows, state = started(inputs(10)), stage.initial()
    stage.advance(state, rows, 0, 5)
    state["theta"] = -1.7
    stage.advance(state, rows, 5, 1)
    assert rows["event"][5] == Cause.FAULT
    assert state["phase"] == Phase.PAUSED
    assert (state["z"], state["theta"], state["omega"]) == (0.0, 0.0, 0.0)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    scale=st.sampled_from([0.001, 0.02, 0.2]),
    commands=st.lists(st.tuples(st.integers(0, 1999), st.sampled_from([*range(-3, 20), Cause.START])), max_size=12),
)
def test_any_input_keeps_the_state_finite_and_the_counts_correct(
    seed: int, scale: float, commands: list[tuple[int, int]]
) -> None:
    rng = np.random.default_rng(seed)
    rows = started(inputs(2000, *rng.normal(0, scale, (2, 2000))))
    rows["left_live"] = rng.random(2000) > 0.1
    rows["right_sent_z"][rng.integers(0, 2000, 5)] = np.nan
    for tick, cause in commands:
        rows["command"][tick] = cause
    stage = make_stage(parse(RIGHT_FIRST))
    state = play(stage, rows)
    floats = [name for name in (*STATE.names, *OUTPUT.names) if TICK[name].kind == "f"]  # type: ignore[misc]
    assert all(np.isfinite(rows[name]).all() for name in floats)
    causes = [cause for _, cause in events(rows)]
    assert state["successes"] == causes.count(Cause.HELD)
    assert state["failures"] == causes.count(Cause.FELL)
    assert abs(int(state["target"][0])) == 1
    assert verify(stage, rows).identical


# --- what is felt ----------------------------------------------------------------------------------------------------


def felt_by(block: str, rows: NDArray[Any]) -> NDArray[np.float64]:
    """Forces on both hands in the same block with other settings, after a start."""
    played = started(rows.copy())
    play(make_stage(parse(RIGHT_FIRST + block)), played)
    return np.stack([played["left_force"], played["right_force"]], axis=1)


CONDITIONS = {
    name: f'force = "{name}"' + ('\nunrelated = "a.mcap"' if condition.recorded else "")
    for name, condition in forces.CONDITIONS.items()
}


def waving(count: int = 1500) -> NDArray[Any]:
    """Both hands in slow motion, not alike, and forces of another session."""
    t = np.arange(count) * 1e-3
    rows = inputs(count, 0.01 * np.sin(2 * t), 0.008 * np.sin(3 * t + 1))
    rows["left_other"], rows["right_other"] = 0.3 * np.cos(t), np.sin(5 * t)
    return rows


def test_board_and_trial_are_independent_of_the_force_condition() -> None:
    played = []
    for block in CONDITIONS.values():
        rows = started(waving())
        played.append(play(make_stage(parse(RIGHT_FIRST + block)), rows).tobytes())
    assert len(set(played)) == 1


def test_partner_and_environment_forces_add_up_for_a_board_at_rest() -> None:
    rows = inputs(1000, 0.02, 0.005)
    parts = felt_by(CONDITIONS["partner_only"], rows) + felt_by(CONDITIONS["environment_only"], rows)
    # The tilt of 1.7 deg spares the board 0.1 % of the ball's weight, and has not quite ended.
    assert parts[-1] == pytest.approx(felt_by(CONDITIONS["full"], rows)[-1], abs=1e-3)


def test_partner_only_and_environment_only_forces_are_separate() -> None:
    """While the ball is fixed: what it does when it rolls is the work of both."""
    here, there, mine = waving(), waving(), waving()
    for name in ("sent_z", "sent_vz"):
        there[f"right_{name}"], mine[f"left_{name}"] = -here[f"right_{name}"], -here[f"left_{name}"]
    environment, partner = CONDITIONS["environment_only"], CONDITIONS["partner_only"]
    assert np.array_equal(felt_by(environment, here)[:, 0], felt_by(environment, there)[:, 0])
    assert np.array_equal(felt_by(partner, here)[:, 0], felt_by(partner, mine)[:, 0])
    assert not np.array_equal(felt_by(partner, here)[:, 0], felt_by(partner, there)[:, 0])
    assert not np.array_equal(felt_by(environment, here)[:, 0], felt_by(environment, mine)[:, 0])


def test_own_only_force_is_independent_of_partner_and_ball() -> None:
    here, there = waving(), waving()
    there["right_sent_z"], there["right_sent_vz"] = -here["right_sent_z"], -here["right_sent_vz"]
    own = CONDITIONS["own_only"]
    felt = felt_by(own, here)
    assert np.array_equal(felt[:, 0], felt_by(own, there)[:, 0])
    assert felt[1:, 0] == pytest.approx(-(0.218 + 25.9259 * here["left_sent_z"][1:]), abs=1e-3)


def test_partner_only_force_uses_the_clipped_height() -> None:
    rows = inputs(100, 0.2, 0.0)
    rows["left_sent_vz"] = 1.0
    assert felt_by(CONDITIONS["partner_only"], rows)[1:, 1] == pytest.approx(-25.9259 * 0.075, abs=1e-4)


def test_unrelated_force_is_that_of_the_row_during_trials_only() -> None:
    rows = waving()
    felt = felt_by(CONDITIONS["unrelated"], rows)
    assert np.array_equal(felt[1:], np.stack([rows["left_other"], rows["right_other"]], axis=1)[1:])
    assert not felt[0].any()


@pytest.mark.slow
@pytest.mark.sampled(3)
@pytest.mark.parametrize("force", [name for name in CONDITIONS if name != "none"])
def test_force_scale_multiplies_and_unmanned_sides_have_zero_force(force: str) -> None:
    rows, block = waving(), CONDITIONS[force]
    whole = felt_by(block, rows)
    assert whole[1:].any(axis=0).all()
    assert np.array_equal(felt_by(block + "\nforce_scale = 0.5", rows), 0.5 * whole)
    assert not felt_by(block + "\nforce_scale = 0.0", rows).any()
    one = felt_by(f'{block}\nleft = "still"', rows)
    assert not one[:, 0].any()
    assert np.array_equal(one[:, 1], whole[:, 1])
    assert np.array_equal(felt_by(f'{block}\nleft = "robot"', rows), whole)
    rows["right_live"][700:] = 0
    assert not felt_by(block, rows)[700:, 1].any()


def test_catch_trial_has_zero_force_from_levelling_to_its_end() -> None:
    stage = make_stage(parse(RIGHT_FIRST + "catch = [2]"))
    rows = started(inputs(300, 0.01))
    rows["command"][[100, 200]] = Cause.SKIP, Cause.REPEAT
    play(stage, rows)
    assert rows["trial"][[100, 101, 299]].tolist() == [1, 2, 2]
    assert rows["left_force"][1:101].all()
    assert not rows["left_force"][101:].any()
    assert np.array_equal(rows["left_force"] == 0, rows["right_force"] == 0)


@pytest.mark.parametrize("delay", [0, 1, 37, 500])
def test_delayed_force_is_the_same_from_ring_buffer_and_recording(delay: int) -> None:
    stage = make_stage(parse(RIGHT_FIRST + f"force_delay_ms = {delay}"))
    rows = started(waving(2000))
    undelayed = felt_by("", waving(2000))
    ring, state, sent_forces = np.zeros(512, TICK), stage.initial(), []
    words = ring.view(np.int64).reshape(512, -1)
    for i in range(2000):
        ring[i % 512] = rows[i]
        stage.advance(state, ring, i)
        row = stage.commanded_row(words, i).view(TICK)[0]
        sent_forces.append((row["left_force"], row["right_force"]))
        rows[i] = ring[i % 512]
    assert np.array_equal(rows["left_force"], undelayed[:, 0])
    assert np.array_equal(sent_forces[delay:], undelayed[: 2000 - delay])
    assert not np.any(sent_forces[:delay])
    assert np.array_equal(commanded_forces(rows, delay), sent_forces)


@pytest.mark.parametrize("delay", [1, 50])
def test_catch_trial_gets_no_delayed_force_of_the_trial_before(delay: int) -> None:
    stage = make_stage(parse(RIGHT_FIRST + f"catch = [2]\nforce_delay_ms = {delay}"))
    rows = started(inputs(400, 0.01))
    rows["command"][[100, 200, 300]] = Cause.SKIP, Cause.REPEAT, Cause.SKIP
    play(stage, rows)
    assert rows["trial"][[100, 101, 300, 301]].tolist() == [1, 2, 2, 3]
    words = rows.view(np.int64).reshape(400, -1)
    sent = np.array([stage.commanded_row(words, i).view(TICK)[0]["left_force"] for i in range(400)])
    assert sent[1 + delay : 101].all()
    assert not sent[101 : 301 + delay].any()
    assert sent[301 + delay :].all()
    assert np.array_equal(commanded_forces(rows, delay, (2,))[delay:, 0], sent[delay:])


def test_commanded_forces_of_a_recording_with_a_gap_and_a_pause() -> None:
    rows = started(waving(300))
    rows["command"][200] = Cause.PAUSE
    play(make_stage(parse(RIGHT_FIRST)), rows)
    sent_forces = commanded_forces(np.delete(rows, slice(100, 110)), 20)
    kept = np.delete(np.arange(300), slice(100, 110))
    known = (kept > 20) & (kept <= 200) & ~((kept >= 120) & (kept < 130))
    assert np.array_equal(sent_forces[:, 0] != 0, known)
    assert commanded_forces(rows[:0], 20).shape == (0, 2)


# --- the block -------------------------------------------------------------------------------------------------------


def commanded(stage: Stage, *commands: tuple[int, Cause], count: int = 100, **begin: int) -> tuple[Any, NDArray[Any]]:
    """Rows of a tilted board with commands at some of its ticks, and the state after them."""
    rows, state = started(inputs(count, 0.02, -0.02)), stage.initial(**begin)
    for tick, cause in commands:
        rows["command"][tick] = cause
    stage.advance(state, rows, 0, count)
    assert verify(stage, rows).identical
    return state[0], rows


def test_block_can_start_at_a_later_trial() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    for trial, side in ((1, 1), (2, -1), (7, 1)):
        begun = stage.initial(trial=trial, attempt=3, successes=trial - 1, failures=4, extra=6, block_ticks=9)[0]
        assert (begun["trial"], begun["target"], begun["p"]) == (trial, side, -side * 0.15)
        assert [begun[name] for name in ("attempt", "failures", "extra", "block_ticks")] == [3, 4, 6, 9]
        assert begun["phase"] == Phase.IDLE
    state, _ = commanded(stage, trial=2, attempt=3)
    assert (state["phase"], state["trial"], state["attempt"], state["p"]) == (Phase.LEVELLING, 2, 3, 0.15)


def test_skipped_trials_end_the_block_without_successes() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    state, rows = commanded(stage, (10, Cause.SKIP), (20, Cause.SKIP), (30, Cause.SKIP))
    assert events(rows) == [(0, Cause.START), (10, Cause.SKIP), (20, Cause.LAST)]
    assert (state["phase"], state["trial"], state["successes"]) == (Phase.FINISHED, 2, 0)
    assert rows["target"][[10, 11]].tolist() == [1, -1]
    assert rows["p"][[10, 11]].tolist() == [-0.15, 0.15]


def test_trial_skipped_in_a_pause_keeps_the_pause() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    state, rows = commanded(stage, (10, Cause.PAUSE), (20, Cause.SKIP), (30, Cause.RESUME))
    assert rows["phase"][[20, 21, 30]].tolist() == [Phase.PAUSED] * 3
    assert rows["attempt"][[10, 21]].tolist() == [1, 0]
    assert (state["phase"], state["trial"], state["attempt"], state["target"]) == (Phase.LEVELLING, 2, 1, -1)
    ended, _ = commanded(stage, (10, Cause.PAUSE), (20, Cause.SKIP), (30, Cause.SKIP))
    assert (ended["phase"], ended["trial"]) == (Phase.FINISHED, 2)


def test_trials_can_be_added_and_vetoed_before_and_during_a_block() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    wishes = [(5, Cause.VETO), (6, Cause.REPEAT), (7, Cause.REPEAT), (8, Cause.VETO), (10, Cause.PAUSE)]
    state, rows = commanded(stage, *wishes, (12, Cause.REPEAT))
    assert rows["extra"][:14].tolist() == [0] * 7 + [1, 2] + [1] * 4 + [2]
    assert (state["phase"], state["extra"], state["attempt"]) == (Phase.PAUSED, 2, 1)
    idle = inputs(3)
    idle["command"] = Cause.REPEAT
    assert play(stage, idle)["extra"] == 3
    assert [cause for _, cause in events(idle)] == [Cause.REPEAT] * 3
    longer, _ = commanded(stage, *((tick, Cause.SKIP) for tick in (10, 20, 30)), extra=1)
    assert (longer["phase"], longer["trial"]) == (Phase.FINISHED, 3)


def test_repeat_at_any_tick_does_not_alter_the_current_trial() -> None:
    """The same movement with a trial added at any tick: the trial ends at the same tick, and the block one later."""
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(8000, *steered(stage, np.arange(8000) * 1e-3)))
    rows["command"][0] = Cause.START
    begun = stage.initial(trial=2)
    begun["target"], begun["p"] = 1, -0.15
    plain, state = rows.copy(), begun.copy()
    stage.advance(state, plain, 0, len(plain))
    assert (state["phase"], state["trial"]) == (Phase.FINISHED, 2)
    (held,) = plain["tick"][plain["event"] == Cause.HELD]
    (entered,) = plain["tick"][plain["event"] == Cause.ENTERED][-1:]
    for tick in (300, entered, held, held + 1):
        longer, state = rows.copy(), begun.copy()
        longer["command"][tick] = Cause.REPEAT
        stage.advance(state, longer, 0, len(longer))
        assert longer["completion"][held + 1] == plain["completion"][held + 1] > 0
        assert (longer["event"][held], longer["phase"][held + 2]) == (Cause.HELD, Phase.LEVELLING)
        assert (state["trial"], state["extra"]) == (3, 1)


def test_block_duration_counts_trial_time_and_ends_after_an_attempt() -> None:
    stage = make_stage(
        parse("[block]\nduration = 0.05\n[task]\ntime_limit = 0.1\nlevel_time = 0.0\nlevel_height = 0.05")
    )
    rows, state = started(inputs(400, 0.002, 0.002)), stage.initial()
    rows["command"][[20, 120]] = Cause.PAUSE, Cause.RESUME
    stage.advance(state, rows, 0, 400)
    assert rows["block_ticks"][[1, 20, 21, 120, 121, 122]].tolist() == [0, 19, 20, 20, 20, 21]
    causes = [cause for _, cause in events(rows)]
    assert causes[-2:] == [Cause.TIMED_OUT, Cause.LAST]
    assert causes.count(Cause.TIMED_OUT) == 1
    assert (state["phase"], state["trial"], state["failures"]) == (Phase.FINISHED, 1, 1)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.sampled_from([*Cause, *[Cause.SKIP] * 6, *[Cause.REPEAT] * 3]), min_size=1, max_size=300),
    st.integers(1, 5),
)
def test_any_commands_follow_the_transition_table_and_the_block_ends(commands: list[Cause], trials: int) -> None:
    stage = make_stage(parse(f"[block]\ntrials = {trials}\nfirst_target = 'right'"))
    rows = started(inputs(len(commands) + 1, 0.02, -0.02))
    rows["command"][1:] = commands
    state = play(stage, rows)[0]
    assert rows["extra"].min() >= 0
    phases = [*rows["phase"].tolist(), int(state["phase"])]
    for row, phase, then in zip(rows, phases, phases[1:], strict=False):
        if phase != then:
            assert TABLE[Phase(phase)][Cause(int(row["event"]))][0] == then
    alternating = np.where(rows["trial"] % 2 == 1, 1, -1)
    assert np.array_equal(rows["target"], alternating)
    # Skipping every remaining trial ends the block.
    ending = inputs(2 * (int(state["trial"]) + trials + int(state["extra"]) + 2), 0.02, -0.02)
    ending["command"][0], ending["command"][1:] = Cause.RESUME, Cause.SKIP
    after = state.reshape(1).copy()
    stage.advance(after, ending, 0, len(ending))
    assert after["phase"] == Phase.FINISHED
    done = rows["event"].tolist() + ending["event"].tolist()
    if Cause.STOP not in commands:
        assert after["trial"][0] >= trials
        reopened = sum(phase == Phase.FINISHED != then for phase, then in pairwise(phases))
        assert done.count(Cause.LAST) == 1 + reopened


# --- the same again --------------------------------------------------------------------------------------------------


def test_verification_finds_the_first_differing_bit() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(1000, 0.01))
    play(stage, rows)
    assert verify(stage, rows).identical
    forged = rows.copy()
    forged["theta"][700] = np.nextafter(forged["theta"][700], 1)
    verdict = verify(stage, forged)
    assert (verdict.identical, verdict.tick, verdict.field) == (False, 700, "theta")
    assert verdict.recorded != verdict.computed
    other = verify(make_stage(parse(RIGHT_FIRST + "[physics]\nk_h = 201.0")), rows)
    assert not other.identical


def test_verification_restarts_after_a_gap_and_counts_it() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(1000, 0.01))
    play(stage, rows)
    verdict = verify(stage, np.delete(rows, slice(300, 320)))
    assert (verdict.identical, verdict.gaps, verdict.checked) == (True, 1, 980)
    assert verify(stage, rows[:0]).identical


def test_verification_can_start_at_any_row() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(1000, 0.01))
    end = play(stage, rows)
    again = rows[400:].copy()
    state = state_of(again[:1])
    stage.advance(state, again, 0, 600)
    assert state.tobytes() == end.tobytes()
    assert again.tobytes() == rows[400:].tobytes()


PLAIN = """
import numpy as np
import sys
sys.path.insert(0, {folder!r})
from test_stage import RIGHT_FIRST, inputs, play, started
from netboard.base.config import parse
from netboard.stage.stage import make_stage
heights = 0.02 * np.sin(np.arange(1500) * 4e-3)
rows = started(inputs(1500, heights, -heights))
rows["left_live"][700:720] = 0
for block in ("", "force = 'environment_only'\\nforce_scale = 0.7\\ncatch = [2]"):
    play(make_stage(parse(RIGHT_FIRST + block)), rows)
    sys.stdout.buffer.write(rows.tobytes())
"""


@pytest.mark.slow
def test_compiled_and_interpreted_stages_give_the_same_bits() -> None:
    folder = os.path.dirname(__file__)  # noqa: PTH120
    script = PLAIN.format(folder=folder)
    outputs = [
        subprocess.run(
            [sys.executable, "-c", script], capture_output=True, check=True, env=os.environ | {"NUMBA_DISABLE_JIT": off}
        ).stdout
        for off in ("0", "1")
    ]
    assert len(outputs[0]) == 2 * 1500 * TICK.itemsize
    assert outputs[0] == outputs[1]
