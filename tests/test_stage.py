"""The stage: one tick, many ticks, and the same ticks again."""

import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from netboard.config import Config, parse
from netboard.experiment.machine import BALL_FREE, Cause, Phase
from netboard.recording.verification import state_of, verify
from netboard.stage import Stage, make_stage
from netboard.tick import INPUT, OUTPUT, SERVICE, STATE, TICK, TICK_NS

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


def test_a_row_is_made_of_its_four_parts_and_every_field_is_one_word() -> None:
    names = [*INPUT.names, *STATE.names, *OUTPUT.names, *SERVICE.names]  # type: ignore[misc]
    assert list(TICK.names or ()) == names
    assert all(TICK[name].itemsize == 8 for name in names)
    assert TICK.itemsize == 8 * len(names)


def test_one_call_with_many_ticks_and_many_calls_with_one_give_the_same_bits() -> None:
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


def test_rows_may_be_a_ring() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(100, 0.01, 0.0))
    ring, state = np.zeros(8, TICK), stage.initial()
    for i in range(100):
        ring[i % 8] = rows[i]
        stage.advance(state, ring, i)
    assert state.tobytes() == play(stage, rows).tobytes()


def test_the_forces_of_a_level_board_at_rest_are_those_of_statics() -> None:
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


def test_a_trial_from_the_level_board_to_success_and_the_next_target() -> None:
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


def test_a_ball_that_falls_fails_the_attempt_and_the_same_trial_comes_again() -> None:
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


def test_without_haptics_the_hands_are_sent_nothing_and_the_board_moves_alike() -> None:
    on, off = started(inputs(2000, 0.01)), started(inputs(2000, 0.01))
    play(make_stage(parse(RIGHT_FIRST)), on)
    play(make_stage(parse(RIGHT_FIRST + "haptics = false")), off)
    assert np.any(on["left_force"] != 0)
    assert not np.any(off["left_force"])
    assert not np.any(off["right_force"])
    assert all(np.array_equal(on[name], off[name]) for name in STATE.names or ())


def test_nothing_is_felt_before_the_block_nor_paused() -> None:
    rows = inputs(3000, 0.01)
    rows["command"][1000], rows["command"][2000] = Cause.START, Cause.PAUSE
    play(make_stage(parse(RIGHT_FIRST)), rows)
    felt = rows["left_force"] != 0
    assert not felt[:1001].any()
    assert felt[1001:2001].all()
    assert not felt[2001:].any()


def test_a_sample_is_extrapolated_by_its_velocity_over_at_most_10_ms() -> None:
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


def test_a_stylus_that_speeds_up_is_met_where_it_is_from_the_second_sample_on() -> None:
    rows = speeding_up(6)
    play(make_stage(Config()), rows)
    t = np.arange(6) * 1e-3 + 0.4e-3
    assert rows["left_used_z"][1:] == pytest.approx(2.0 * t[1:] ** 2, rel=1e-12)
    assert rows["left_used_vz"][1:] == pytest.approx(4.0 * t[1:], rel=1e-12)
    assert rows["left_used_az"].tolist() == pytest.approx([0.0, *[4.0] * 5], rel=1e-9)


def test_a_hold_can_be_simpler() -> None:
    rows = speeding_up(4)
    play(make_stage(parse('[physics]\nhold = "cv"')), rows)
    assert rows["left_used_z"] == pytest.approx(rows["left_sent_z"] + 0.4e-3 * rows["left_sent_vz"], rel=1e-12)
    assert not rows["left_used_az"].any()
    play(make_stage(parse('[physics]\nhold = "zoh"')), rows)
    assert rows["left_used_z"].tolist() == rows["left_sent_z"].tolist()


def test_in_a_burst_of_loss_the_acceleration_counts_for_5_ms_and_the_velocity_for_10() -> None:
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
def test_an_acceleration_is_told_from_neighbours_alone_and_bounded(gap_ns: int, slope: float) -> None:
    rows = inputs(2)
    rows["left_sent_vz"] = 0.0, 0.2
    rows["left_stamp_ns"][1] = rows["left_stamp_ns"][0] + gap_ns
    play(make_stage(Config()), rows)
    assert rows["left_used_az"][1] == slope


def test_a_stylus_is_clipped_to_its_range_and_then_at_rest() -> None:
    rows = inputs(2, 0.2, -0.2)
    rows["left_sent_vz"] = 1.0
    play(make_stage(Config()), rows)
    assert rows["left_used_z"].tolist() == [0.075] * 2
    assert rows["right_used_z"].tolist() == [-0.075] * 2
    assert rows["left_used_vz"].tolist() == [0.0] * 2


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
def test_a_sample_that_is_no_number_counts_as_none_and_the_last_height_stays(bad: float) -> None:
    rows = started(inputs(100, 0.01, 0.0))
    rows["left_sent_z"][50:] = bad
    state = play(make_stage(Config()), rows)
    assert np.all(rows["left_used_z"][49:] == rows["left_used_z"][49])
    assert np.isfinite(state["z"]).all()


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1e300, -10.1])
def test_a_rate_that_no_hand_has_counts_as_no_sample(bad: float) -> None:
    rows = started(inputs(100, 0.01, 0.0))
    rows["left_sent_vz"][50:] = bad
    play(make_stage(Config()), rows)
    assert np.all(rows["left_used_z"][50:] == rows["left_used_z"][49])
    assert not rows["left_used_vz"][50:].any()
    assert np.abs(rows["left_coupling"]).max() < 5.0


def test_a_side_without_a_live_sample_feels_nothing() -> None:
    rows = started(inputs(200, 0.01, 0.01))
    rows["left_live"][100:] = 0
    play(make_stage(Config()), rows)
    assert not rows["left_force"][100:].any()
    assert rows["right_force"][100:].all()


def test_a_board_that_is_no_longer_finite_is_a_fault_and_is_put_at_rest() -> None:
    stage = make_stage(Config())
    rows, state = started(inputs(10)), stage.initial()
    stage.advance(state, rows, 0, 5)
    state["omega"] = np.inf
    stage.advance(state, rows, 5, 1)
    assert rows["event"][5] == Cause.FAULT
    assert state["phase"] == Phase.PAUSED
    assert np.isfinite([float(state[name][0]) for name in ("z", "vz", "theta", "omega", "p", "vp")]).all()


def test_a_board_that_stands_upright_is_a_fault_and_is_put_at_rest() -> None:
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
def test_whatever_comes_in_the_state_stays_finite_and_the_counts_stay_true(
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


def test_verification_finds_the_first_bit_that_differs() -> None:
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


def test_verification_starts_afresh_after_a_gap_and_says_so() -> None:
    stage = make_stage(parse(RIGHT_FIRST))
    rows = started(inputs(1000, 0.01))
    play(stage, rows)
    verdict = verify(stage, np.delete(rows, slice(300, 320)))
    assert (verdict.identical, verdict.gaps, verdict.checked) == (True, 1, 980)
    assert verify(stage, rows[:0]).identical


def test_any_row_can_start_a_verification() -> None:
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
from netboard.config import parse
from netboard.stage import make_stage
heights = 0.02 * np.sin(np.arange(1500) * 4e-3)
rows = started(inputs(1500, heights, -heights))
rows["left_live"][700:720] = 0
play(make_stage(parse(RIGHT_FIRST)), rows)
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
    assert len(outputs[0]) == 1500 * TICK.itemsize
    assert outputs[0] == outputs[1]
