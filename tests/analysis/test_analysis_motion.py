"""Filtered recordings, trials cut out of them, and completion times."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from two_hands import minimum_jerk, rolled, two_hands

from netboard.analysis.measures.motion import (
    FAST,
    SLOW,
    FilteredMotion,
    Trial,
    ball_speed,
    find_completion,
    motion,
    placements,
)
from netboard.analysis.measures.signals import derivative

HANDS = two_hands([(0.5, 0.4, 0.01), (1.2, 0.3, -0.012)], [(0.55, 0.4, -0.01), (1.2, 0.3, 0.01)])
BALL, BALL_RATE = rolled(HANDS.theta, HANDS.rate, -0.15)


def filtered(**options: object) -> FilteredMotion:
    return motion(HANDS.rate, HANDS.left_z, HANDS.right_z, HANDS.theta, BALL, **options)  # type: ignore[arg-type]


@pytest.mark.evidence("truth", motion)
def test_filters_preserve_slow_movements() -> None:
    found = filtered()
    np.testing.assert_allclose(found.left_z, HANDS.left_z, atol=2e-5)
    np.testing.assert_allclose(found.left_vz, HANDS.left_vz, atol=1e-3)
    np.testing.assert_allclose(found.right_vz, HANDS.right_vz, atol=1e-3)
    np.testing.assert_allclose(found.p, BALL, atol=1e-6)
    np.testing.assert_allclose(found.vp, BALL_RATE, atol=3e-4)
    np.testing.assert_allclose(found.speed, np.abs(BALL_RATE), atol=3e-3)
    assert np.abs(found.omega - HANDS.omega).max() < 0.15 * np.abs(HANDS.omega).max()


@pytest.mark.evidence("disturbance", motion, of="noise")
def test_tremor_is_kept_in_the_angle_and_removed_from_the_angular_velocity() -> None:
    """A tremor of 12 Hz passes the 20 Hz filter of the angle, not the 5 Hz filter of the angular velocity."""
    tremor = 0.001 * np.sin(2 * np.pi * 12 * HANDS.times)
    found = motion(HANDS.rate, HANDS.left_z, HANDS.right_z, tremor, BALL)
    middle = slice(1000, 2000)
    np.testing.assert_allclose(found.theta[middle], tremor[middle], rtol=0.01, atol=1e-5)
    assert np.abs(found.omega[middle]).max() < 2e-4 * np.abs(derivative(tremor, HANDS.rate)).max()


def test_recorded_velocities_are_filtered_and_used() -> None:
    found = filtered(left_vz=HANDS.left_vz + 1)
    np.testing.assert_allclose(found.left_vz, FAST(HANDS.left_vz, HANDS.rate) + 1, atol=1e-9)
    np.testing.assert_array_equal(found.right_vz, filtered().right_vz)
    np.testing.assert_array_equal(filtered(right_vz=HANDS.right_vz).right_vz, FAST(HANDS.right_vz, HANDS.rate))


@pytest.mark.evidence("truth", ball_speed)
def test_speed_is_filtered_before_or_after_taking_the_absolute_value() -> None:
    wave = np.sin(2 * np.pi * HANDS.times)
    first = ball_speed(wave, HANDS.rate)
    np.testing.assert_array_equal(first, SLOW(np.abs(wave), HANDS.rate))
    after = ball_speed(wave, HANDS.rate, order="filter_first")
    np.testing.assert_array_equal(after, np.abs(SLOW(wave, HANDS.rate)))
    middle = slice(1000, 2000)
    assert first[middle].min() > 0.05 > after[middle].min()


@pytest.mark.evidence("truth", placements, motion)
def test_placing_the_ball_adds_no_speed() -> None:
    p = np.where(HANDS.times < 1.5, 0.36, -0.15)
    placed = placements(p, HANDS.rate)
    assert placed.tolist() == [1500]
    still = motion(HANDS.rate, HANDS.left_z, HANDS.right_z, HANDS.theta, p, placed=placed)
    assert np.abs(still.vp).max() < 1e-9
    assert still.speed.max() < 1e-9
    smeared = motion(HANDS.rate, HANDS.left_z, HANDS.right_z, HANDS.theta, p)
    assert smeared.speed[int(2.0 * HANDS.rate)] > 0.01, (
        "otherwise the jump still shows in the speed half a second later"
    )


def test_filtering_a_segment_equals_filtering_the_whole_recording() -> None:
    long = two_hands([(2.0, 0.4, 0.01)], [(2.0, 0.4, -0.01)], length=5.0)
    whole = motion(long.rate, long.left_z, long.right_z, long.theta, long.theta)
    part = slice(500, 4500)
    cut = motion(long.rate, long.left_z[part], long.right_z[part], long.theta[part], long.theta[part])
    np.testing.assert_allclose(cut.omega, whole.omega[part], atol=1e-7)


def test_arrays_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="one value each"):
        motion(1000.0, HANDS.left_z, HANDS.right_z[1:], HANDS.theta, BALL)


def test_trial_windows_end_at_completion_or_at_the_end_of_the_trial() -> None:
    success = Trial(100, 900, 0.15, 500)
    assert (success.window(), success.window("whole")) == (slice(100, 500), slice(100, 900))
    failure = Trial(100, 900, -0.15)
    assert (failure.window(), failure.window("whole")) == (slice(100, 900), slice(100, 900))
    assert (success.side, failure.side) == (1, -1)


def ball_enters(at: float, rate: float, stay: float, leave: float = 0.0) -> np.ndarray:
    """A ball that jumps to the target's centre and stays; with `leave`, it leaves once and then returns for good."""
    times = np.arange(round(10 * rate)) / rate
    p = np.where(times >= at, 0.15, -0.15)
    return np.where((times > at + stay) & (times < at + stay + leave), 0.0, p) if leave else p


@pytest.mark.evidence("properties", find_completion, of="rate")
@pytest.mark.evidence("truth", find_completion)
@pytest.mark.parametrize("rate", [100.0, 1000.0, 4000.0])
def test_completion_time_is_the_start_of_the_hold(rate: float) -> None:
    found = find_completion(ball_enters(2.0, rate, 10), rate, 0.15)
    assert (found.time, found.sample, found.entries) == (2.0, round(2 * rate), 1)
    found = find_completion(ball_enters(2.0, rate, 1.4, leave=0.6), rate, 0.15)
    assert found.time == pytest.approx(4.0, abs=1.5 / rate)
    assert found.entries == 2


@pytest.mark.evidence("truth", find_completion)
def test_hold_must_last_its_full_duration() -> None:
    inside = np.full(1501, 0.15)
    assert find_completion(inside, 1000.0, 0.15).time == 0
    none = find_completion(inside[1:], 1000.0, 0.15)
    assert np.isnan(none.time)
    assert (none.sample, none.entries) == (None, 1)
    assert find_completion(inside[1:], 1000.0, 0.15, hold=1.4).time == 0


@pytest.mark.evidence("truth", find_completion)
def test_target_includes_its_edge_and_whole_ball_completes_later() -> None:
    at_edge = np.full(2000, 0.25)
    assert find_completion(at_edge, 1000.0, 0.125, half_width=0.125).time == 0
    assert np.isnan(find_completion(at_edge, 1000.0, 0.125, half_width=0.124).time)
    p = minimum_jerk(np.arange(4000) / 1000, 0, 1.0, 0.30) - 0.15
    centre = find_completion(p, 1000.0, 0.15)
    ball = find_completion(p, 1000.0, 0.15, inside="whole_ball")
    assert p[centre.sample] == pytest.approx(0.115, abs=1e-3)
    assert p[ball.sample] == pytest.approx(0.140, abs=1e-3)


@pytest.mark.evidence("properties", find_completion, of=("time", "mirror", "constant"))
@given(st.floats(0.1, 3), st.floats(0.1, 1.3), st.floats(0.1, 1), st.floats(-1, 1))
def test_completion_is_invariant_to_mirroring_and_shifts(at: float, stay: float, leave: float, origin: float) -> None:
    p = ball_enters(at, 200.0, stay, leave) + 1e-4
    found = find_completion(p, 200.0, 0.15)
    assert found == find_completion(-p, 200.0, -0.15) == find_completion(p + origin, 200.0, 0.15 + origin)
    later = find_completion(np.concatenate([np.full(50, -0.15), p]), 200.0, 0.15)
    assert later.sample == (found.sample or 0) + 50


def test_velocity_is_the_derivative_of_the_filtered_position() -> None:
    found = filtered()
    np.testing.assert_array_equal(found.left_vz, derivative(found.left_z, HANDS.rate))
    np.testing.assert_array_equal(found.vp, derivative(found.p, HANDS.rate))
